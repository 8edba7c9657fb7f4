"""Contact in the mixed system: tractions at the points of a surface (58)-(60).

The traction of a law without rates, a barrier, is stated for the *end* of a step. Its energy is
convex, so that over a step the change of that energy is at most the work done against the traction:
a step that jumps into the barrier loses energy and never gains any, whatever its size. Stated at
the stage, an impact that dt does not resolve would throw the body back with energy of its own. The
price is order 1 in the traction while it changes; the report's own law (60) is inelastic too.
A rated law is stated at the stage, like all rates.

The points are those of a rule with points at the nodes: between Gauss points a corner or an edge
would pass a fifth of a face deep.
"""

from __future__ import annotations

from dataclasses import dataclass

import basix
import numpy as np
import scipy.sparse as sp

from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.boundary.contact import Contact, in_front
from dolfin_tongue.fenicsx.couplings.base import Arguments, Coupling, Shifts, Sparse
from dolfin_tongue.fenicsx.mesh import MixedSpace
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


class ContactSurface(Coupling):
    """One `Contact`.

    Attributes
    ----------
    points : reference positions of the points, shape (q, 3), m.
    weights : reference area of each, shape (q,), m2.
    """

    def __init__(self, term: Contact, space: MixedSpace, label: str):
        self.term, self.label, self._size = term, label, space.size
        self.points, self.weights, self._moves, self._hats = surface_points(space, term.surface)
        self._dofs = np.unique(self._moves.indices)
        #: How far a point may move when no unknown moves farther than 1.
        self._reach = float(np.sqrt(3) * np.abs(self._moves).sum(axis=1).max())
        self._watched: Watched | None = None
        self._behind = np.zeros(len(self.points), dtype=bool)

    # -- state at the points -------------------------------------------------------------------

    def gap(self, time: float, y: FloatArray) -> Gap:
        """Gap of all points at a displacement."""
        return self._gap(slice(None), self._moves, time, y)

    def _gap(self, points: IntArray | slice, moves: Sparse, time: float, y: FloatArray) -> Gap:
        x = self.points[points] + (moves @ y[: self._size]).reshape(-1, 3)
        if self.term.motion is not None:
            x -= self.term.shift(time)[0]
        return in_front(self.term.obstacle.gap(x), self._behind[points])

    def begin(self, time: float, y: FloatArray) -> None:
        """Note which points are behind a sheet or beyond its reach; it does not stop them there."""
        if self.term.obstacle.has_rim:
            self._behind[:] = False
            distance = self.gap(time, y).distance
            self._behind = ~((distance > 0) & np.isfinite(distance))

    def watched(self, time: float, y: FloatArray) -> Watched:
        """Points that can be in range at a displacement."""
        old, u = self._watched, y[self._dofs]
        if old is not None:
            way = self._reach * float(np.abs(u - old.u).max())
            if self.term.motion is not None:
                way += float(np.linalg.norm(self.term.shift(time)[0] - old.shift))
            if way < old.margin:
                return old
        distance = self.gap(time, y).distance
        margin = max(MARGIN * self.term.law.range, float(distance.min()) - self.term.law.range)
        margin = margin if np.isfinite(margin) else MARGIN * self.term.law.range
        # beyond a rim there is no distance to rely on; a NaN is to be noticed
        far = (distance >= self.term.law.range + margin) & np.isfinite(distance)
        points = np.flatnonzero(~far)
        moves = self._moves[_rows(points)]
        self._watched = Watched(
            u, self.term.shift(time)[0], margin, points, moves, moves.T.tocsr()
        )  # fmt: skip
        return self._watched

    def _near(self, time: float, y: FloatArray) -> tuple[Watched, IntArray, Gap]:
        """Points in range, as places among those watched, and their gaps."""
        watched = self.watched(time, y)
        if not watched.points.size:
            return watched, *NOWHERE
        gap = self._gap(watched.points, watched.moves, time, y)
        near = np.flatnonzero(~(gap.distance >= self.term.law.range))
        if not near.size:
            return watched, *NOWHERE
        return watched, near, Gap(gap.distance[near], gap.normal[near], gap.curvature[near])

    def _touched(
        self, at: Arguments
    ) -> tuple[Watched, IntArray, Gap, FloatArray, FloatArray, FloatArray | float, FloatArray]:
        """See `traction`; points as places among those watched."""
        law = self.term.law
        time, y = (at.time, at.state) if law.rated else (at.time_end, at.end)
        watched, near, gap = self._near(time, y)
        if not near.size:
            empty = gap.distance
            return watched, near, gap, empty, empty, empty, gap.normal
        if not law.rated:
            return (watched, near, gap, *law.traction(gap.distance, None), gap.normal)
        velocity = (watched.moves @ at.rate[: self._size]).reshape(-1, 3)[near]
        velocity -= self.term.shift(at.time)[1]
        rate = (gap.normal * velocity).sum(axis=1)
        return (watched, near, gap, *law.traction(gap.distance, rate), velocity)

    def traction(self, at: Arguments) -> tuple[IntArray, Gap, FloatArray]:
        """Points in range, their gaps, and the traction there, Pa."""
        watched, near, gap, traction, *_ = self._touched(at)
        return watched.points[near], gap, traction

    def _force(
        self, watched: Watched, near: IntArray, gap: Gap, traction: FloatArray
    ) -> FloatArray:
        """Return the forces on the points that are watched, one component after the other, N."""
        force = np.zeros((watched.points.size, 3))
        force[near] = (self.weights[watched.points[near]] * traction)[:, None] * gap.normal
        return force.ravel()

    # -- residual and tangent ------------------------------------------------------------------

    def add_residual(self, at: Arguments, out: FloatArray) -> None:
        """-int t n.w dA in rows of u, N."""
        watched, near, gap, traction, *_ = self._touched(at)
        if near.size:
            force = self._force(watched, near, gap, traction)
            out[: self._size] -= watched.gathers @ force

    def with_tangent(
        self, matrix: Sparse, at: Arguments, shifts: Shifts, rows: FloatArray
    ) -> Sparse:
        """Add the derivatives by the displacement of the stage or of the end, and by the rate."""
        watched, near, gap, traction, by_gap, by_rate, velocity = self._touched(at)
        if not near.size:
            return matrix
        n, H = gap.normal, gap.curvature
        outer = n[:, :, None] * n[:, None, :]
        block = by_gap[:, None, None] * outer + traction[:, None, None] * H
        if self.term.law.rated:
            slope = np.asarray(by_rate)[:, None, None]
            turning = np.einsum("qi,qjk,qk->qij", n, H, velocity)
            block = block + slope * (turning + shifts.rate * outer)
        else:
            block = shifts.end * block
        weights = self.weights[watched.points[near], None, None]
        return matrix + _spread(watched.moves[_rows(near)], -weights * block, matrix.shape[0])

    # -- what is shown ------------------------------------------------------------------------

    def refusal(self, time: float, y: FloatArray, before: FloatArray | None = None) -> str:
        """Name a point that has come through, or one that has left the barrier at one bound.

        The method of time stepping remembers the acceleration of a touching point for a step; a
        long step would turn it into a leap.
        """
        law = self.term.law
        if law.rated:  # the report's law lets a steady push creep through
            return ""
        watched, near, gap = self._near(time, y)
        if near.size and not gap.distance.min() > 0:
            return f"penetration of {-gap.distance.min():.2g} m at {self.label}"
        if before is None:
            return ""
        watched, near, _ = self._near(time, before)
        if not near.size:
            return ""
        now = self._gap(watched.points[near], watched.moves[_rows(near)], time, y).distance
        leaps = (now > LEAP * law.range) & np.isfinite(now)  # over a rim a point may go
        return f"a leap off the obstacle at {self.label}" if leaps.any() else ""

    def energies(self, at: Arguments) -> dict[str, float]:
        """Energy of a law that has one."""
        law = self.term.law
        if law.rated:
            return {}
        watched, near, gap = self._near(at.time, at.state)
        if not near.size:
            return {self.label: 0.0}
        weights = self.weights[watched.points[near]]
        return {self.label: float(weights @ law.energy(gap.distance))}

    def powers(self, at: Arguments) -> dict[str, float]:
        """Power of a rated law, and of an obstacle that moves."""
        if not self.term.law.rated and self.term.motion is None:
            return {}
        watched, near, gap, traction, *_ = self._touched(at)
        force = self._force(watched, near, gap, traction)
        if self.term.law.rated:
            return {self.label: float(force @ (watched.moves @ at.rate[: self._size]))}
        total = force.reshape(-1, 3).sum(axis=0)
        return {f"{self.label}_motion": float(total @ self.term.shift(at.time)[1])}

    def observed(self, at: Arguments) -> dict[str, float]:
        """Area in contact, resultant on the tissue, largest pressure, smallest gap."""
        smallest = self.gap(at.time, at.state).distance.min()
        near, gap, traction = self.traction(at)
        force = (self.weights[near] * traction) @ gap.normal
        names = (f"{self.label}_force_{axis}_N" for axis in "xyz")
        return {
            f"{self.label}_area_m2": float(self.weights[near].sum()),
            **{name: float(value) for name, value in zip(names, force, strict=True)},
            f"{self.label}_pressure_Pa": float(traction.max(initial=0.0)),
            f"{self.label}_gap_m": float(smallest),
        }

    def pressure_map(self, at: Arguments) -> FloatArray:
        """Traction at the nodes of the body, shape (n,), Pa; zero away from the surface.

        Means over the points, weighted with trilinear shape functions: their integral over the
        surface is the sum of all tractions times areas.
        """
        near, _, traction = self.traction(at)
        force = (self.weights[near] * traction) @ self._hats[near]
        area = self.weights @ self._hats
        return np.divide(force, area, out=np.zeros_like(area), where=area > 0)


