"""One implicit stage with constraints: Newton's method, its factors, the projection onto volumes.

See `tr_bdf2` for the equations. The factors of Newton's matrix [A -G^T; G 0] are kept over
iterations, stages and steps while they serve.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.control import Instant
from dolfin_tongue.direct.border import Border, condensed, condensed_gradient
from dolfin_tongue.direct.impacts import Moment
from dolfin_tongue.direct.model import Model
from dolfin_tongue.direct.saddle import Saddle, SaddleSolver


@dataclass
class Point:
    """A point of a trajectory: what a stage takes and gives.

    Parameters
    ----------
    now : time and memory.
    u, v, a : displacement, velocity, acceleration of all rows, shape (N, 3).
    pressure : multipliers of all constraints, shape (c,), Pa.
    contact : nodal forces of each obstacle, as they act in M a, shape (N, 3), N.
    """

    now: Instant
    u: FloatArray
    v: FloatArray
    a: FloatArray
    pressure: FloatArray
    contact: list[FloatArray] = field(default_factory=list)

    @property
    def moment(self) -> Moment:
        """What contact is judged by."""
        return Moment(self.now, self.u, self.v, self.contact)


@dataclass(frozen=True)
class Stage:
    """What a stage is given.

    Parameters
    ----------
    read : instant at which controls are read; a jump at the end of a stretch is not yet seen.
    step : implicit coefficient times step, d h, s.
    h : step, s.
    u, v : known parts of displacement and velocity, shape (N, 3).
    """

    read: Instant
    step: float
    h: float
    u: FloatArray
    v: FloatArray


class Failed(Exception):
    """A stage did not converge."""


@dataclass(frozen=True)
class StageNumbers:
    """When a stage is done; see `tr_bdf2.TrBdf2`."""

    corrections: int | None
    newton: float
    volume: float
    patience: float
    iterations: int


class StageSolver:
    """Solves stages of one run.

    Attributes
    ----------
    factorisations, iterations : so far.
    stale : whether the next correction needs new factors.
    close : whether the step starts or is going to end near an obstacle: then it is iterated.
    """

    def __init__(self, model: Model, numbers: StageNumbers):
        self.model, self.numbers = model, numbers
        self.saddle = Saddle(model)
        self.factorisations = self.iterations = 0
        self.stale, self.close = True, False
        #: Step that the factors were made for, s.
        self.solver_step = 0.0
        self._solver: SaddleSolver
        self._nodal_solver: SaddleSolver  # with rigid bodies standing still

    def solve(self, point: Point, stage: Stage) -> None:
        """Newton's method on a stage, or the given number of corrections; from a first guess."""
        numbers = self.numbers
        corrections = None if self.close else numbers.corrections
        self._place(point, stage)
        sizes: list[float] = []
        renewals = 0
        for _ in range(corrections or 3 * numbers.iterations):
            if self.stale:
                self._renew(point, stage)
                sizes, renewals = [], renewals + 1
            sizes.append(self._correct(point, stage))
            if not np.isfinite(sizes[-1]):
                raise Failed("a stage is not finite")
            if corrections is not None:
                continue
            if sizes[-1] <= numbers.newton:
                return
            if numbers.patience == 0 or ((renewals < 2 or self.close) and self._slow(sizes)):
                self.stale = True
            elif len(sizes) > 1 and sizes[-1] > 2 * sizes[-2]:
                raise Failed("Newton's method diverges")
            elif len(sizes) >= numbers.iterations:
                break
        if corrections is None:
            raise Failed(f"Newton's method needs more than {numbers.iterations} iterations")

    def _slow(self, sizes: list[float]) -> bool:
        """Whether the updates shrink so slowly that new factors pay."""
        if len(sizes) < 2:
            return False
        ratio = sizes[-1] / sizes[-2]
        if ratio >= 0.9:
            return True
        expected = np.log(self.numbers.newton / sizes[-1]) / np.log(ratio)
        return bool(expected > self.numbers.patience)

    def _place(self, point: Point, stage: Stage) -> None:
        """Make displacement and acceleration of a stage fit its velocity and the supports."""
        point.u = stage.u + stage.step * point.v
        self.model.hold(point.now.time, point.u, point.v)
        point.a = (point.v - stage.v) / stage.step

    def _correct(self, point: Point, stage: Stage) -> float:
        """One Newton update; the largest displacement it makes, m."""
        model = self.model
        gradients = model.constraints.gradients(point.u)
        force = self._balance(point, stage, gradients)
        rate = model.constraints.rate(gradients, point.v)
        momentum = model.reduced(stage.read, point.u, point.v, point.a, force)
        velocity, pressure = self._solver(momentum, -rate)
        model.numbering.add_unknowns(velocity, point.v)
        point.pressure += pressure
        self._place(point, stage)
        self.iterations += 1
        return stage.step * float(np.abs(velocity).max())

    def _balance(self, point: Point, stage: Stage, gradients: list[FloatArray]) -> FloatArray:
        """Sum all forces, minus inertia on all rows, shape (N, 3), N."""
        model = self.model
        force = model.numbering.padded(model.force(stage.read, point.u, point.v))
        model.constraints.add_force(gradients, point.pressure, force)
        force -= model.inertia(point.a)
        return force

    def _renew(self, point: Point, stage: Stage) -> None:
        """Factor Newton's matrix at a state."""
        model, step = self.model, stage.step
        matrices = model.element_tangents(model.at(stage.read, point.u, point.v), step, 1.0)
        model.constraints.add_hessians(point.u, -step * point.pressure, matrices)
        for part, mass in zip(matrices, model.element_masses, strict=False):
            count = mass.shape[1]
            for i in range(3):
                rows = slice(i * count, (i + 1) * count)
                part[:, rows, rows] += mass / step
        if not all(np.isfinite(part).all() for part in matrices):
            raise Failed("the tangent is not finite")
        gradients = model.constraints.gradients(point.u)
        self._nodal_solver = self._solver = self.saddle.factor(matrices, gradients)
        if model.bodies.unknown.size:
            self._solver = self._bordered(point, stage, matrices, gradients)
        self.solver_step, self.stale = stage.h, False
        self.factorisations += 1

    def _bordered(
        self,
        point: Point,
        stage: Stage,
        matrices: list[FloatArray],
        gradients: list[FloatArray],
    ) -> Border:
        """Border Newton's matrix with the unknown coordinates.

        Like the derivative of G V by U, that of the stiffness forces by the turning of T within the
        step is left out.
        """
        model, bodies, step = self.model, self.model.bodies, stage.step
        rows = bodies.columns(point.u)
        turn = step * point.v[bodies.coordinates, 2]
        columns = bodies.columns(point.u, turn)
        C, R, E = condensed(model, matrices, columns, rows)
        force = self._balance(point, stage, gradients)
        by_q, by_v = bodies.tangents(stage.read, point.u, point.v, force)
        centres = np.einsum(
            "k,kir,kis->rs", model.whole_mass.diagonal()[bodies.rows] * bodies.is_centre,
            rows, columns,
        )  # fmt: skip
        inertia = centres + np.diag(bodies.inertia[bodies.unknown])
        E = E + step * by_q + by_v + inertia / step
        G_columns = condensed_gradient(model, gradients, columns)
        G_rows = -condensed_gradient(model, gradients, rows).T
        return Border(self._nodal_solver, (C, G_columns), (R, G_rows), E)

    def project(self, point: Point) -> None:
        """Take the drift of the constraints out of the displacement of the free nodes."""
        model = self.model
        constraints, free = model.constraints, model.numbering.free
        nothing = np.zeros(3 * len(free))
        for _ in range(10):
            change, _ = constraints.evaluate(point.u)
            largest = np.abs(change / constraints.sizes).max()
            if not np.isfinite(largest):
                break
            if largest <= self.numbers.volume:
                return
            correction, _ = self._nodal_solver(nothing, -change)
            point.u[free] += correction.reshape(-1, 3)
        kept = "volumes and the sliding nodes" if constraints.slide_scale.size else "volumes"
        raise Failed(f"the {kept} are not kept ({largest:.1g})")
