"""What the two solvers have in common: marching, memory, and what they are asked about a state."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Protocol

import numpy as np

from dolfin_tongue.base.errors import NotConverged, OutOfRange
from dolfin_tongue.body.state import NOTHING, State
from dolfin_tongue.control import Instant, Memory
from dolfin_tongue.march.diagnosis import diagnosis
from dolfin_tongue.march.observed import MuscleState, PointFields, Strain, Touch
from dolfin_tongue.march.steps import StepControl, fitting, stretches


@dataclass(frozen=True, eq=False)
class Attempt:
    """What came of a step that was tried.

    Parameters
    ----------
    state : its end; None where it failed.
    error : of a nodal displacement, m, where the method has an estimate.
    cause : why it failed, in words.
    """

    state: State | None
    error: float | None = None
    cause: str = ""


class Stepper(ABC):
    """Carries one run of one method through time. Whatever it changes it can take back."""

    @abstractmethod
    def begin(self, state: State) -> State:
        """Take a state as a new beginning (start, jump); returns it as the method sees it."""

    def enter(self, state: State, end: float) -> None:
        """Begin a smooth stretch of time, from a state to its end, s."""

    def bound(self) -> float:
        """Largest step that the method would take now, s."""
        return np.inf

    @abstractmethod
    def attempt(self, state: State, dt: float, end: float) -> Attempt:
        """Try a step.

        Parameters
        ----------
        state : the last accepted one, with its memory.
        dt : step, s.
        end : of the smooth stretch, s; met exactly where `dt` leads there.
        """

    @abstractmethod
    def counts(self) -> dict[str, int]:
        """Return how often what was done: steps, iterations, factorisations."""

    def accept(self) -> None:
        """Keep the step that was tried last."""

    def reject(self) -> None:
        """Take back the step that was tried last."""


class Observer(ABC):
    """What can be asked about a state of a scene, whichever solver made it."""

    scene: Any

    @abstractmethod
    def energies(self, state: State, now: Instant | None = None) -> dict[str, float]:
        """Energies by name, J: kinetic, and those of all terms that have one.

        Parameters
        ----------
        state : any.
        now : time and memory; default those of the state.
        """

    @abstractmethod
    def powers(self, state: State, now: Instant | None = None) -> dict[str, float]:
        """Power that each other term gives to the motion, by name, W."""

    @abstractmethod
    def support_work(self, first: State, second: State, middle: State) -> float:
        """Work of supports that move, J: their forces in the middle of a step times the way.

        The acceleration there is the change of velocity, so that two states say everything.
        """

    @abstractmethod
    def contacts(self, state: State, now: Instant | None = None) -> dict[str, Touch]:
        """Return what is touched, by the contact's name."""

    @abstractmethod
    def strain(self, state: State) -> Strain:
        """Deformation at the quadrature points."""

    @abstractmethod
    def fields(self, state: State) -> PointFields:
        """Strain, pressure and stress at the quadrature points."""

    @abstractmethod
    def muscles(self, state: State) -> dict[str, MuscleState]:
        """Activation, stretch, stress and force of each muscle that takes part."""


class Method(Protocol):
    """Numbers of a time-stepping method: `GeneralisedAlpha`, `TrBdf2`, `Adaptive`, ..."""

    def solver(self, scene: Any) -> Solver:
        """Return the solver of a scene."""


class Solver(Observer):
    """One scene under one time-stepping method.

    Attributes
    ----------
    name : of the solver.
    scene, method : what is solved, and how.
    control : sizes of steps.
    stepper : carries the method through time.
    """

    name: ClassVar[str]
    method: Any
    control: StepControl
    stepper: Stepper

    @abstractmethod
    def rest(self, time: float = 0.0) -> State:
        """Return the reference configuration at rest."""

    def counts(self) -> dict[str, int]:
        """Return how often what was done: steps, iterations, factorisations."""
        return self.stepper.counts()

    @abstractmethod
    def set_parameter(self, name: str, value: float) -> None:
        """Give a named parameter of the scene another value; UnknownName lists them."""

    @abstractmethod
    def force_by_parameter(self, name: str, state: State) -> Any:
        """Return the derivative of all nodal forces by a named parameter, shape (n, 3)."""

    # -- marching ----------------------------------------------------------------------------------

    def march(self, end: float, start: State | None = None) -> Iterator[State]:
        """March to an end time, which is met exactly; yields every accepted state.

        The first state yielded is the start itself. Steps end at each break point of the scene, so
        that a kink or jump costs no order of accuracy.

        Parameters
        ----------
        end : s.
        start : state to start from; default: the reference configuration at rest at t = 0.

        Raises
        ------
        OutOfRange : `end` not after the start; a step beyond a method's stability limit.
        NotConverged : when steps were cut to the smallest; all states before were yielded.
        """
        state = start or self.rest()
        if not end > state.time:
            raise OutOfRange("end", end, f"> {state.time:g} (the start)", "s")
        state = self.stepper.begin(self._remembering(state))
        yield state
        for stop, jump in stretches(self.scene, state.time, end):
            for accepted in self._stretch(state, stop):
                state = accepted
                yield state
            if jump:
                state = self.stepper.begin(state)

    def _stretch(self, state: State, end: float) -> Iterator[State]:
        """March from a state to the end of a smooth stretch of time."""
        self.stepper.enter(state, end)
        proposal = min(self.control.dt, self.control.largest)
        while state.time < end:
            dt = fitting(end - state.time, min(proposal, self.stepper.bound()))
            state, proposal = self._advance(state, dt, end)
            yield state

    def _advance(self, state: State, dt: float, end: float) -> tuple[State, float]:
        """Take one step of at most dt, cutting it where it fails or its error is too large."""
        while True:
            attempt = self.stepper.attempt(state, dt, end)
            new = attempt.state
            if new is not None and not self.control.too_large(attempt.error, dt):
                break
            self.stepper.reject()
            cause = attempt.cause or f"an error of {attempt.error:.2g} m"
            failed, dt = dt, self.control.shorter(dt, attempt.error)
            if not dt >= self.control.smallest:
                found = diagnosis(self.scene.body, state.displacement)
                raise NotConverged(f"{cause} in a step of {failed:.3g} s", state.time, found)
        self.stepper.accept()
        memory = self._memory_after(state, new)
        new = new if memory is new.memory else replace(new, memory=memory)
        return new, self.control.following(new.step, attempt.error)

    # -- memory ------------------------------------------------------------------------------------

    def _remembering(self, state: State) -> State:
        """State with the memory that a motion begins with; one that it has is kept."""
        memory = state.memory or self.scene.begin(self.scene.body, state)
        return replace(state, memory={**memory, **self.sides(state)} or NOTHING)

    def _memory_after(self, first: State, last: State) -> Memory:
        """Memory after a step that has been accepted."""
        if not first.memory:
            return NOTHING
        own = {name: part for name, part in first.memory.items() if name != "sides"}
        memory = self.scene.advance(own, self.scene.body, first, last) if own else {}
        return {**memory, **self.sides(last)} or NOTHING

    def sides(self, state: State) -> Mapping[str, Any]:
        """Where points of contact with a sheet are; see the contacts of each solver."""
        return NOTHING
