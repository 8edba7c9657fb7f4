"""The fixed-step Runge-Kutta 4 of the report, with its stability limit watched."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.base.errors import NotConverged, OutOfRange, require_flags, require_positive
from dolfin_tongue.body.state import State
from dolfin_tongue.control import Instant
from dolfin_tongue.direct.impacts import Impacts, Refused
from dolfin_tongue.direct.limits import Limit, StabilityLimits
from dolfin_tongue.direct.model import Model
from dolfin_tongue.direct.multipliers import Acceleration
from dolfin_tongue.direct.solver import DirectSolver
from dolfin_tongue.march.diagnosis import diagnosis
from dolfin_tongue.march.solver import Attempt, Stepper
from dolfin_tongue.march.steps import StepControl, before
from dolfin_tongue.scene.scene import Scene

#: Relative volume change of a cell at which an explicit run is given up.
LOST_VOLUME = 0.05

#: Smallest step to which contact may cut, over dt.
SHORTEST = 1e-4


@dataclass(frozen=True)
class RungeKutta4:
    """Classical Runge-Kutta with fixed step, as in the report.

    Parameters
    ----------
    dt : step, s.
    tau : time constant of the volume constraints (55), s.
    constraint_metric : ``"dalembert"``, or ``"report"`` as printed; see `multipliers`.
    mass : ``"consistent"`` or ``"lumped"``.
    cut : cut a step beyond the stability limit, with a warning, instead of refusing it; and one in
        which a point passes an obstacle, or contact makes energy.
    watch : steps between two estimates of the stability limit.
    """

    dt: float
    tau: float = 1e-3
    constraint_metric: str = "dalembert"
    mass: str = "consistent"
    cut: bool = False
    watch: int = 50

    def __post_init__(self) -> None:
        require_positive(self, "s", dt=self.dt, tau=self.tau)
        require_positive(self, "", watch=self.watch)
        require_flags(self, cut=self.cut)

    @property
    def control(self) -> StepControl:
        """Sizes of steps: fixed, halved where contact asks for it and the method may cut."""
        smallest = SHORTEST * self.dt if self.cut else 0.99 * self.dt
        return StepControl(self.dt, None, smallest, self.dt, cut=0.5, growth=1.5)

    def solver(self, scene: Scene) -> DirectSolver:
        """Return the solver of a scene."""
        model = Model(scene, self.mass)
        return DirectSolver(self, model, RungeKutta4Stepper(self, model), self.control)


class RungeKutta4Stepper(Stepper):
    """One run of `RungeKutta4`."""

    def __init__(self, method: RungeKutta4, model: Model):
        self.method, self.model = method, model
        self.acceleration = Acceleration(model, method.tau, method.constraint_metric)
        self.limits = StabilityLimits(self.acceleration)
        self.impacts = Impacts(model)
        self.dt = method.dt
        self.steps = 0
        self._warned = self._started = False
        #: Displacement, velocity, acceleration at the last accepted state and one tried, all rows.
        nothing: FloatArray = np.zeros(0)
        self._now = self._tried = (nothing, nothing, nothing)
        #: State and end of its stretch, where the limit is to be looked at again.
        self._due: tuple[State, float] | None = None
        self._last: tuple[State, float] | None = None

    def counts(self) -> dict[str, int]:
        """Return how often what was done."""
        return {"steps": self.steps, "evaluations": 4 * self.steps}

    def begin(self, state: State) -> State:
        """Find the pressures of a beginning and judge the step."""
        now = Instant(state.time, state.memory)
        u, v = self.model.rows(state)
        self.impacts.begin(now, u, v)
        a, multipliers = self.acceleration(now, u, v)
        self._now = u, v, a
        state = self.model.numbering.state(now, u, v, multipliers, step=state.step)
        self._judge(state, now)
        self._started = True
        return state

    def bound(self) -> float:
        """Step that the stability limit allows, s; it is looked at every `watch` steps."""
        if self._due is not None:
            state, end = self._due
            self._due = None
            self._judge(state, Instant(before(state.time, end), state.memory))
        return self.dt

    def _judge(self, state: State, now: Instant) -> None:
        """Refuse the step, or cut it, where it is beyond the stability limit."""
        limit, last = self._limit(state, now), self.dt
        if self.model.obstacles:  # their stiffness comes and goes
            self.dt = self.method.dt
        if limit.step >= self.dt:
            return
        text = f"{limit.step:.3g} s, set by {limit.cause}"
        if self.method.cut:
            self.dt = 0.9 * limit.step
            if self.dt >= (0.5 * last if self.model.obstacles else last):
                return
            warnings.warn(
                f"t = {state.time:.6g} s: step cut from {last:.3g} s to "
                f"{self.dt:.3g} s; the stability limit is {text}",
                RuntimeWarning, stacklevel=2,
            )  # fmt: skip
        elif not self._started:
            allowed = f"at most the stability limit, which {limit.cause} sets to {limit.step:.3g}"
            raise OutOfRange("dt", self.dt, allowed, "s")
        else:
            reason = f"dt = {self.dt:g} s is beyond the stability limit of {text}"
            raise NotConverged(reason, state.time, "Take a smaller dt, cut=True, or TrBdf2")

    def _limit(self, state: State, now: Instant) -> Limit:
        """Stability limit at the last accepted state."""
        return self.limits(now, *self._now[:2], self.model.numbering.multipliers(state))

    def attempt(self, state: State, dt: float, end: float) -> Attempt:
        """Take one step; the pressure is that of the new state."""
        time = end if dt >= (end - state.time) * (1 - 1e-12) else state.time + dt
        try:
            new = self._step(state, dt, time, end)
        except Refused as refused:
            return Attempt(None, cause=self._cause(state, dt, str(refused)))
        self._last = new, end
        return Attempt(new)

    def _cause(self, state: State, dt: float, cause: str) -> str:
        """Say why contact refuses a step; NotConverged where it may not be cut."""
        if not self.method.cut:
            reason = f"dt = {dt:.3g} s is too long for contact: {cause}"
            raise NotConverged(reason, state.time, "Take a smaller dt, cut=True, or TrBdf2")
        if not self._warned:
            text = f"t = {state.time:.6g} s: contact cuts steps of {dt:.3g} s: {cause}"
            warnings.warn(text, RuntimeWarning, stacklevel=2)
            self._warned = True
        return cause

    def _step(self, state: State, dt: float, time: float, end: float) -> State:
        (u, v, a1), t, model = self._now, state.time, self.model

        def read(place: float) -> Instant:
            return Instant(before(place, end), state.memory)

        with np.errstate(all="ignore"):
            u2, v2 = self._held(t + dt / 2, u + dt / 2 * v, v + dt / 2 * a1)
            a2, _ = self.acceleration(read(t + dt / 2), u2, v2)
            u3, v3 = self._held(t + dt / 2, u + dt / 2 * v2, v + dt / 2 * a2)
            a3, _ = self.acceleration(read(t + dt / 2), u3, v3)
            u4, v4 = self._held(t + dt, u + dt * v3, v + dt * a3)
            a4, _ = self.acceleration(read(t + dt), u4, v4)
            u_new = u + dt / 6 * (v + 2 * v2 + 2 * v3 + v4)
            v_new = v + dt / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
            model.hold(time, u_new, v_new)
            self._check(state, dt, end, (u_new, v_new))
            if model.obstacles:
                places = (t, t + dt / 2, t + dt / 2, t + dt)
                motions = ((u, v), (u2, v2), (u3, v3), (u4, v4))
                pairs = zip(places, motions, strict=True)
                stages = [(Instant(x, state.memory), *motion) for x, motion in pairs]
                new = (Instant(time, state.memory), u_new, v_new)
                self.impacts.explicit(dt, new, stages, (1 / 6, 1 / 3, 1 / 3, 1 / 6))
            a, multipliers = self.acceleration(read(time), u_new, v_new)
        self._tried = u_new, v_new, a
        now = Instant(time, state.memory)
        return model.numbering.state(now, u_new, v_new, multipliers, step=dt)

    def _check(
        self, state: State, dt: float, end: float, new: tuple[FloatArray, FloatArray]
    ) -> None:
        """Raise where the motion is lost: Refused near an obstacle, else NotConverged."""
        (u_new, v_new), (u, v, _) = new, self._now
        change, _ = self.model.constraints.evaluate(u_new)
        largest = np.abs(change / self.model.constraints.sizes).max()
        if np.isfinite(v_new).all() and largest <= LOST_VOLUME:
            return
        now, then = Instant(state.time, state.memory), Instant(state.time + dt, state.memory)
        if self.impacts.near(now, u) or self.impacts.near(then, u + dt * v):
            raise Refused(f"the motion would be lost; {self.impacts.names}")
        found = diagnosis(self.model.body, state.displacement)
        reason = f"the motion is lost in a step of {dt:.3g} s: {self._blame(state, dt, end)}"
        raise NotConverged(reason, state.time, found)

    def _held(self, time: float, u: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray]:
        self.model.hold(time, u, v)
        return u, v

    def _blame(self, state: State, dt: float, end: float) -> str:
        """Whether the step was beyond the limit at the last accepted state."""
        limit = self._limit(state, Instant(before(state.time, end), state.memory))
        if limit.step < dt:
            text = f"the stability limit {limit.step:.3g} s, set by {limit.cause}"
            return f"dt = {dt:.3g} s is beyond {text}"
        return f"not the step (its limit is {limit.step:.3g} s, set by {limit.cause})"

    def accept(self) -> None:
        """Keep the step."""
        self.impacts.accept()
        self._now = self._tried
        self.steps += 1
        self._due = self._last if self.steps % self.method.watch == 0 else None

    def reject(self) -> None:
        """Drop the step."""
        self.impacts.forget()
