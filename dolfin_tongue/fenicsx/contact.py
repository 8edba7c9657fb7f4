"""Contact in the mixed system: tractions at the points of a surface (58)-(60).

The traction of a law without rates, a barrier, is stated for the *end* of a step. Its energy is
convex, so that over a step the change of that energy is at most the work done against the traction:
a step that jumps into the barrier loses energy and never gains any, whatever its size. Stated at
the stage, an impact that dt does not resolve would throw the body back with energy of its own. The
price is order 1 in the traction while it changes; the report's own law (60) is inelastic too.
A law of rates is stated at the stage, like all rates.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from dolfin_tongue.base.arrays import BoolArray, FloatArray, IntArray
from dolfin_tongue.boundary.contact import Contact, in_front
from dolfin_tongue.control import Instant
from dolfin_tongue.fenicsx.arguments import Arguments, Shifts
from dolfin_tongue.fenicsx.contact_points import rows_of, surface_points
from dolfin_tongue.fenicsx.coupling import Coupling, Sparse
from dolfin_tongue.fenicsx.numbering import Numbering
from dolfin_tongue.march.observed import Touch
from dolfin_tongue.surfaces.base import Gap

#: Gap, in ranges of the barrier, to which a touching point may go in one step. At 1.25 no step of
#: 18 drops at 0.1 to 2 m/s raised the energy; at 1.5 and 2 some did, by 0.2 % of the first one.
LEAP = 1.25

#: Points that are nearer than this many ranges are looked at until some point has moved as far.
MARGIN = 10.0

#: No points: an empty list of them, and no gaps.
NOWHERE = (
    np.zeros(0, dtype=np.int64), Gap(np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3, 3)))
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Situation:
    """Where tissue and obstacle are.

    Parameters
    ----------
    now : time, s, which says where the obstacle is, with the memory of where points began.
    y : unknowns.
    load : factor on the way of the obstacle: 1 in dynamics.
    """

    now: Instant
    y: FloatArray
    load: float = 1.0


@dataclass(frozen=True, eq=False)
class Watched:
    """Points that can be in range as long as none has moved farther than `margin`.

    A signed distance changes by at most what its point moves. So an obstacle is asked about few
    points, and about none while it is far away.

    Parameters
    ----------
    u, shift, margin : unknowns of the surface and place of the obstacle when it was made; m.
    points : numbers of the points.
    moves, gathers : from unknowns to their displacements, and from forces on them to rows.
    """

    u: FloatArray
    shift: FloatArray
    margin: float
    points: IntArray
    moves: Sparse
    gathers: Sparse


@dataclass(frozen=True, eq=False)
class Pressed:
    """Points in range and what the law says of them.

    Parameters
    ----------
    watched : the points that can be in range.
    near : those that are, as places among them, shape (k,).
    gap : their gaps.
    traction, by_gap, by_rate : see `ContactLaw.traction`.
    velocity : of the points against the obstacle, shape (k, 3), m/s; zero for a law without rates.
    """

    watched: Watched
    near: IntArray
    gap: Gap
    traction: FloatArray
    by_gap: FloatArray
    by_rate: FloatArray | float
    velocity: FloatArray


class ContactSurface(Coupling):
    """One `Contact`.

    Attributes
    ----------
    points : reference positions of the points, shape (q, 3), m.
    weights : reference area of each, shape (q,), m2.
    """

    def __init__(self, term: Contact, numbering: Numbering, label: str):
        self.term, self.label, self._size = term, label, numbering.size
        points = surface_points(numbering, term.surface)
        self.points, self.weights = points.places, points.weights
        self._moves, self._hats = points.moves, points.hats
        self.has_sides = term.obstacle.has_rim
        self._dofs = np.unique(self._moves.indices)
        #: How far a point may move when no unknown moves farther than 1.
        self._reach = float(np.sqrt(3) * np.abs(self._moves).sum(axis=1).max())
        self._watched: Watched | None = None

    # -- state at the points -------------------------------------------------------------------

    def _shift(self, at: Situation) -> FloatArray:
        return at.load * self.term.shift(at.now.time)[0]

    def gap(self, at: Situation) -> Gap:
        """Gap of all points."""
        return self._gap(slice(None), self._moves, at)

    def _gap(self, points: IntArray | slice, moves: Sparse, at: Situation) -> Gap:
        x = self.points[points] + (moves @ at.y[: self._size]).reshape(-1, 3)
        if self.term.motion is not None:
            x -= self._shift(at)
        gap = self.term.obstacle.gap(x)
        behind = at.now.of("sides").memory.get(self.label) if self.has_sides else None
        return gap if behind is None else in_front(gap, behind[points])

    def sides(self, time: float, y: FloatArray, load: float = 1.0) -> BoolArray:
        """Which points are behind a sheet or beyond its reach; it does not stop them there."""
        distance = self.gap(Situation(Instant(time), y, load)).distance
        return ~((distance > 0) & np.isfinite(distance))

    def watched(self, at: Situation) -> Watched:
        """Points that can be in range at a displacement."""
        old, u = self._watched, at.y[self._dofs]
        if old is not None:
            way = self._reach * float(np.abs(u - old.u).max())
            if self.term.motion is not None:
                way += float(np.linalg.norm(self._shift(at) - old.shift))
            if way < old.margin:
                return old
        distance = self.gap(at).distance
        margin = max(MARGIN * self.term.law.range, float(distance.min()) - self.term.law.range)
        margin = margin if np.isfinite(margin) else MARGIN * self.term.law.range
        # beyond a rim there is no distance to rely on; a NaN is to be noticed
        far = (distance >= self.term.law.range + margin) & np.isfinite(distance)
        points = np.flatnonzero(~far)
        moves = self._moves[rows_of(points)]
        self._watched = Watched(u, self._shift(at), margin, points, moves, moves.T.tocsr())
        return self._watched

    def _near(self, at: Situation) -> tuple[Watched, IntArray, Gap]:
        """Points in range, as places among those watched, and their gaps."""
        watched = self.watched(at)
        if not watched.points.size:
            return watched, *NOWHERE
        gap = self._gap(watched.points, watched.moves, at)
        near = np.flatnonzero(~(gap.distance >= self.term.law.range))
        if not near.size:
            return watched, *NOWHERE
        return watched, near, Gap(gap.distance[near], gap.normal[near], gap.curvature[near])

    def pressed(self, at: Arguments) -> Pressed:
        """Points in range and their tractions: at the end of the step, for rates at its stage."""
        law = self.term.law
        stage, end = (
            Situation(at.now, at.state, at.load),
            Situation(at.end_instant, at.end, at.load),
        )
        watched, near, gap = self._near(stage if law.rate_dependent else end)
        if not near.size:
            empty = gap.distance
            return Pressed(watched, near, gap, empty, empty, empty, gap.normal)
        if not law.rate_dependent:
            still = np.zeros((near.size, 3))
            return Pressed(watched, near, gap, *law.traction(gap.distance, None), still)
        velocity = (watched.moves @ at.rate[: self._size]).reshape(-1, 3)[near]
        velocity -= self.term.shift(at.now.time)[1]
        rate = (gap.normal * velocity).sum(axis=1)
        return Pressed(watched, near, gap, *law.traction(gap.distance, rate), velocity)

    def _force(self, at: Pressed) -> FloatArray:
        """Return the forces on the points that are watched, one component after the other, N."""
        force = np.zeros((at.watched.points.size, 3))
        areas = self.weights[at.watched.points[at.near]]
        force[at.near] = (areas * at.traction)[:, None] * at.gap.normal
        return force.ravel()

    # -- residual and tangent ------------------------------------------------------------------

    def add_residual(self, at: Arguments, out: FloatArray) -> None:
        """-int t n.w dA in rows of u, N."""
        pressed = self.pressed(at)
        if pressed.near.size:
            out[: self._size] -= pressed.watched.gathers @ self._force(pressed)

    def with_tangent(
        self, matrix: Sparse, at: Arguments, shifts: Shifts, rows: FloatArray
    ) -> Sparse:
        """Add the derivatives by the displacement of the stage or of the end, and by the rate."""
        pressed = self.pressed(at)
        near, watched = pressed.near, pressed.watched
        if not near.size:
            return matrix
        n, H = pressed.gap.normal, pressed.gap.curvature
        outer = n[:, :, None] * n[:, None, :]
        block = pressed.by_gap[:, None, None] * outer + pressed.traction[:, None, None] * H
        if self.term.law.rate_dependent:
            slope = np.asarray(pressed.by_rate)[:, None, None]
            turning = np.einsum("qi,qjk,qk->qij", n, H, pressed.velocity)
            block = block + slope * (turning + shifts.rate * outer)
        else:
            block = shifts.end * block
        weights = self.weights[watched.points[near], None, None]
        return matrix + _spread(watched.moves[rows_of(near)], -weights * block, matrix.shape[0])

    def reason_to_reject(self, at: Arguments, before: FloatArray | None = None) -> str:
        """Name a point that has come through, or one that has left the barrier at one bound.

        The method of time stepping remembers the acceleration of a touching point for a step; a
        long step would turn it into a leap.
        """
        law = self.term.law
        if law.rate_dependent:  # the report's law lets a steady push creep through
            return ""
        end = Situation(at.end_instant, at.end, at.load)
        watched, near, gap = self._near(end)
        if near.size and not gap.distance.min() > 0:
            return f"penetration of {-gap.distance.min():.2g} m at {self.label}"
        if before is None:
            return ""
        watched, near, _ = self._near(Situation(at.end_instant, before, at.load))
        if not near.size:
            return ""
        now = self._gap(watched.points[near], watched.moves[rows_of(near)], end).distance
        leaps = (now > LEAP * law.range) & np.isfinite(now)  # over a rim a point may go
        return f"a leap off the obstacle at {self.label}" if leaps.any() else ""

    # -- what is observed ----------------------------------------------------------------------

    def energies(self, at: Arguments) -> dict[str, float]:
        """Energy of a law that has one."""
        law = self.term.law
        if law.rate_dependent:
            return {}
        watched, near, gap = self._near(Situation(at.now, at.state, at.load))
        if not near.size:
            return {self.label: 0.0}
        weights = self.weights[watched.points[near]]
        return {self.label: float(weights @ law.energy(gap.distance))}

    def powers(self, at: Arguments) -> dict[str, float]:
        """Power of a law of rates, and of an obstacle that moves."""
        if not self.term.law.rate_dependent and self.term.motion is None:
            return {}
        pressed = self.pressed(at)
        force = self._force(pressed)
        if self.term.law.rate_dependent:
            power = force @ (pressed.watched.moves @ at.rate[: self._size])
            return {self.label: float(power)}
        total = force.reshape(-1, 3).sum(axis=0)
        return {f"{self.label}_motion": float(total @ self.term.shift(at.now.time)[1])}

    def touch(self, at: Arguments) -> Touch:
        """Return what is touched, where, and how hard."""
        smallest = self.gap(Situation(at.now, at.state, at.load)).distance.min()
        pressed = self.pressed(at)
        points = pressed.watched.points[pressed.near]
        weights, traction = self.weights[points], pressed.traction
        area = self.weights @ self._hats
        force = (weights * traction) @ self._hats[points]
        return Touch(
            float(weights.sum()), (weights * traction) @ pressed.gap.normal,
            float(traction.max(initial=0.0)), float(smallest),
            np.divide(force, area, out=np.zeros_like(area), where=area > 0),
        )  # fmt: skip


def _spread(moves: Sparse, blocks: FloatArray, size: int) -> Sparse:
    """Sum over points of N_K N_L times a block, as a matrix over all unknowns."""
    columns = np.repeat(np.arange(len(blocks) * 3).reshape(-1, 3), 3, axis=0)
    starts = np.arange(0, blocks.size + 1, 3)
    middle = sp.csr_array((blocks.ravel(), columns.ravel(), starts))
    total = (moves.T @ (middle @ moves)).tocsr()
    total.resize((size, size))
    return total
