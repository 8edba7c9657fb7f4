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

Both ways measure 1.99 to 2.01 in displacement, velocity and pressure
(`tests/direct/test_order.py`). The report's tongue (42 bricks, two muscles, 50 Pa s;
`pytest -m slow -s tests/direct/test_direct_tongue.py`, one core) at dt = 5 and 10 ms errs by 0.09
and 0.36 % of the largest displacement; an iteration costs 0.15 ms, new factors 1 ms. Runge-Kutta 4
is stable there up to 0.028 ms.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.base.errors import OutOfRange, is_number, require_positive
from dolfin_tongue.body.state import State
from dolfin_tongue.control import Instant
from dolfin_tongue.direct.impacts import Impacts
from dolfin_tongue.direct.model import Model
from dolfin_tongue.direct.multipliers import Acceleration
from dolfin_tongue.direct.solver import DirectSolver
from dolfin_tongue.direct.stage import Failed, Point, Stage, StageNumbers, StageSolver
from dolfin_tongue.march.solver import Attempt, Stepper
from dolfin_tongue.march.steps import StepControl, before
from dolfin_tongue.scene.scene import Scene

#: Implicit coefficient d, place 2 d of the inner stage, weight w of the first two stages.
D = 1.0 - 1.0 / sqrt(2.0)
INNER = 2.0 * D
W = sqrt(2.0) / 4.0
#: Weights minus those of the embedded third-order method (Hosea and Shampine 1996).
ERROR_WEIGHTS = (W - (1.0 - W) / 3.0, W - (3.0 * W + 1.0) / 3.0, D - D / 3.0)

#: Relative change of the step up to which the factors are kept.
SAME_STEP = 0.1


@dataclass(frozen=True)
class TrBdf2:
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
        for name in ("smallest", "largest"):
            if getattr(self, name) is not None:
                require_positive(self, "s", **{name: getattr(self, name)})
        if not (is_number(self.patience) and self.patience >= 0):
            raise OutOfRange("TrBdf2.patience", self.patience, ">= 0")
        if self.corrections is not None and not self.corrections >= 1:
            raise OutOfRange("TrBdf2.corrections", self.corrections, ">= 1, or None")

    @property
    def control(self) -> StepControl:
        """Sizes of steps; a small change is not worth new factors."""
        smallest, largest = self.smallest or self.dt / 1000, self.largest or 10 * self.dt
        return StepControl(
            self.dt, self.tolerance, smallest, largest, cut=0.25, growth=4.0, worthwhile=1.3
        )

    @property
    def stage_numbers(self) -> StageNumbers:
        """When a stage is done."""
        return StageNumbers(
            self.corrections, self.newton, self.volume, self.patience, self.iterations
        )

    def solver(self, scene: Scene) -> DirectSolver:
        """Return the solver of a scene."""
        model = Model(scene, self.mass)
        return DirectSolver(self, model, TrBdf2Stepper(model, self.stage_numbers), self.control)


