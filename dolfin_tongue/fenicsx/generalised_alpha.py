"""Motion in time with PETSc TS ``alpha2``, the generalised-alpha method of Chung and Hulbert 1993.

The stage of the method stands at t_n + alpha_f dt. Momentum is stated there. The volume condition
and the held nodes are stated at the end of the step, whose state follows from the stage by
y_end = y_n + (y_stage - y_n) / alpha_f. So every accepted state keeps its volumes to the tolerance
of Newton's method; stated at the stage, they would be lost at order dt^2.
The pressure is an unknown of the stage and has no memory.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from petsc4py import PETSc

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.base.errors import NotConverged, OutOfRange, require_positive
from dolfin_tongue.body.shape import gauss_jacobians
from dolfin_tongue.fenicsx.newton import (
    SNES_OPTIONS,
    Newton,
    Reason,
    Tolerances,
    reason_name,
    set_options,
)
from dolfin_tongue.fenicsx.system import System
from dolfin_tongue.march.diagnosis import where_and_why
from dolfin_tongue.march.state import State
from dolfin_tongue.scene.scene import SAME_TIME, Scene

#: Time-stepping methods and the options of TS that choose them, besides the spectral radius.
METHODS: dict[str, dict[str, float]] = {
    "generalised_alpha": {},
    "backward_euler": {
        "ts_alpha_alpha_m": 1,
        "ts_alpha_alpha_f": 1,
        "ts_alpha_gamma": 1,
        "ts_alpha_beta": 0.5,
    },
}


#: Reasons to refuse a step that Newton's method solved, beside those of PETSc: its end has an
#: inverted cell, or is refused by contact.
INVERTED, REFUSED = -1000, -1001


@dataclass(frozen=True)
class TimeSteps:
    """How to march in time.

    Parameters
    ----------
    dt : step, s, > 0; with `tolerance` the first step and the unit of the limits.
    method : ``"generalised_alpha"`` or, for comparisons, ``"backward_euler"`` (order 1, the member
        alpha_m = alpha_f = gamma = 1, beta = 1/2 of the same family).
    spectral_radius : of the method at high frequencies, in [0, 1]; 1 keeps all energy and dies of
        it, 0 damps the most. The default 0.8 damps what dt does not resolve within some steps.
    tolerance : largest error of a nodal displacement per step, m; None keeps dt fixed.
    largest : largest step where the step adapts, s; default 10 dt.
    smallest : step below which a run that loses convergence is given up, s; default dt / 1000.
    newton : tolerances of Newton's method.
    """

    dt: float = 5e-3
    method: str = "generalised_alpha"
    spectral_radius: float = 0.8
    tolerance: float | None = None
    largest: float | None = None
    smallest: float | None = None
    newton: Tolerances = field(default_factory=Tolerances)

    def __post_init__(self) -> None:
        require_positive(self, "s", dt=self.dt)
        if not 0 <= self.spectral_radius <= 1:
            raise OutOfRange("TimeSteps.spectral_radius", self.spectral_radius, "in [0, 1]")
        if self.tolerance is not None:
            require_positive(self, "m", tolerance=self.tolerance)
        for name in ("smallest", "largest"):
            if getattr(self, name) is not None:
                require_positive(self, "s", **{name: getattr(self, name)})
        smallest, largest = self.step_limits
        if not smallest <= self.dt <= largest:
            raise OutOfRange("TimeSteps.dt", self.dt, f"between {smallest:g} and {largest:g}", "s")
        if not isinstance(self.newton, Tolerances):
            raise OutOfRange("TimeSteps.newton", self.newton, "of the class Tolerances")
        if self.method not in METHODS:
            raise OutOfRange("TimeSteps.method", self.method, f"one of {', '.join(METHODS)}")

    @property
    def stage(self) -> float:
        """Fraction of a step at which its stage stands, alpha_f."""
        return 1.0 if self.method == "backward_euler" else 1 / (1 + self.spectral_radius)

    @property
    def step_limits(self) -> tuple[float, float]:
        """Smallest and largest step, s."""
        return (self.smallest or self.dt / 1000, self.largest or 10 * self.dt)


class Dynamics:
    """Motion of a scene from an initial state.

    Parameters
    ----------
    scene : body, terms, supports.
    steps : step size, method, tolerances.
    pair : displacement and pressure spaces, see `mesh.PAIRS`.
    """

    newton: Newton

    def __init__(self, scene: Scene, steps: TimeSteps | None = None, pair: str = "Q1/P0"):
        self.system = System(scene, dynamic=True, pair=pair)
        self.steps = steps or TimeSteps()
        self._velocity_before: FloatArray | None = None
        self._multipliers_before: FloatArray | None = None
        self._refusal, self._stepped = "", False
        self._multipliers = np.zeros(len(self.system.multiplier_dofs))
        self._connect()

    def _connect(self) -> None:
        """Make TS and Newton; anew after PETSc broke off, since its vectors stay locked."""
        self.ts = self._new_ts()
        counts = self.newton.counts if hasattr(self, "newton") else None
        self.newton = Newton(self.system, self.ts.getSNES(), self.steps.newton, counts)
        self.ts.setI2Jacobian(self.newton.careful(self._jacobian), self.newton.matrix)
        function = self.newton.careful(self._function)
        self.ts.setI2Function(function, PETSc.Vec().createSeq(self.system.size))
        self.ts.getSNES().setInitialGuess(self.newton.careful(self._predict))

    def _new_ts(self) -> PETSc.TS:
        ts = PETSc.TS().create(PETSc.COMM_SELF)
        ts.setType("alpha2")
        ts.setMaxTime(1e300)  # the end is ours to meet; see `_march_segment`
        ts.setMaxSteps(2**31 - 2)
        ts.setMaxSNESFailures(-1)
        ts.setMaxStepRejections(0)  # a failed step comes back to us; see `_advance`
        ts.setErrorIfStepFails(False)
        method = {"ts_alpha_radius": self.steps.spectral_radius, "ts_adapt_type": "none"}
        set_options(ts, method | METHODS[self.steps.method] | SNES_OPTIONS)
        return ts

    # -- callbacks of PETSc --------------------------------------------------------------------

    def _set_state(
        self, ts: PETSc.TS, time: float, state: PETSc.Vec, rate: PETSc.Vec, acceleration: PETSc.Vec
    ) -> tuple[float, float]:
        """Hand a stage to the system; (end time of the step, fraction at which the stage stands).

        While TS estimates an initial acceleration by two backward Euler steps of half size, its
        step is that half, and the stage stands at or beyond the end: there stage and end agree.
        """
        dt, begin = ts.getTimeStep(), ts.getTime()
        fraction = (time - begin) / dt
        if fraction > 1 - 1e-9:
            fraction, time_end, end = 1.0, time, state.array_r
        else:
            start = ts.getSolution().array_r
            end = start + (state.array_r - start) / fraction
            time_end = begin + dt
        self.system.set_state(time, state.array_r, rate.array_r, acceleration.array_r, end)
        return time_end, fraction

    def _function(self, ts, time, state, rate, acceleration, out) -> None:
        time_end, _ = self._set_state(ts, time, state, rate, acceleration)
        self.newton.residuals += 1
        self.system.residual(time_end, out.array_w)
        self._multipliers = state.array_r[self.system.multiplier_dofs]

    def _jacobian(self, ts, time, state, rate, acceleration, shift_v, shift_a, matrix, _) -> None:
        def assemble() -> None:
            time_end, fraction = self._set_state(ts, time, state, rate, acceleration)
            self.system.jacobian(matrix, (shift_v, shift_a, 1.0 / fraction), time_end)

        self.newton.jacobian(matrix, (shift_v, shift_a), assemble)

    def _predict(self, snes: PETSc.SNES, guess: PETSc.Vec) -> None:
        """Start Newton from an extrapolated displacement; TS itself would start from no motion."""
        _, rate = self.ts.getSolution2()
        velocity = rate.array_r
        if self._velocity_before is not None:
            velocity = 1.5 * velocity - 0.5 * self._velocity_before
        dofs = self.system.position_dofs
        guess.array_w[dofs] += self.ts.getTimeStep() * velocity[dofs]

    # -- marching ------------------------------------------------------------------------------

    def march(self, end: float, start: State | None = None) -> Iterator[State]:
        """March to an end time, which is met exactly; yields every accepted state.

        The first state yielded is the start itself. Steps end at each break point of the
        activations, so that a kink or jump costs no order of accuracy.

        Parameters
        ----------
        end : s.
        start : state to start from; default: the reference configuration at rest at t = 0.

        Raises
        ------
        OutOfRange : `end` not after the start.
        NotConverged : when steps were cut to the smallest; all states before were yielded.
        """
        state = start or self.rest()
        if not end > state.time:
            raise OutOfRange("end", end, f"> {state.time:g} (the start)", "s")
        self._set_solution(state)
        yield state
        jumps = self.system.scene.jumps
        first, last = state.time + SAME_TIME, end - SAME_TIME
        inner = [t for t in self.system.scene.breakpoints if first < t < last]
        for segment_start, segment_end in pairwise([state.time, *inner, end]):
            if segment_start in jumps:
                self._restart()
            for accepted in self._march_segment(state, segment_end):
                state = accepted
                yield state

    def rest(self, time: float = 0.0) -> State:
        """Return the reference configuration at rest."""
        zero = np.zeros(self.system.size)
        return self.system.state_of(time, zero, zero)

    def _set_solution(self, state: State) -> None:
        self._set_vectors(state.time, *self.system.vectors(state))

    def _set_vectors(self, time: float, y: FloatArray, rate: FloatArray) -> None:
        """Give TS new vectors and let it begin there."""
        self.ts.setTime(time)
        self.ts.setTimeStep(self.steps.dt)
        self.ts.setSolution2(*(PETSc.Vec().createWithArray(x.copy()) for x in (y, rate)))
        self._restart()

    def _restart(self) -> None:
        """Forget accelerations and predictions: the motion has a new beginning."""
        self.ts.restartStep()
        self._velocity_before = self._multipliers_before = None
        self.newton.renew()

    def _march_segment(self, state: State, end: float) -> Iterator[State]:
        """March from a state to the end of a smooth stretch of time."""
        proposal = self.steps.dt
        while state.time < end:
            remaining = end - state.time
            dt = remaining / max(1, int(np.ceil(remaining / proposal - 1e-6)))
            state, error = self._advance(state, dt, end)
            proposal = self._next_step(state.step, error)
            yield state

    def _next_step(self, taken: float, error: float | None) -> float:
        """Next step: the nominal one, or the one that the error estimate allows.

        After a cut steps grow by half at most: the method carries the acceleration of a short step
        into the next one, and over a step four times as long it would be a push that no force gave.
        """
        smallest, largest = self.steps.step_limits
        if error is None or self.steps.tolerance is None:
            return min(self.steps.dt, 1.5 * taken)
        factor = 0.9 * (self.steps.tolerance / max(error, 1e-300)) ** (1 / 3)
        return float(np.clip(taken * np.clip(factor, 0.2, 2.0), smallest, largest))

    def _advance(self, state: State, dt: float, end: float) -> tuple[State, float | None]:
        """Take one step of at most dt, cutting it where Newton fails or the error is too large."""
        iterations = self.newton.iterations
        self._begin = begin = self._snapshot()
        for part in self.system.couplings:
            part.begin(state.time, begin[0])
        rolled_back = False
        while True:
            self.ts.setTimeStep(dt)
            before = self.ts.getTime()
            reason = self._try_step()
            error = self._local_error(state, dt) if reason > 0 else None
            if reason > 0 and not self._too_large(error, dt):
                break
            dt = self._cut(dt, error)
            if not dt >= self.steps.step_limits[0]:
                body = self.system.scene.body
                raise NotConverged(
                    self._name(reason), state.time, where_and_why(body, state.displacement)
                )
            if reason == Reason.DIVERGED_LINEAR_SOLVE:
                self._connect()
                self._set_vectors(before, *begin)
                continue
            self._restore(begin, before, rolled_back and not self._stepped)
            rolled_back = True
        time = end if abs(self.ts.getTime() - end) <= 1e-9 * dt else self.ts.getTime()
        self.ts.setTime(time)
        self._velocity_before = begin[1]
        return self._accepted(time, dt, self.newton.iterations - iterations), error

    def _try_step(self) -> int:
        """One TS step; the reason of its last Newton solve."""
        self._stepped = False
        self.ts.setConvergedReason(PETSc.TS.ConvergedReason.ITERATING)
        try:
            self.ts.step()
        except PETSc.Error as error:  # the factorisation broke down: a smaller step may do
            self.newton.reraise(error)
            return Reason.DIVERGED_LINEAR_SOLVE
        reason = self.ts.getSNES().getConvergedReason()
        self._stepped = reason > 0
        return self._judged(reason) if reason > 0 else reason

    def _judged(self, reason: int) -> int:
        """Refuse a step whose end, beyond the stage that was solved, is impossible."""
        y = self.ts.getSolution2()[0].array_r
        body, displacement = self.system.scene.body, self.system.displacement(y)
        if not (gauss_jacobians(body.points + displacement, body.cells) > 0).all():
            return INVERTED
        time, before = self.ts.getTime(), self._begin[0]
        for part in self.system.couplings:
            if refusal := part.refusal(time, y, before):
                self._refusal = refusal
                return REFUSED
        return reason

    def _name(self, reason: int) -> str:
        """Words for a reason."""
        names = {INVERTED: "INVERTED_CELL", REFUSED: self._refusal}
        return names.get(reason) or reason_name(reason)

    def _cut(self, dt: float, error: float | None) -> float:
        """Smaller step after a failure (a quarter) or after too large an error."""
        if error is None or self.steps.tolerance is None:
            return dt / 4
        shorter = dt * max(0.2, 0.8 * (self.steps.tolerance / error) ** (1 / 3))
        return max(shorter, self.steps.step_limits[0])  # at the smallest step any error is taken

    def _too_large(self, error: float | None, dt: float) -> bool:
        smallest, _ = self.steps.step_limits
        limit = self.steps.tolerance
        return limit is not None and error is not None and error > limit and dt > smallest

    def _local_error(self, state: State, dt: float) -> float | None:
        """Error of the step, m: a third of the difference to the extrapolated velocity's path."""
        if self.steps.tolerance is None or self._velocity_before is None:
            return None
        solution, _ = self.ts.getSolution2()
        dofs = self.system.space.displacement_dofs
        previous = self._velocity_before[dofs]
        ratio = dt / state.step if state.step else 1.0
        predicted = state.velocity + 0.5 * ratio * (state.velocity - previous)
        path = state.displacement + dt * predicted
        return float(np.abs(solution.array_r[dofs] - path).max()) / 3

    def _snapshot(self) -> tuple[FloatArray, FloatArray]:
        solution, rate = self.ts.getSolution2()
        return solution.array_r.copy(), rate.array_r.copy()

    def _restore(
        self, begin: tuple[FloatArray, FloatArray], time: float, rolled_back: bool
    ) -> None:
        """Return to the begin of a step that failed, with the acceleration that was there.

        TS keeps that for the next try if it was told to roll back. A try that fails does not undo
        the telling; one that TS completed, and that we refuse, does. An acceleration estimated anew
        would add the velocity's error across the volume condition over and over, until repeated
        cuts let the velocities grow as 1/dt.
        """
        if not rolled_back:
            self.ts.rollBack()
        solution, rate = self.ts.getSolution2()
        solution.array_w[:], rate.array_w[:] = begin
        self.ts.setTime(time)
        self.newton.renew()

    def _accepted(self, time: float, dt: float, iterations: int) -> State:
        """State at the end of a step, with the multipliers extrapolated from the stages."""
        solution, rate = self.ts.getSolution2()
        multipliers: FloatArray = self._multipliers
        if self._multipliers_before is not None:
            change = multipliers - self._multipliers_before
            multipliers = multipliers + (1 - self.steps.stage) * change
        self._multipliers_before = self._multipliers
        solution.array_w[self.system.multiplier_dofs] = multipliers
        return self.system.state_of(time, solution.array_r, rate.array_r, dt, iterations)
