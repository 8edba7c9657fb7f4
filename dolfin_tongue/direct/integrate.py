"""Marching in time: the interface, the fixed-step Runge-Kutta 4 of the report, adaptive pairs.

A `Method` is a frozen set of numbers; it makes a `Stepper`, which carries a model through one
smooth stretch of time after another. `Direct.march` has the interface of `Dynamics.march`.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.integrate import DOP853, RK45

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.base.errors import NotConverged, OutOfRange, require_positive
from dolfin_tongue.direct.impacts import Impacts, Refused
from dolfin_tongue.direct.limits import Limit, StabilityLimits
from dolfin_tongue.direct.model import Model
from dolfin_tongue.direct.multipliers import Acceleration
from dolfin_tongue.direct.problem import Problem, problem_of
from dolfin_tongue.direct.trouble import lost
from dolfin_tongue.march.state import State
from dolfin_tongue.scene.scene import SAME_TIME, Scene

#: Relative volume change of a cell at which an explicit run is given up.
LOST_VOLUME = 0.05

#: Smallest step to which contact may cut, over dt.
SHORTEST = 1e-4


class Stepper(Protocol):
    """Carries one run of one method."""

    def begin(self, state: State) -> State:
        """Take a state as a new beginning (start, jump); returns it with its pressures."""

    def segment(self, state: State, end: float) -> Iterator[State]:
        """March from a state to the end of a smooth stretch; yields each accepted state."""


class Method(Protocol):
    """Numbers of a time-stepping method."""

    mass: str

    def stepper(self, model: Model) -> Stepper:
        """Stepper of a model."""


class Direct:
    """Motion of a scene by the report's own method.

    Parameters
    ----------
    scene : body, terms, supports; or a `Problem` with a mesh of any elements.
    method : `RungeKutta4`, `Adaptive` or `Implicit`.

    Raises
    ------
    NoDirectForce : a term that has no force here.
    """

    def __init__(self, scene: Scene | Problem, method: Method):
        problem = problem_of(scene) if isinstance(scene, Scene) else scene
        self.model = Model(problem, method.mass)
        self.method = method
        self.stepper = method.stepper(self.model)

    def rest(self, time: float = 0.0) -> State:
        """Return the reference configuration at rest."""
        zero = np.zeros_like(self.model.load)
        count = (len(self.model.problem.rigid_bodies), 3)
        slides = 0 if self.model.slides is None else len(self.model.slides.nodes)
        return State(
            time, zero, zero.copy(), np.zeros(self.model.cell_count), rigid=np.zeros(count),
            rigid_rate=np.zeros(count), sliding=np.zeros(slides),
        )  # fmt: skip

    def march(self, end: float, start: State | None = None) -> Iterator[State]:
        """March to an end time, which is met exactly; yields every accepted state.

        The first state yielded is the start itself, with the pressures that belong to it. Steps end
        at each break point of the activations.

        Parameters
        ----------
        end : s.
        start : state to start from; default: the reference configuration at rest at t = 0.

        Raises
        ------
        OutOfRange : `end` not after the start; a step beyond the stability limit.
        NotConverged : the motion is lost; all states before were yielded.
        """
        state = start or self.rest()
        if not end > state.time:
            raise OutOfRange("end", end, f"> {state.time:g} (the start)", "s")
        state = self.stepper.begin(state)
        yield state
        for stop, jump in stops(self.model.problem, state.time, end):
            for new in self.stepper.segment(state, stop):
                state = new
                yield state
            if jump:
                state = self.stepper.begin(state)


def stops(problem: Problem, start: float, end: float) -> list[tuple[float, bool]]:
    """List the ends of the smooth stretches between two times.

    Returns
    -------
    list of (time, whether something jumps there); the last one is `end`.
    """
    inner = [t for t in problem.breakpoints if start + SAME_TIME < t < end - SAME_TIME]
    return [(time, time in problem.jumps) for time in inner] + [(end, False)]


def before(time: float, end: float) -> float:
    """Time at which controls are read in a stretch: a jump at its end is not yet seen."""
    return min(time, float(np.nextafter(end, -np.inf)))


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

    def stepper(self, model: Model) -> RungeKutta4Stepper:
        """Stepper of a model."""
        return RungeKutta4Stepper(self, model)


class RungeKutta4Stepper:
    """One run of `RungeKutta4`."""

    def __init__(self, method: RungeKutta4, model: Model):
        self.method, self.model = method, model
        self.acceleration = Acceleration(model, method.tau, method.constraint_metric)
        self.limits = StabilityLimits(self.acceleration)
        self.impacts = Impacts(model)
        self.dt = method.dt
        self._short = np.inf  # step that contact allowed last, s
        self._warned = False
        self._steps = 0
        self._started = False
        #: Displacement, velocity, acceleration at the last accepted state, all rows.
        self._now = (np.zeros(0), np.zeros(0), np.zeros(0))

    def begin(self, state: State) -> State:
        """Find the pressures of a beginning and judge the step."""
        u, v = self.model.rows(state)
        self.impacts.begin(state.time, u, v)
        a, multipliers = self.acceleration(state.time, u, v)
        self._now = u, v, a
        state = self.model.state(state.time, u, v, multipliers, state.step)
        self._judge(state, state.time)
        self._started = True
        return state

    def _judge(self, state: State, time: float) -> None:
        """Refuse the step, or cut it, where it is beyond the stability limit."""
        limit, last = self._limit(state, time), self.dt
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
            raise NotConverged(reason, state.time, "Take a smaller dt, cut=True, or Implicit")

    def _limit(self, state: State, time: float) -> Limit:
        """Stability limit at the last accepted state."""
        return self.limits(time, *self._now[:2], self.model.multipliers(state))

    def segment(self, state: State, end: float) -> Iterator[State]:
        """March to the end of a smooth stretch with equal steps of at most dt."""
        while state.time < end:
            remaining = end - state.time
            dt = min(self.dt, self._short)
            dt = remaining / max(1, int(np.ceil(remaining / dt - 1e-6)))
            time = end if dt >= remaining * (1 - 1e-12) else state.time + dt
            try:
                state = self._step(state, dt, time, end)
            except Refused as refused:
                self._short = self._cut(state, dt, str(refused))
                continue
            self._short = 1.5 * dt if dt < self.dt else np.inf
            yield state
            self._steps += 1
            if self._steps % self.method.watch == 0:
                self._judge(state, before(state.time, end))

    def _cut(self, state: State, dt: float, cause: str) -> float:
        """Half of a step that contact refused; NotConverged if it may not be cut any more."""
        if not self.method.cut:
            reason = f"dt = {dt:.3g} s is too long for contact: {cause}"
            raise NotConverged(reason, state.time, "Take a smaller dt, cut=True, or Implicit")
        if dt < SHORTEST * self.method.dt:
            raise lost(self.model, state, dt, cause)
        if not self._warned:
            text = f"t = {state.time:.6g} s: contact cuts steps of {dt:.3g} s: {cause}"
            warnings.warn(text, RuntimeWarning, stacklevel=2)
            self._warned = True
        return dt / 2

    def _step(self, state: State, dt: float, time: float, end: float) -> State:
        """One step; the pressure is that of the new state."""
        (u, v, a1), t = self._now, state.time
        self.model.begin_step(t, u)
        with np.errstate(all="ignore"):
            u2, v2 = self._held(t + dt / 2, u + dt / 2 * v, v + dt / 2 * a1)
            a2, _ = self.acceleration(before(t + dt / 2, end), u2, v2)
            u3, v3 = self._held(t + dt / 2, u + dt / 2 * v2, v + dt / 2 * a2)
            a3, _ = self.acceleration(before(t + dt / 2, end), u3, v3)
            u4, v4 = self._held(t + dt, u + dt * v3, v + dt * a3)
            a4, _ = self.acceleration(before(t + dt, end), u4, v4)
            u_new = u + dt / 6 * (v + 2 * v2 + 2 * v3 + v4)
            v_new = v + dt / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
            self.model.hold(time, u_new, v_new)
            change, _ = self.model.constraint(u_new)
            largest = np.abs(change / self.model.sizes).max()
            if not (np.isfinite(v_new).all() and largest <= LOST_VOLUME):
                if self.impacts.near(t, u) or self.impacts.near(time, u + dt * v):
                    raise Refused(f"the motion would be lost; {self.impacts.names}")
                raise lost(self.model, state, dt, self._blame(state, dt, end))
            if self.model.obstacles:
                stages = ((t, u, v), (t + dt / 2, u2, v2), (t + dt / 2, u3, v3), (t + dt, u4, v4))
                self.impacts.explicit(
                    dt, (time, u_new, v_new), stages, (1 / 6, 1 / 3, 1 / 3, 1 / 6)
                )
            a, multipliers = self.acceleration(before(time, end), u_new, v_new)
        self._now = u_new, v_new, a
        return self.model.state(time, u_new, v_new, multipliers, dt)

    def _held(self, time: float, u: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray]:
        self.model.hold(time, u, v)
        return u, v

    def _blame(self, state: State, dt: float, end: float) -> str:
        """Whether the step was beyond the limit at the last accepted state."""
        limit = self._limit(state, before(state.time, end))
        if limit.step < dt:
            text = f"the stability limit {limit.step:.3g} s, set by {limit.cause}"
            return f"dt = {dt:.3g} s is beyond {text}"
        return f"not the step (its limit is {limit.step:.3g} s, set by {limit.cause})"


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

    def stepper(self, model: Model) -> AdaptiveStepper:
        """Stepper of a model."""
        return AdaptiveStepper(self, model)


class AdaptiveStepper:
    """One run of `Adaptive`. Viscosity and stiffness throttle its step, silently but safely."""

    def __init__(self, method: Adaptive, model: Model):
        self.method, self.model = method, model
        self.acceleration = Acceleration(model, method.tau, method.constraint_metric)
        self.impacts = Impacts(model)
        self._first: float | None = None

    def begin(self, state: State) -> State:
        """Find the pressures of a beginning."""
        u, v = self.model.rows(state)
        self.impacts.begin(state.time, u, v)
        _, multipliers = self.acceleration(state.time, u, v)
        self._first = None
        return self.model.state(state.time, u, v, multipliers, state.step)

    def segment(self, state: State, end: float) -> Iterator[State]:
        """March to the end of a smooth stretch."""
        solver = self._solver(state, end)
        while solver.status == "running":
            with np.errstate(all="ignore"):
                if self.model.obstacles:
                    self.model.begin_step(solver.t, self._spread(solver.t, solver.y)[0])
                message = solver.step()
            finite = np.isfinite(solver.y).all()
            if solver.status == "failed" or not finite:
                limits = StabilityLimits(self.acceleration)
                arrays = (*self.model.rows(state), self.model.multipliers(state))
                limit = limits(before(state.time, end), *arrays)
                raise lost(
                    self.model, state, solver.step_size or 0.0,
                    f"{message or 'not finite'}; explicit steps are limited to {limit.step:.3g} s "
                    f"by {limit.cause}",
                )  # fmt: skip
            new = self._state(solver, end)
            if cause := self.impacts.passed(new.time, new.displacement):
                text = "Take a smaller tolerance or `largest`, or Implicit"
                raise NotConverged(cause, state.time, text)
            state = new
            yield state
        self._first = solver.step_size

    def _solver(self, state: State, end: float) -> RK45 | DOP853:
        model, method = self.model, self.method
        y = np.concatenate([model.unknowns(rows) for rows in model.rows(state)])
        atol = np.full(len(y), method.tolerance)
        atol[len(y) // 2 :] /= method.time_scale
        kind = {"RK45": RK45, "DOP853": DOP853}[method.pair]
        first = self._first or (method.largest if np.isfinite(method.largest) else None)
        first = None if first is None else min(first, end - state.time)
        return kind(
            lambda t, y: self._rates(before(t, end), y), state.time, y, end,
            rtol=method.rtol, atol=atol, first_step=first, max_step=method.largest,
        )  # fmt: skip

    def _spread(self, time: float, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Displacement and velocity of all nodes from the unknowns of the free ones."""
        displacement, velocity = np.zeros((2, *self.model.shape))
        for values, rows in zip(np.split(y, 2), (displacement, velocity), strict=True):
            self.model.add_unknowns(values, rows)
        self.model.hold(time, displacement, velocity)
        return displacement, velocity

    def _rates(self, time: float, y: FloatArray) -> FloatArray:
        displacement, velocity = self._spread(time, y)
        acceleration, _ = self.acceleration(time, displacement, velocity)
        return np.concatenate([self.model.unknowns(velocity), self.model.unknowns(acceleration)])

    def _state(self, solver: RK45 | DOP853, end: float) -> State:
        displacement, velocity = self._spread(solver.t, solver.y)
        _, multipliers = self.acceleration(before(solver.t, end), displacement, velocity)
        return self.model.state(solver.t, displacement, velocity, multipliers, solver.step_size)
