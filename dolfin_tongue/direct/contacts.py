"""Contact with rigid obstacles by hand: nodal forces, tangents, energy, and what is to be seen.

At each point of the faces in the reference configuration (some are nodes, see
`FaceGroup.for_contact`) the position is x = Y_K (X^K + U^K) (43), the gap h(x - s) from an obstacle
moved by s(t), its normal n = grad h, its curvature H = grad n and the rate h' = n.(v - s') (58),
(59). With the traction t(h, h') of the law per reference area dA,

    F_K = w dA t n Y_K,
    -dF_K/dU_L = -w dA Y_K Y_L [n (t_h n + t_h' H (v - s'))^T + t H],
    -dF_K/dV_L = -w dA Y_K Y_L t_h' n n^T.

Only points nearer than the range of the law are passed to it.

An obstacle that nothing comes near costs an interpolation of positions: see `Obstacle._near`.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from dolfin_tongue.base.arrays import BoolArray, FloatArray, IntArray
from dolfin_tongue.base.compiled import compiled
from dolfin_tongue.body.face_groups import FaceGroup
from dolfin_tongue.body.state import NOTHING
from dolfin_tongue.boundary.contact import Contact, in_front
from dolfin_tongue.control import Instant
from dolfin_tongue.direct.membranes import base_vectors, determinant
from dolfin_tongue.direct.parts import Configuration, Part, Tangent
from dolfin_tongue.march.observed import Touch
from dolfin_tongue.surfaces.base import Gap

#: No points, and their gaps.
NOWHERE = (np.zeros(0, np.int64), Gap(np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3, 3))))


class Obstacle(Part):
    """One `Contact` on its faces.

    Parameters
    ----------
    label : of the term.
    term : obstacle, law and motion.
    groups : the faces, with k points in all.
    points : ndarray, shape (n, 3), m -- reference positions.
    """

    def __init__(self, label: str, term: Contact, groups: list[FaceGroup], points: FloatArray):
        groups = [group.for_contact() for group in groups]
        self.labels, self.term, self.groups = (label,), term, groups
        self.rate_dependent, self.has_sides = term.law.rate_dependent, term.obstacle.has_rim
        self.points = points
        self._clear, self._clear_memory = -1.0, NOTHING
        self.areas = np.concatenate([_areas(group, points) for group in groups])
        #: Per group: its points among all.
        ends = np.cumsum([0, *(len(group.faces) * len(group.kind.weights) for group in groups)])
        self.slices = [slice(a, b) for a, b in pairwise(ends)]
        self._seen: FloatArray = np.zeros((len(self.areas), 3))

    @property
    def name(self) -> str:
        """What messages call it."""
        return f"contact of {self.term.surface!r} with the {type(self.term.obstacle).__name__}"

    @property
    def impassable(self) -> bool:
        """Whether the law stops a body for good: one with an energy; one of rates lets it creep."""
        return not self.rate_dependent

    def at_points(self, values: FloatArray) -> FloatArray:
        """Values at the points from those at nodes, shape (n, 3); shape (k, 3)."""
        out = np.empty((len(self.areas), 3))
        for group, part in zip(self.groups, self.slices, strict=True):
            interpolate(values, group.faces, group.kind.shapes, out[part])
        return out

    def sides(self, time: float, x: FloatArray) -> BoolArray:
        """Which points are behind a sheet, or beyond its reach, where a step begins."""
        distance = self.term.obstacle.gap(self._places(time, x)).distance
        return ~((distance > 0) & np.isfinite(distance))

    def _places(self, time: float, x: FloatArray) -> FloatArray:
        """Positions of the points against the obstacle for nodes at x, shape (n, 3), m."""
        return self.at_points(x) - self.term.shift(time)[0]

    def _gap(self, now: Instant, places: FloatArray) -> Gap:
        gap = self.term.obstacle.gap(places)
        behind = now.of("sides").memory.get(self.labels[0]) if self.has_sides else None
        return gap if behind is None else in_front(gap, behind)

    def _near(self, now: Instant, x: FloatArray) -> tuple[IntArray, Gap]:
        """Points nearer than the range, with their gaps.

        A distance changes by no more than the point moves: while no point has moved by as much as
        was clear when the gaps were last asked for, they need not be asked for.
        """
        places = self._places(now.time, x)
        known = not self.has_sides or now.memory is self._clear_memory
        if known and farthest(places, self._seen) < self._clear:
            return NOWHERE
        gap = self._gap(now, places)
        near = np.flatnonzero(~(gap.distance >= self.term.law.range))  # a NaN is to be noticed
        if not near.size and np.isfinite(gap.distance).all():
            self._seen, self._clear = places, float(gap.distance.min()) - self.term.law.range
            self._clear_memory = now.memory
        return near, Gap(gap.distance[near], gap.normal[near], gap.curvature[near])

    def clipped_gaps(self, now: Instant, x: FloatArray) -> FloatArray:
        """Gaps of all points, at most the range, shape (k,), m."""
        near, gap = self._near(now, x)
        out = np.full(len(self.areas), self.term.law.range)
        out[near] = gap.distance
        return out

    def smallest_gap(self, now: Instant, x: FloatArray) -> float:
        """Smallest gap within the range of the law, m; inf if there is none."""
        near, gap = self._near(now, x)
        return float(gap.distance.min()) if near.size else np.inf

    def _relative(self, time: float, v: FloatArray, near: IntArray) -> FloatArray | None:
        """Velocity against the obstacle, shape (j, 3); None where the law does not ask."""
        return self.at_points(v)[near] - self.term.shift(time)[1] if self.rate_dependent else None

    def add_force(self, at: Configuration, out: FloatArray) -> None:
        """Add the nodal forces to out, N."""
        near, gap = self._near(at.now, at.x)
        if not near.size:
            return
        traction, _, _ = self._law(gap, self._relative(at.now.time, at.v, near))
        force = np.zeros((len(self.areas), 3))
        force[near] = (self.areas[near] * traction)[:, None] * gap.normal
        for group, part in zip(self.groups, self.slices, strict=True):
            spread(force[part], group.faces, group.kind.shapes, out)

    def _law(
        self, gap: Gap, relative: FloatArray | None
    ) -> tuple[FloatArray, FloatArray, FloatArray | float]:
        rate = None if relative is None else np.einsum("ji,ji->j", gap.normal, relative)
        return self.term.law.traction(gap.distance, rate)

    def add_tangent(self, at: Configuration, tangent: Tangent) -> None:
        """Add -(factor dF/dU + rate_factor dF/dV) to the element matrices of the blocks."""
        near, gap = self._near(at.now, at.x) if tangent.counts(self.labels[0]) else NOWHERE
        if not near.size:
            return
        relative = self._relative(at.now.time, at.v, near)
        traction, by_gap, by_rate = self._law(gap, relative)
        n = gap.normal
        factor = tangent.factor
        row = (factor * by_gap + tangent.rate_factor * by_rate)[:, None] * n
        if relative is not None:
            turned = np.einsum("jab,jb->ja", gap.curvature, relative)
            row += factor * np.asarray(by_rate)[:, None] * turned
        parts = n[:, :, None] * row[:, None] + factor * traction[:, None, None] * gap.curvature
        matrices = np.zeros((len(self.areas), 3, 3))
        matrices[near] = -self.areas[near, None, None] * parts
        touched = np.zeros(len(self.areas), dtype=np.bool_)
        touched[near] = True
        for group, part in zip(self.groups, self.slices, strict=True):
            add_matrices(
                matrices[part], touched[part], group.kind.shapes, group.cells, group.local,
                tangent.matrices[group.block],
            )  # fmt: skip

    def energy(self, now: Instant, x: FloatArray) -> float:
        """Energy with the nodes at x, J; zero for a law of rates."""
        near, gap = self._near(now, x)
        return float(np.sum(self.areas[near] * self.term.law.energy(gap.distance)))

    def energies(self, at: Configuration) -> dict[str, float]:
        """Energy of a law that has one, J."""
        return {} if self.rate_dependent else {self.labels[0]: self.energy(at.now, at.x)}

    def powers(self, at: Configuration) -> dict[str, float]:
        """Power of a law of rates, and of an obstacle that moves, W."""
        if not self.rate_dependent and self.term.motion is None:
            return {}
        force = np.zeros_like(at.x)
        self.add_force(at, force)
        if self.rate_dependent:
            return {self.labels[0]: float(np.sum(force * at.v[: len(force)]))}
        shift = self.term.shift(at.now.time)[1]
        return {f"{self.labels[0]}_motion": float(force.sum(axis=0) @ shift)}

    def touch(self, at: Configuration) -> Touch:
        """Return what is touched, where, and how hard."""
        gap = self._gap(at.now, self._places(at.now.time, at.x))
        near = np.flatnonzero(gap.distance < self.term.law.range)
        part = Gap(gap.distance[near], gap.normal[near], gap.curvature[near])
        traction, _, _ = self._law(part, self._relative(at.now.time, at.v, near))
        force = (self.areas[near] * traction) @ part.normal
        largest = float(traction.max()) if near.size else 0.0
        pushed = np.zeros((len(self.areas), 3))
        pushed[near, 0] = self.areas[near] * traction
        pushed[:, 1] = self.areas
        sums = np.zeros_like(at.x)
        for group, points in zip(self.groups, self.slices, strict=True):
            spread(pushed[points], group.faces, group.kind.shapes, sums)
        pressure = np.divide(sums[:, 0], sums[:, 1], np.zeros(len(sums)), where=sums[:, 1] > 0)
        area = float(self.areas[near].sum())
        return Touch(area, force, largest, float(gap.distance.min()), pressure)


def _areas(group: FaceGroup, points: FloatArray) -> FloatArray:
    """Return the reference area of each quadrature point of a group, shape (f q,), m2."""
    kind = group.kind
    shape = (len(group.faces), len(kind.weights))
    base, metric = np.empty((*shape, 2, 3)), np.empty((*shape, 3))
    base_vectors(points, group.faces, kind.gradients, base, metric)
    return (kind.weights * np.sqrt(determinant(metric))).ravel()


# -- loops over faces ----------------------------------------------------------------------------


@compiled
def interpolate(values: FloatArray, faces: IntArray, shapes: FloatArray, out: FloatArray) -> None:
    """Write Y_K values_K at the points.

    Parameters
    ----------
    values : shape (n, 3).
    faces : shape (f, k).
    shapes : shape (q, k).
    out : shape (f q, 3).
    """
    count = shapes.shape[0]
    for face in range(faces.shape[0]):
        for q in range(count):
            for i in range(3):
                value = 0.0
                for node in range(faces.shape[1]):
                    value += shapes[q, node] * values[faces[face, node], i]
                out[face * count + q, i] = value


@compiled
def farthest(points: FloatArray, others: FloatArray) -> float:
    """Return the largest distance of points to others of the same number; NaN if one is."""
    largest = 0.0
    for point in range(points.shape[0]):
        square = 0.0
        for i in range(3):
            square += (points[point, i] - others[point, i]) ** 2
        if not square <= largest:
            largest = square
            if square != square:
                break
    return np.sqrt(largest)


@compiled
def spread(force: FloatArray, faces: IntArray, shapes: FloatArray, out: FloatArray) -> None:
    """Add Y_K force, force of shape (f q, 3), to nodal forces, shape (n, 3), N."""
    count = shapes.shape[0]
    for face in range(faces.shape[0]):
        for q in range(count):
            for i in range(3):
                value = force[face * count + q, i]
                if value != 0.0:
                    for node in range(faces.shape[1]):
                        out[faces[face, node], i] += shapes[q, node] * value


@compiled
def add_matrices(
    matrices: FloatArray,
    touched: BoolArray,
    shapes: FloatArray,
    cells: IntArray,
    local: IntArray,
    out: FloatArray,
) -> None:
    """Add Y_K Y_L times the matrices of the points to element matrices.

    Parameters
    ----------
    matrices : shape (f q, 3, 3), N/m.
    touched : shape (f q,) -- whether there is anything to add.
    shapes : shape (q, k).
    cells, local : shapes (f,) and (f, k).
    out : shape (m, 3k', 3k') with the k' nodes of the elements.
    """
    points, count, size = shapes.shape[0], shapes.shape[1], out.shape[1] // 3
    for face in range(cells.shape[0]):
        for q in range(points):
            point = face * points + q
            if not touched[point]:
                continue
            for node in range(count):
                for other in range(count):
                    weight = shapes[q, node] * shapes[q, other]
                    for i in range(3):
                        for j in range(3):
                            row, column = (
                                i * size + local[face, node],
                                j * size + local[face, other],
                            )
                            out[cells[face], row, column] += weight * matrices[point, i, j]