def _rows(points: IntArray) -> IntArray:
    """Rows of the three components of points."""
    return (3 * points[:, None] + [0, 1, 2]).ravel()


def _spread(moves: Sparse, blocks: FloatArray, size: int) -> Sparse:
    """Sum over points of N_K N_L times a block, as a matrix of mixed arrays."""
    columns = np.repeat(np.arange(len(blocks) * 3).reshape(-1, 3), 3, axis=0)
    starts = np.arange(0, blocks.size + 1, 3)
    middle = sp.csr_array((blocks.ravel(), columns.ravel(), starts))
    total = (moves.T @ (middle @ moves)).tocsr()
    total.resize((size, size))
    return total


#: Of the triangle: corners, middles of edges, centre; exact to degree 3.
TRIANGLE = (
    np.array([[0, 0], [1, 0], [0, 1], [0.5, 0.5], [0, 0.5], [0.5, 0], [1 / 3, 1 / 3]]),
    np.array([1, 1, 1, 8 / 3, 8 / 3, 8 / 3, 9]) / 40,
)


def _rule(facet: basix.CellType, degree: int) -> tuple[FloatArray, FloatArray]:
    """Points on a facet, some at its nodes, and positive weights.

    Simpson's rule on quadrilaterals (degree 1), Gauss-Lobatto with four points (degree 2).
    """
    if facet == basix.CellType.triangle:
        return TRIANGLE
    rule = basix.make_quadrature(facet, 2 * degree + 1, rule=basix.QuadratureType.gll)
    return np.asarray(rule[0]), np.asarray(rule[1])


