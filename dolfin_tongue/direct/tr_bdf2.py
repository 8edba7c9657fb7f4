"""TR-BDF2 with the volume constraint: steps that neither viscosity nor stiffness limits.

The method (Bank et al. 1985; as a diagonally implicit Runge-Kutta method, Hosea and Shampine 1996)
takes two stages with the same implicit coefficient d = 1 - 1/sqrt 2: a trapezoidal one to
t + 2 d h, then BDF2 to t + h. It is of order 2, L-stable and stiffly accurate. The equations are
those of index 2: U' = V, M V' = F + G^T lambda, G(U) V = 0. A stage with known parts U_k, V_k of
U = U_k + d h V and V = V_k + d h V' asks for V and lambda with

    M (V - V_k)/(d h) - F(t, U, V) - G(U)^T lambda = 0,      G(U) V = 0.

Newton's matrix is [A -G^T; G 0], A = M/(d h) + C + d h (K - sum lambda_m H_m), with the tangents K
and C of all terms and the Hessians H (101); the derivative of G V by U, of the size of the strain
in one step, is left out. Solving G V = 0 keeps lambda of order 2, which the constraint on U itself
would not. What the volumes drift in a step, O(h^3), is then taken out of U with the same matrix
(a correction of least energy), so that every accepted state keeps its volumes.

Sliding nodes are constraints like the volumes, in all of this. A rigid body (`bodies`) adds its
unknown coordinates q: U and V of its points follow from q and q', and the stage asks for the
balance of the body with the inertia of its points as everywhere, M (V - V_k)/(d h) with V = T q' at
the end of the stage. So all momentum that leaves a node arrives at another one, and a free body
keeps its linear momentum to round-off, turning or not. Newton's matrix gets a border with the T of
the points and its turning (`border`). The drift of the constraints is taken out of the nodes alone.

Contact: an impact that h does not resolve would be thrown back with energy of its own, as the first
stage takes over the acceleration at t. A step in which the impulses of contact make energy, or
after which a point is behind an obstacle (`impacts`), is taken again by Euler's implicit method,
whose only stage stands at the end of the step: there a convex barrier gives back no more than it
took. Only if that fails too is the step cut.

Two ways to use it:
- Newton to a tolerance, with the factors kept over iterations and steps while they serve;
- linearly implicit (`corrections = 1`): one tangent per step, at the predicted inner stage, one
  linear solve per stage, no iteration. Order 2 is kept, since predictions are of order 2.

Contact. TR-BDF2 states an impact wrongly: a free point that meets a wall at speed v leaves it at up
to 1.41 v, since the trapezoidal stage reflects v and BDF2 extrapolates the jump. So each step is
judged by the energy that contact makes in it (`impacts`). Where that is more than an error, or a
point passes an obstacle, or Newton's method fails near one, the step is taken again by Euler's
implicit method, whose contact force is that of the end of the step: for a convex barrier
psi_1 - psi_0 <= psi'(h_1) (h_1 - h_0), so that impact is inelastic and no energy is made. What then
still fails is cut. Near obstacles stages are always iterated. Blocks of 27 bricks dropped on a
plane, flat and on a corner, at 0.1 and 1 m/s with dt = 5 and 1 ms, 8 runs of 60 ms together, and a
plate that moves by 2 mm from 1 mm away in 50 ms (error of the displacement, dt = 1.25 ms):

                                          steps   solves   factors   error
    as it is                                300     2406       333   0.4 %
    Euler's in every step with contact      301     2908       949   3.4 %
    cut to change gaps by at most 1/2      1140     9999      2163
    cut to change gaps by at most 1/5      2914    17964      5702

With cuts upon failure alone one such drop gained 44 % of its kinetic energy. No drop gained any as
it is, nor did any of 48 (0.1 to 2 m/s, with and without viscosity, both laws). Order 2 is kept
where contact is smooth; an impact is of order 1 and loses what dt does not resolve.

Both measure 1.99 to 2.01 in displacement, velocity and pressure (`tests/direct/test_order.py`). The
report's tongue (42 bricks, two muscles, 50 Pa s; `pytest -m slow -s tests/direct/test_tongue.py`,
one core) at dt = 5 and 10 ms errs by 0.09 and 0.36 % of the largest displacement; an iteration
costs 0.15 ms, new factors 1 ms. Runge-Kutta 4 is stable there up to 0.028 ms.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from math import sqrt

import numpy as np

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.base.errors import OutOfRange, require_positive
from dolfin_tongue.direct.border import Border, condensed, condensed_gradient
from dolfin_tongue.direct.impacts import Impacts, Instant
from dolfin_tongue.direct.integrate import before
from dolfin_tongue.direct.model import Model
from dolfin_tongue.direct.multipliers import Acceleration
from dolfin_tongue.direct.saddle import Saddle, Solver
from dolfin_tongue.direct.trouble import lost
from dolfin_tongue.march.state import State

#: Implicit coefficient d, place 2 d of the inner stage, weight w of the first two stages.
D = 1.0 - 1.0 / sqrt(2.0)
INNER = 2.0 * D
W = sqrt(2.0) / 4.0
#: Weights minus those of the embedded third-order method (Hosea and Shampine 1996).
ERROR_WEIGHTS = (W - (1.0 - W) / 3.0, W - (3.0 * W + 1.0) / 3.0, D - D / 3.0)

#: Relative change of the step up to which the factors are kept.
SAME_STEP = 0.1


@dataclass(frozen=True)
class Implicit:
    """TR-BDF2; see the module.

    Parameters
    ----------
    dt : step, s; with `tolerance` the first one.
    tolerance : largest error of a nodal displacement per step, m; None keeps dt fixed.
    corrections : None iterates to `newton`; 1 is the linearly implicit method, n takes n solves.
    newton : largest nodal displacement by which the last Newton update of a stage may move, m (or
        angle, rad); the error it leaves is smaller by the contraction. Ten times more is noise in
        velocities.
    volume : largest relative volume change of a cell at the end of a step, and distance of a
        sliding node from its surface over the mean size of the cells.
    patience : the factors are renewed when more than this many further iterations are expected
        from the contraction so far; 0 renews them in every iteration (full Newton).
    iterations : at most, per stage, with fresh factors.
    smallest, largest : limits of an adapted step, s; default dt / 1000 and 10 dt.
    mass : ``"consistent"`` or ``"lumped"``.
    """

    dt: float = 5e-3
    tolerance: float | None = None
    corrections: int | None = None
    newton: float = 1e-7
    volume: float = 1e-10
    patience: float = 4.0
    iterations: int = 12
    smallest: float | None = None
    largest: float | None = None
    mass: str = "consistent"

    def __post_init__(self) -> None:
        require_positive(self, "s", dt=self.dt)
        require_positive(self, "m", newton=self.newton)
        require_positive(self, "", volume=self.volume, iterations=self.iterations)
        if self.tolerance is not None:
            require_positive(self, "m", tolerance=self.tolerance)
        if not self.patience >= 0:
            raise OutOfRange("Implicit.patience", self.patience, ">= 0")
        if self.corrections is not None and not self.corrections >= 1:
            raise OutOfRange("Implicit.corrections", self.corrections, ">= 1, or None")

    @property
    def step_limits(self) -> tuple[float, float]:
        """Smallest and largest step, s."""
        return (self.smallest or self.dt / 1000, self.largest or 10 * self.dt)

    def stepper(self, model: Model) -> ImplicitStepper:
        """Stepper of a model."""
        return ImplicitStepper(self, model)


@dataclass
class Motion:
    """A point of a trajectory: what a stage takes and gives.

    Parameters
    ----------
    time : s.
    u, v, a : displacement, velocity, acceleration of all rows, shape (N, 3).
    pressure : multipliers of all constraints, shape (c,), Pa.
    contact : nodal forces of each obstacle, as they act in M a, shape (N, 3), N.
    """

    time: float
    u: FloatArray
    v: FloatArray
    a: FloatArray
    pressure: FloatArray
    contact: list[FloatArray] = field(default_factory=list)

    @property
    def instant(self) -> Instant:
        """What contact is judged by."""
        return Instant(self.time, self.u, self.v, self.contact)


class Failed(Exception):
    """A stage did not converge."""


class ImplicitStepper:
    """One run of `Implicit`; counts its work in `factorisations` and `evaluations`."""

    def __init__(self, method: Implicit, model: Model):
        self.method, self.model = method, model
        self.saddle = Saddle(model)
        self.initial = Acceleration(model, None)
        self.impacts = Impacts(model)
        self.factorisations = self.evaluations = self.iterations = self.euler_steps = 0
        self._solver: Solver
        self._nodal_solver: Solver  # with rigid bodies standing still
        self._stale = True  # whether the next correction needs new factors
        self._solver_step = 0.0
        zero = np.zeros(model.shape)
        self._now = Motion(0.0, zero, zero, zero, np.zeros(model.constraint_count))
        self._points = zero if model.bodies is None else zero[: model.bodies.centres.stop]
        self._inner: Motion | None = None
        self._close = False  # whether the step starts or is going to end near an obstacle

    # -- marching ------------------------------------------------------------------------------

    def begin(self, state: State) -> State:
        """Find acceleration and pressures of a beginning."""
        u, v = self.model.rows(state)
        a, pressure = self.initial(state.time, u, v)
        contact = self.impacts.instant(state.time, u, v).forces
        self._now = Motion(state.time, u, v, a, pressure, contact)
        self._inner, self._stale = None, True
        self.impacts.begin(state.time, u, v)
        return self.model.state(state.time, u, v, pressure, state.step)

    def segment(self, state: State, end: float) -> Iterator[State]:
        """March to the end of a smooth stretch."""
        proposal = min(self.method.dt, self.method.step_limits[1])
        while state.time < end:
            remaining = end - state.time
            dt = remaining / max(1, int(np.ceil(remaining / proposal - 1e-6)))
            state, proposal = self._advance(state, dt, end)
            yield state

    def _advance(self, state: State, dt: float, end: float) -> tuple[State, float]:
        """Take one step of at most dt; cut it where Newton fails or the error is too large."""
        smallest, _ = self.method.step_limits
        iterations = self.iterations
        self.model.begin_step(state.time, self._now.u)
        while True:
            remaining = end - state.time
            time = end if dt >= remaining * (1 - 1e-12) else state.time + dt
            try:
                with np.errstate(all="ignore"):
                    inner, new, error = self._any_step(dt, time, end)
            except Failed as failure:
                cause, factor = str(failure), 0.25
            else:
                factor = self._factor(error)
                if factor >= 1.0 or dt <= smallest:
                    break
                cause = f"error {error:.2g} m"
            self._stale = True
            dt *= factor
            if dt < smallest:
                raise lost(self.model, state, dt, cause)
        self.impacts.accept()
        self._now, self._inner = new, inner
        count = self.iterations - iterations
        state = self.model.state(new.time, new.u, new.v, new.pressure, dt, count)
        return state, self._next(dt, factor)

    def _factor(self, error: float) -> float:
        """Factor by which the error allows the step to change."""
        if self.method.tolerance is None:
            return 1.0
        factor = 0.9 * (self.method.tolerance / max(error, 1e-300)) ** (1 / 3)
        if error <= self.method.tolerance:
            factor = max(factor, 1.0)
        return float(np.clip(factor, 0.2, 2.0))

    def _next(self, taken: float, factor: float) -> float:
        """Next step: the nominal one, or what the error allows."""
        if self.method.tolerance is None:
            return min(self.method.dt, 4 * taken)
        # A small change is not worth new factors.
        return float(np.clip(taken * (factor if factor > 1.3 else 1.0), *self.method.step_limits))

    # -- one step ------------------------------------------------------------------------------

    def _any_step(self, h: float, time: float, end: float) -> tuple[Motion | None, Motion, float]:
        """Take a step of TR-BDF2, or of Euler's method where contact does not allow that."""
        if not self.model.obstacles:
            return self._step(h, time, end)
        now, impacts = self._now, self.impacts
        self._close = impacts.near(now.time, now.u) or impacts.near(time, now.u + h * now.v)
        try:
            inner, new, error = self._step(h, time, end)
            first, second, third = (part.instant for part in (now, inner, new))
            if not impacts.judge(h, first, third, ((W, first), (W, second), (D, third))):
                return inner, new, error
        except Failed:
            if not self._close:
                raise
        self._stale = self._close = True
        still = np.zeros_like(now.a)
        new = self._stage(time, h / D, end, now.u, now.v, still, now.pressure)
        self._project(new)
        last = new.instant
        if cause := impacts.judge(h, now.instant, last, ((1.0, last),), dissipates=True):
            raise Failed(cause)
        self.euler_steps += 1
        return None, new, 0.5 * h * float(np.abs(new.v - now.v).max())

    def _step(self, h: float, time: float, end: float) -> tuple[Motion, Motion, float]:
        """Both stages and the projection; returns inner stage, end and error of a displacement."""
        now = self._now
        if self.method.corrections is not None or abs(self._solver_step / h - 1.0) > SAME_STEP:
            self._stale = True
        slope, pressure_slope = self._slopes()
        t = now.time + INNER * h
        guess = now.a + INNER * h * slope
        u, v = now.u + D * h * now.v, now.v + D * h * now.a
        inner = self._stage(t, h, end, u, v, guess, now.pressure + INNER * h * pressure_slope)
        guess = now.a + (inner.a - now.a) / INNER
        pressure = now.pressure + (inner.pressure - now.pressure) / INNER
        u = now.u + W * h * (now.v + inner.v)
        v = now.v + W * h * (now.a + inner.a)
        new = self._stage(time, h, end, u, v, guess, pressure)
        first, second, third = ERROR_WEIGHTS
        nodal = (first * now.v + second * inner.v + third * new.v)[: len(self._points)]
        error = h * np.abs(nodal).max()
        self._project(new)
        return inner, new, float(error)

    def _slopes(self) -> tuple[FloatArray | float, FloatArray | float]:
        """Slopes of acceleration and pressure, from the inner stage of the step before."""
        now, inner = self._now, self._inner
        if inner is None:
            return 0.0, 0.0
        span = now.time - inner.time
        return (now.a - inner.a) / span, (now.pressure - inner.pressure) / span

    def _stage(
        self,
        time: float,
        h: float,
        end: float,
        u_known: FloatArray,
        v_known: FloatArray,
        guess: FloatArray,
        pressure: FloatArray,
    ) -> Motion:
        """Solve one stage, starting from a guess of acceleration and pressure."""
        step = D * h
        point = Motion(time, u_known, v_known + step * guess, guess, pressure.copy())
        self._place(point, u_known, v_known, step)
        self._solve_stage(point, u_known, v_known, step, h, before(time, end))
        point.contact = self.impacts.instant(before(time, end), point.u, point.v).forces
        return point

    def _solve_stage(
        self,
        point: Motion,
        u_known: FloatArray,
        v_known: FloatArray,
        step: float,
        h: float,
        time: float,
    ) -> None:
        """Newton's method on a stage, or the given number of corrections."""
        method = self.method
        corrections = None if self._close else method.corrections
        sizes: list[float] = []
        renewals = 0
        for _ in range(corrections or 3 * method.iterations):
            if self._stale:
                self._renew(time, point, step, h)
                sizes, renewals = [], renewals + 1
            sizes.append(self._correct(time, point, u_known, v_known, step))
            if not np.isfinite(sizes[-1]):
                raise Failed("a stage is not finite")
            if corrections is not None:
                continue
            if sizes[-1] <= method.newton:
                return
            if method.patience == 0 or ((renewals < 2 or self._close) and self._slow(sizes)):
                self._stale = True
            elif len(sizes) > 1 and sizes[-1] > 2 * sizes[-2]:
                raise Failed("Newton's method diverges")
            elif len(sizes) >= method.iterations:
                break
        if corrections is None:
            raise Failed(f"Newton's method needs more than {method.iterations} iterations")

    def _slow(self, sizes: list[float]) -> bool:
        """Whether the updates shrink so slowly that new factors pay."""
        if len(sizes) < 2:
            return False
        ratio = sizes[-1] / sizes[-2]
        if ratio >= 0.9:
            return True
        return np.log(self.method.newton / sizes[-1]) / np.log(ratio) > self.method.patience

    def _place(self, point: Motion, u_known: FloatArray, v_known: FloatArray, step: float) -> None:
        """Make displacement and acceleration of a stage fit its velocity and the supports."""
        point.u = u_known + step * point.v
        self.model.hold(point.time, point.u, point.v)
        point.a = (point.v - v_known) / step

    def _correct(
        self,
        time: float,
        point: Motion,
        u_known: FloatArray,
        v_known: FloatArray,
        step: float,
    ) -> float:
        """One Newton update; the largest displacement it makes, m."""
        model = self.model
        gradients = model.constraint_gradients(point.u)
        force = self._balance(time, point, gradients)
        rate = model.constraint_rate(gradients, point.v)
        momentum = model.reduced(time, point.u, point.v, point.a, force)
        velocity, pressure = self._solver(momentum, -rate)
        model.add_unknowns(velocity, point.v)
        point.pressure += pressure
        self._place(point, u_known, v_known, step)
        self.evaluations += 1
        self.iterations += 1
        return step * float(np.abs(velocity).max())

    def _balance(self, time: float, point: Motion, gradients: list[FloatArray]) -> FloatArray:
        """Sum all forces, minus inertia on all rows, shape (N, 3), N."""
        force = self.model.whole(self.model.force(time, point.u, point.v))
        self.model.add_constraint_force(gradients, point.pressure, force)
        force -= self.model.whole_mass @ point.a
        return force

    def _renew(self, time: float, point: Motion, step: float, h: float) -> None:
        """Factor Newton's matrix at a state."""
        model = self.model
        matrices = model.element_tangents(time, point.u, point.v, step, 1.0)
        model.add_constraint_hessians(point.u, -step * point.pressure, matrices)
        for part, mass in zip(matrices, model.element_masses, strict=False):
            count = mass.shape[1]
            for i in range(3):
                rows = slice(i * count, (i + 1) * count)
                part[:, rows, rows] += mass / step
        if not all(np.isfinite(part).all() for part in matrices):
            raise Failed("the tangent is not finite")
        gradients = model.constraint_gradients(point.u)
        self._nodal_solver = self._solver = self.saddle.factor(matrices, gradients)
        if model.bodies is not None and model.bodies.unknown.size:
            self._solver = self._bordered(time, point, step, matrices, gradients)
        self._solver_step, self._stale = h, False
        self.factorisations += 1

    def _bordered(
        self,
        time: float,
        point: Motion,
        step: float,
        matrices: list[FloatArray],
        gradients: list[FloatArray],
    ) -> Border:
        """Border Newton's matrix with the unknown coordinates.

        Like the derivative of G V by U, that of the stiffness forces by the turning of T within the
        step is left out.
        """
        model, bodies = self.model, self.model.bodies
        assert bodies is not None
        rows = bodies.columns(point.u)
        turn = step * point.v[bodies.coordinates, 2]
        columns = bodies.columns(point.u, turn)
        C, R, E = condensed(model, matrices, columns, rows)
        by_q, by_v = bodies.tangents(time, point.u, point.v, self._balance(time, point, gradients))
        centres = np.einsum(
            "k,kir,kis->rs", model.whole_mass.diagonal()[bodies.rows] * bodies.is_centre,
            rows, columns,
        )  # fmt: skip
        inertia = centres + np.diag(bodies.inertia[bodies.unknown])
        E = E + step * by_q + by_v + inertia / step
        G_columns = condensed_gradient(model, gradients, columns)
        G_rows = -condensed_gradient(model, gradients, rows).T
        return Border(self._nodal_solver, (C, G_columns), (R, G_rows), E)

    def _project(self, point: Motion) -> None:
        """Take the drift of the constraints out of the displacement of the free nodes."""
        model = self.model
        nothing = np.zeros(3 * len(model.free))
        for _ in range(10):
            change, _ = model.constraint(point.u)
            largest = np.abs(change / model.sizes).max()
            if not np.isfinite(largest):
                break
            if largest <= self.method.volume:
                return
            correction, _ = self._nodal_solver(nothing, -change)
            point.u[model.free] += correction.reshape(-1, 3)
        kept = "volumes" if model.slides is None else "volumes and the sliding nodes"
        raise Failed(f"the {kept} are not kept ({largest:.1g})")
