"""The direct solver of a scene under one method: marching, and what is observed."""

from __future__ import annotations

from functools import cached_property
from typing import Protocol

import numpy as np

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.base.errors import UnknownName
from dolfin_tongue.body.point_set import PointSet, gradients_at_points, points_of
from dolfin_tongue.body.state import State
from dolfin_tongue.constitutive.muscle_state import MuscleStates
from dolfin_tongue.control import Instant, Memory
from dolfin_tongue.direct.model import Model
from dolfin_tongue.direct.tissue import Tissue
from dolfin_tongue.march.observed import MuscleState, PointFields, Strain, Touch
from dolfin_tongue.march.solver import Solver, Stepper
from dolfin_tongue.march.steps import StepControl
from dolfin_tongue.scene.scene import Scene

#: Relative step of the central differences by which forces are derived by a parameter.
PARAMETER_STEP = 1e-5


class Method(Protocol):
    """Numbers of a time-stepping method of this solver."""

    @property
    def mass(self) -> str:
        """Consistent or lumped."""

    def solver(self, scene: Scene) -> DirectSolver:
        """Return the solver of a scene."""


class DirectSolver(Solver):
    """Motion of a scene by the report's own method.

    Parameters
    ----------
    method : its numbers.
    model : the equations.
    stepper : carries the method through time.
    control : sizes of steps.
    """

    name = "direct"
    method: Method

    def __init__(self, method: Method, model: Model, stepper: Stepper, control: StepControl):
        self.scene, self.method, self.model = model.scene, method, model
        self.stepper, self.control = stepper, control

    def rest(self, time: float = 0.0) -> State:
        """Return the reference configuration at rest."""
        zero = np.zeros(self.model.numbering.shape)
        nothing = np.zeros(self.model.constraints.count)
        return self.model.numbering.state(Instant(time), zero, zero.copy(), nothing)

    def sides(self, state: State) -> Memory:
        """Where points of contact with a sheet are."""
        return self.model.sides(state)

    # -- what is observed --------------------------------------------------------------------------

    @staticmethod
    def _now(state: State, now: Instant | None) -> Instant:
        return Instant(state.time, state.memory) if now is None else now

    def energies(self, state: State, now: Instant | None = None) -> dict[str, float]:
        """Energies by name, J: kinetic, and those of all terms that have one."""
        return self.model.energies(state, self._now(state, now))

    def powers(self, state: State, now: Instant | None = None) -> dict[str, float]:
        """Power that each other term gives to the motion, by name, W."""
        return self.model.powers(state, self._now(state, now))

    def support_work(self, first: State, second: State, middle: State) -> float:
        """Work of supports that move, J: their forces in the middle of a step times the way."""
        model, numbering = self.model, self.model.numbering
        dt = second.time - first.time
        (u0, v0), (u1, v1) = numbering.rows(first), numbering.rows(second)
        u, _ = numbering.rows(middle)
        rate, acceleration, count = (u1 - u0) / dt, (v1 - v0) / dt, numbering.count
        exerted = -model.balance(middle, u, rate, acceleration[:count])
        held = numbering.held
        work = float(np.sum(exerted[held] * (u1 - u0)[held]))
        bodies = model.bodies
        if bodies.given.any():
            work += self._work_on_bodies(middle, (u, rate, acceleration), exerted, u1 - u0)
        return work

    def _work_on_bodies(
        self,
        middle: State,
        motion: tuple[FloatArray, FloatArray, FloatArray],
        exerted: FloatArray,
        way: FloatArray,
    ) -> float:
        """Work of what prescribes coordinates, J: inertia minus all forces, times their way."""
        bodies, at = self.model.bodies, self.model.bodies.coordinates
        u, rate, acceleration = motion
        q, v, a = (x[at].ravel() for x in (u, rate, acceleration))
        now = Instant(middle.time, middle.memory)
        tissue = bodies.forces(u, self.model.numbering.padded(-exerted)).ravel()
        rows = bodies.loads.inertia(q, v, a) - bodies.loads.force(now, q, v) - tissue
        return float((rows * way[at].ravel())[bodies.given.ravel()].sum())

    def contacts(self, state: State, now: Instant | None = None) -> dict[str, Touch]:
        """Return what is touched, by the contact's name."""
        u, v = self.model.rows(state)
        at = self.model.at(self._now(state, now), u, v)
        return {part.labels[0]: part.touch(at) for part in self.model.obstacles}

    def fields(self, state: State) -> PointFields:
        """Stress, strain and pressure at the quadrature points."""
        u, v = self.model.rows(state)
        at = self.model.at(self._now(state, None), u, v)
        parts: dict[str, FloatArray] = {}
        for part in self.model.parts:
            if isinstance(part, Tissue):
                parts |= part.stresses(at)
        F = np.concatenate([F.reshape(-1, 3, 3) for F, _ in at.strains])
        return PointFields(self._points, F, state.pressure[self._points.cells], parts)

    def strain(self, state: State) -> Strain:
        """Deformation at the quadrature points."""
        u, _ = self.model.rows(state)
        return Strain(self._points, np.eye(3) + gradients_at_points(self.scene.body, u))

    @cached_property
    def _points(self) -> PointSet:
        return points_of(self.scene.body)

    @cached_property
    def _muscles(self) -> MuscleStates:
        named = zip(self.scene.labels, self.scene.terms, strict=True)
        return MuscleStates(self.scene.body, self._points, list(named))

    def muscles(self, state: State) -> dict[str, MuscleState]:
        """Activation, stretch, stress and force of each muscle that takes part."""
        if not self._muscles.any:
            return {}
        u, v = self.model.rows(state)
        body = self.scene.body
        F, rate = np.eye(3) + gradients_at_points(body, u), gradients_at_points(body, v)
        return self._muscles(F, rate, Instant(state.time, state.memory))

    # -- parameters --------------------------------------------------------------------------------

    def set_parameter(self, name: str, value: float) -> None:
        """Give a named parameter of the scene another value; UnknownName lists them.

        The model and the stepper are made anew; march on from a state.
        """
        self.scene = self.scene.with_parameters(**{name: value})
        new = self.method.solver(self.scene)
        self.model, self.stepper = new.model, new.stepper
        self.__dict__.pop("_muscles", None)

    def force_by_parameter(self, name: str, state: State) -> FloatArray:
        """Return the derivative of all nodal forces by a named parameter, (n, 3), N per its unit.

        By central differences; inertia and pressure do not count.
        """
        if name not in self.scene.parameters:
            raise UnknownName("parameter", name, self.scene.parameters)
        value = self.scene.parameters[name]
        step = PARAMETER_STEP * (abs(value) or 1.0)
        forces = []
        for number in (value + step, value - step):
            model = Model(self.scene.with_parameters(**{name: number}), self.method.mass)
            u, v = model.rows(state)
            forces.append(model.force(Instant(state.time, state.memory), u, v))
        return (forces[0] - forces[1]) / (2 * step)