def surface_points(
    space: MixedSpace, surface: str
) -> tuple[FloatArray, FloatArray, Sparse, Sparse]:
    """Points on a surface of the reference body; one that several facets share is one point.

    Returns
    -------
    points : ndarray, shape (q, 3), m.
    weights : ndarray, shape (q,), m2.
    moves : sparse, shape (3 q, size of the mixed space) -- from unknowns to displacements there.
    hats : sparse, shape (q, n) -- from values at the nodes of the body, linear in between.
    """
    cell = basix.CellType[space.pair.shape]
    facets = space.facets(space.body.surface(surface))
    rule, rule_weights = _rule(basix.cell.subentity_types(cell)[2][0], space.pair.degree)
    corners, topology = np.asarray(basix.geometry(cell)), basix.topology(cell)[2]
    element, geometry = space.displacement_element, space.mesh.geometry
    linear = basix.create_element(basix.ElementFamily.P, cell, 1)
    points, weights, moves, hats = [], [], [], []
    for local, vertices in enumerate(topology):
        cells = facets[facets[:, 1] == local, 0]
        if not len(cells):
            continue
        axes = corners[vertices[1:3]] - corners[vertices[0]]
        master = corners[vertices[0]] + rule @ axes
        closure = element.entity_closure_dofs[2][local]
        table = np.asarray(element.tabulate(0, master))[0, :, closure, 0].T
        flat = np.asarray(linear.tabulate(1, master))[:, :, :, 0]
        x = geometry.x[geometry.dofmap[cells]]
        tangents = np.einsum("ai,iqk,fkc->fqac", axes, flat[1:], x)
        area = np.linalg.norm(np.cross(tangents[:, :, 0], tangents[:, :, 1]), axis=-1)
        points.append(np.einsum("qk,fkc->fqc", flat[0], x).reshape(-1, 3))
        weights.append((area * rule_weights).ravel())
        dofs = space.cell_displacement_dofs(cells)[:, closure]
        nodes = np.asarray(geometry.input_global_indices)[geometry.dofmap[cells]][:, vertices]
        moves.append(_table(table, dofs.transpose(0, 2, 1), space.size))
        hats.append(_table(flat[0][:, vertices], nodes[:, None], len(space.body.points)))
    return _merged(
        np.concatenate(points), np.concatenate(weights), sp.vstack(moves), sp.vstack(hats)
    )


def _table(values: FloatArray, columns: IntArray, size: int) -> Sparse:
    """Matrix of values (q, k) at columns (f, c, k); a row for each facet, point and component."""
    shape = (len(columns), len(values), *columns.shape[1:])
    column = np.broadcast_to(columns[:, None], shape).reshape(-1, shape[-1])
    value = np.broadcast_to(values[None, :, None], shape).reshape(-1, shape[-1])
    rows, k = np.nonzero(np.abs(value) > 1e-12)
    place = (rows, column[rows, k])
    return sp.coo_array((value[rows, k], place), shape=(len(value), size)).tocsr()


def _merged(
    points: FloatArray, weights: FloatArray, moves: Sparse, hats: Sparse
) -> tuple[FloatArray, FloatArray, Sparse, Sparse]:
    """Each point once; equal are those that move alike, whatever the motion."""
    moves = moves.tocsr()
    trial = np.random.default_rng(0).random(moves.shape[1])
    key = (moves @ trial).reshape(-1, 3).round(9)
    _, first, group = np.unique(key, axis=0, return_index=True, return_inverse=True)
    return (
        points[first],
        np.bincount(group.ravel(), weights),
        moves[_rows(first)],
        hats.tocsr()[first],
    )