class TrBdf2Stepper(Stepper):
    """One run.

    Parameters
    ----------
    model : the equations.
    numbers : when a stage is done.

    Attributes
    ----------
    euler_steps : steps that contact made Euler's.
    """

    def __init__(self, model: Model, numbers: StageNumbers):
        self.model, self.numbers = model, numbers
        self.stages = StageSolver(model, numbers)
        self.impacts = Impacts(model)
        self.steps = self.euler_steps = self._before = 0
        self._initial = Acceleration(model, None)
        zero = np.zeros(model.numbering.shape)
        nothing = np.zeros(model.constraints.count)
        self._now = Point(Instant(0.0), zero, zero, zero, nothing)
        self._inner: Point | None = None
        self._tried: tuple[Point | None, Point] = (None, self._now)
        #: Rows whose error counts: nodes and centres of mass.
        self._points = model.bodies.centres.stop

    def counts(self) -> dict[str, int]:
        """Return how often what was done."""
        return {
            "steps": self.steps,
            "newton_iterations": self.stages.iterations,
            "factorisations": self.stages.factorisations,
            "euler_steps": self.euler_steps,
        }

    # -- steps -------------------------------------------------------------------------------------

    def begin(self, state: State) -> State:
        """Find acceleration and pressures of a beginning."""
        now = Instant(state.time, state.memory)
        u, v = self.model.rows(state)
        a, pressure = self._initial(now, u, v)
        contact = self.impacts.moment(now, u, v).forces
        self._now = Point(now, u, v, a, pressure, contact)
        self._inner, self.stages.stale = None, True
        self._before = self.stages.iterations
        self.impacts.begin(now, u, v)
        return self.model.numbering.state(now, u, v, pressure, step=state.step)

    def attempt(self, state: State, dt: float, end: float) -> Attempt:
        """Take one step of at most dt."""
        remaining = end - state.time
        time = end if dt >= remaining * (1 - 1e-12) else state.time + dt
        self._now.now = Instant(state.time, state.memory)
        try:
            with np.errstate(all="ignore"):
                inner, new, error = self._any_step(dt, Instant(time, state.memory), end)
        except Failed as failure:
            return Attempt(None, cause=str(failure))
        self._tried = inner, new
        count = self.stages.iterations - self._before
        numbering = self.model.numbering
        found = numbering.state(new.now, new.u, new.v, new.pressure, step=dt, iterations=count)
        return Attempt(found, error)

    def accept(self) -> None:
        """Keep the step."""
        self.impacts.accept()
        self._inner, self._now = self._tried
        self.steps += 1
        self._before = self.stages.iterations

    def reject(self) -> None:
        """Drop the step."""
        self.impacts.forget()
        self.stages.stale = True

    # -- one step ----------------------------------------------------------------------------------

    def _any_step(self, h: float, then: Instant, end: float) -> tuple[Point | None, Point, float]:
        """Take a step of TR-BDF2, or of Euler's method where contact does not allow that."""
        if not self.model.obstacles:
            return self._step(h, then, end)
        now, impacts, stages = self._now, self.impacts, self.stages
        stages.close = impacts.near(now.now, now.u) or impacts.near(then, now.u + h * now.v)
        try:
            inner, new, error = self._step(h, then, end)
            first, second, third = (part.moment for part in (now, inner, new))
            if not impacts.judge(h, first, third, ((W, first), (W, second), (D, third))):
                return inner, new, error
        except Failed:
            if not stages.close:
                raise
        stages.stale = stages.close = True
        new = self._stage(then, h / D, end, (now.u, now.v), np.zeros_like(now.a), now.pressure)
        stages.project(new)
        last = new.moment
        if cause := impacts.judge(h, now.moment, last, ((1.0, last),), dissipates=True):
            raise Failed(cause)
        self.euler_steps += 1
        return None, new, 0.5 * h * float(np.abs(new.v - now.v).max())

    def _step(self, h: float, then: Instant, end: float) -> tuple[Point, Point, float]:
        """Both stages and the projection; returns inner stage, end and error of a displacement."""
        now, stages = self._now, self.stages
        if self.numbers.corrections is not None or abs(stages.solver_step / h - 1.0) > SAME_STEP:
            stages.stale = True
        slope, pressure_slope = self._slopes()
        middle = Instant(now.now.time + INNER * h, then.memory)
        guess = now.a + INNER * h * slope
        known = now.u + D * h * now.v, now.v + D * h * now.a
        inner = self._stage(middle, h, end, known, guess, now.pressure + INNER * h * pressure_slope)
        guess = now.a + (inner.a - now.a) / INNER
        pressure = now.pressure + (inner.pressure - now.pressure) / INNER
        known = now.u + W * h * (now.v + inner.v), now.v + W * h * (now.a + inner.a)
        new = self._stage(then, h, end, known, guess, pressure)
        first, second, third = ERROR_WEIGHTS
        nodal = (first * now.v + second * inner.v + third * new.v)[: self._points]
        error = h * np.abs(nodal).max()
        stages.project(new)
        return inner, new, float(error)

    def _slopes(self) -> tuple[FloatArray | float, FloatArray | float]:
        """Slopes of acceleration and pressure, from the inner stage of the step before."""
        now, inner = self._now, self._inner
        if inner is None:
            return 0.0, 0.0
        span = now.now.time - inner.now.time
        return (now.a - inner.a) / span, (now.pressure - inner.pressure) / span

    def _stage(
        self,
        then: Instant,
        h: float,
        end: float,
        known: tuple[FloatArray, FloatArray],
        guess: FloatArray,
        pressure: FloatArray,
    ) -> Point:
        """Solve one stage, starting from a guess of acceleration and pressure."""
        read = Instant(before(then.time, end), then.memory)
        stage = Stage(read, D * h, h, *known)
        point = Point(then, known[0], known[1] + stage.step * guess, guess, pressure.copy())
        self.stages.solve(point, stage)
        point.contact = self.impacts.moment(read, point.u, point.v).forces
        return point
