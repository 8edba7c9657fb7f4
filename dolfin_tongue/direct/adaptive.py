"""Embedded Runge-Kutta pairs with error control, by SciPy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import DOP853, RK45

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.base.errors import NotConverged, OutOfRange, require_positive
from dolfin_tongue.body.state import State
from dolfin_tongue.control import Instant
from dolfin_tongue.direct.impacts import Impacts
from dolfin_tongue.direct.limits import StabilityLimits
from dolfin_tongue.direct.model import Model
from dolfin_tongue.direct.multipliers import Acceleration
from dolfin_tongue.direct.solver import DirectSolver
from dolfin_tongue.march.diagnosis import diagnosis
from dolfin_tongue.march.solver import Attempt, Stepper
from dolfin_tongue.march.steps import StepControl, before
from dolfin_tongue.scene.scene import Scene


@dataclass(frozen=True)
class Adaptive:
    """Embedded Runge-Kutta pair with error control.

    Parameters
    ----------
    tolerance : error of a nodal displacement per step, m, or of the angle of a rigid body, rad;
        that of a velocity is `tolerance` over `time_scale`.
    time_scale : s.
    rtol : relative tolerance.
    pair : ``"DOP853"`` (order 8) or ``"RK45"`` (order 5, Dormand and Prince).
    largest : largest step, which is also the first to be tried, s.
    tau, constraint_metric, mass : as in `RungeKutta4`.
    """

    tolerance: float = 1e-8
    time_scale: float = 1e-2
    rtol: float = 1e-8
    pair: str = "DOP853"
    largest: float = np.inf
    tau: float = 1e-3
    constraint_metric: str = "dalembert"
    mass: str = "consistent"

    def __post_init__(self) -> None:
        require_positive(self, "m", tolerance=self.tolerance)
        require_positive(self, "s", time_scale=self.time_scale, tau=self.tau)
        require_positive(self, "", rtol=self.rtol)
        if not self.largest > 0:
            raise OutOfRange("Adaptive.largest", self.largest, "> 0", "s")
        if self.pair not in ("DOP853", "RK45"):
            raise OutOfRange("Adaptive.pair", self.pair, '"DOP853" or "RK45"')

    @property
    def control(self) -> StepControl:
        """Sizes of steps: the pair chooses them itself."""
        return StepControl(self.largest)

    def solver(self, scene: Scene) -> DirectSolver:
        """Return the solver of a scene."""
        model = Model(scene, self.mass)
        return DirectSolver(self, model, AdaptiveStepper(self, model), self.control)


class AdaptiveStepper(Stepper):
    """One run of `Adaptive`. Viscosity and stiffness throttle its step, silently but safely."""

    def __init__(self, method: Adaptive, model: Model):
        self.method, self.model = method, model
        self.acceleration = Acceleration(model, method.tau, method.constraint_metric)
        self.impacts = Impacts(model)
        self.steps = self.evaluations = 0
        self._first: float | None = None
        self._solver: RK45 | DOP853
        self._memory = Instant(0.0).memory

    def counts(self) -> dict[str, int]:
        """Return how often what was done."""
        return {"steps": self.steps, "evaluations": self.evaluations}

    def begin(self, state: State) -> State:
        """Find the pressures of a beginning."""
        now = Instant(state.time, state.memory)
        u, v = self.model.rows(state)
        self.impacts.begin(now, u, v)
        _, multipliers = self.acceleration(now, u, v)
        self._first = None
        return self.model.numbering.state(now, u, v, multipliers, step=state.step)

    def enter(self, state: State, end: float) -> None:
        """Begin a smooth stretch."""
        model, method = self.model, self.method
        self._memory = state.memory
        y = np.concatenate([model.numbering.unknowns(rows) for rows in model.rows(state)])
        atol = np.full(len(y), method.tolerance)
        atol[len(y) // 2 :] /= method.time_scale
        kind = {"RK45": RK45, "DOP853": DOP853}[method.pair]
        first = self._first or (method.largest if np.isfinite(method.largest) else None)
        first = None if first is None else min(first, end - state.time)
        with np.errstate(all="ignore"):
            self._solver = kind(
                lambda t, y: self._rates(before(t, end), y), state.time, y, end,
                rtol=method.rtol, atol=atol, first_step=first, max_step=method.largest,
            )  # fmt: skip

    def attempt(self, state: State, dt: float, end: float) -> Attempt:
        """Take one step of the pair, of its own size."""
        solver, self._memory = self._solver, state.memory
        with np.errstate(all="ignore"):
            message = solver.step()
        if solver.status == "failed" or not np.isfinite(solver.y).all():
            limits = StabilityLimits(self.acceleration)
            arrays = (*self.model.rows(state), self.model.numbering.multipliers(state))
            limit = limits(Instant(before(state.time, end), state.memory), *arrays)
            reason = (
                f"the motion is lost in a step of {solver.step_size or 0.0:.3g} s: "
                f"{message or 'not finite'}; explicit steps are limited to {limit.step:.3g} s "
                f"by {limit.cause}"
            )
            found = diagnosis(self.model.body, state.displacement)
            raise NotConverged(reason, state.time, found)
        new = self._state(end)
        now = Instant(new.time, state.memory)
        if cause := self.impacts.passed(now, new.displacement):
            text = "Take a smaller tolerance or `largest`, or TrBdf2"
            raise NotConverged(cause, state.time, text)
        return Attempt(new)

    def accept(self) -> None:
        """Keep the step."""
        self._first = self._solver.step_size
        self.steps += 1

    def _spread(self, time: float, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Displacement and velocity of all nodes from the unknowns of the free ones."""
        displacement, velocity = np.zeros((2, *self.model.numbering.shape))
        for values, rows in zip(np.split(y, 2), (displacement, velocity), strict=True):
            self.model.numbering.add_unknowns(values, rows)
        self.model.hold(time, displacement, velocity)
        return displacement, velocity

    def _rates(self, time: float, y: FloatArray) -> FloatArray:
        self.evaluations += 1
        displacement, velocity = self._spread(time, y)
        acceleration, _ = self.acceleration(Instant(time, self._memory), displacement, velocity)
        unknowns = self.model.numbering.unknowns
        return np.concatenate([unknowns(velocity), unknowns(acceleration)])

    def _state(self, end: float) -> State:
        solver = self._solver
        displacement, velocity = self._spread(solver.t, solver.y)
        read = Instant(before(solver.t, end), self._memory)
        _, multipliers = self.acceleration(read, displacement, velocity)
        now = Instant(solver.t, self._memory)
        return self.model.numbering.state(
            now, displacement, velocity, multipliers, step=solver.step_size
        )
