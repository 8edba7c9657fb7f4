"""Faces of elements as isoparametric surfaces (43): tables by kind, the boundary, named surfaces.

The shape functions Y_K of a face are those of the element on that face, so that their derivatives
by the two parameters of the face are those of the element along two edges of the master element.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import sqrt

import numpy as np

from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.body.faces import row_places
from dolfin_tongue.direct.elements import (
    BRICK8,
    BRICK20,
    BRICK_EDGES,
    PRISM6,
    TETRAHEDRON4,
    ElementKind,
)
from dolfin_tongue.direct.mesh import Mesh


@dataclass(frozen=True, eq=False)
class FaceKind:
    """Equal faces of one kind of element.

    Parameters
    ----------
    corners : 3 or 4.
    nodes : ndarray, shape (s, k) -- for each such face its nodes in the element: the corners
        outward by the right-hand rule, then the nodes on the edges between them.
    shapes : ndarray, shape (q, k) -- Y_K at the quadrature points, the same on all.
    gradients : ndarray, shape (q, k, 2) -- Y_K,alpha there.
    weights : ndarray, shape (q,).
    at_nodes : the same faces with a rule that has points at the nodes.
    """

    corners: int
    nodes: IntArray
    shapes: FloatArray
    gradients: FloatArray
    weights: FloatArray
    at_nodes: FaceKind | None = None


@dataclass(frozen=True, eq=False)
class FaceGroup:
    """Faces of one kind on elements of one block.

    Parameters
    ----------
    kind : of the faces.
    block : place of the block of elements in `Mesh.blocks`.
    cells : ndarray, shape (f,) -- the element of each face, as its place in the block.
    local : ndarray, shape (f, k) -- nodes of the face as places among those of the element.
    faces : ndarray, shape (f, k) -- the same as node numbers.
    """

    kind: FaceKind
    block: int
    cells: IntArray
    local: IntArray
    faces: IntArray

    @property
    def keys(self) -> IntArray:
        """Sorted corner numbers, shape (f, 4); -1 leads those of a triangle."""
        corners = self.faces[:, : self.kind.corners]
        width = ((0, 0), (4 - self.kind.corners, 0))
        return np.sort(np.pad(corners, width, constant_values=-1), axis=1)

    def for_contact(self) -> FaceGroup:
        """Return the same faces with points at the nodes, so that no corner passes between two."""
        assert self.kind.at_nodes is not None
        return replace(self, kind=self.kind.at_nodes)

    def part(self, chosen: IntArray) -> FaceGroup:
        """Pick some of the faces."""
        return FaceGroup(
            self.kind, self.block, self.cells[chosen], self.local[chosen], self.faces[chosen]
        )


def outer_groups(mesh: Mesh) -> list[FaceGroup]:
    """All faces that belong to one element only."""
    groups = []
    for number, block in enumerate(mesh.blocks):
        for kind in FACE_KINDS[block.kind.name]:
            count, faces = len(block.cells), len(kind.nodes)
            cells = np.repeat(np.arange(count), faces)
            local = np.tile(kind.nodes, (count, 1))
            nodes = block.cells[cells[:, None], local]
            groups.append(FaceGroup(kind, number, cells, local, nodes))
    keys = np.concatenate([group.keys for group in groups])
    _, inverse, owners = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    outside = owners[inverse.ravel()] == 1
    ends = np.cumsum([len(group.cells) for group in groups])
    parts = np.split(outside, ends[:-1])
    return [
        group.part(np.flatnonzero(keep))
        for group, keep in zip(groups, parts, strict=True)
        if keep.any()
    ]


def surface_groups(mesh: Mesh, corners: IntArray) -> list[FaceGroup]:
    """Outer faces with given corners.

    Parameters
    ----------
    mesh : the elements.
    corners : ndarray, shape (k, 4) -- node numbers of the corners, in any order; -1 as one of them
        makes a triangle.
    """
    wanted = np.unique(np.sort(corners, axis=1), axis=0)
    groups = []
    for group in outer_groups(mesh):
        chosen = np.flatnonzero(row_places(group.keys, wanted) >= 0)
        if chosen.size:
            groups.append(group.part(chosen))
    return groups


# -- tables --------------------------------------------------------------------------------------


#: Points on [-1, 1] and weights, some at the nodes: Simpson's rule, and Lobatto's with five points.
SIMPSON = (np.array([-1.0, 0.0, 1.0]), np.array([1.0, 4.0, 1.0]) / 3.0)
LOBATTO5 = (
    np.array([-1.0, -sqrt(3 / 7), 0.0, sqrt(3 / 7), 1.0]),
    np.array([1 / 10, 49 / 90, 32 / 45, 49 / 90, 1 / 10]),
)

#: Barycentric points of a triangle and their weights: its middle; corners, edges and middle.
MIDDLE = (np.full((1, 3), 1 / 3), np.array([0.5]))
SEVEN = (
    np.concatenate([np.eye(3), (1 - np.eye(3)) / 2, np.full((1, 3), 1 / 3)]),
    np.array([1, 1, 1, 8 / 3, 8 / 3, 8 / 3, 9]) / 40,
)

Rule = tuple[FloatArray, FloatArray]


def _quadrilaterals(kind: ElementKind, nodes: IntArray, count: int, at_nodes: Rule) -> FaceKind:
    """Faces over [-1, 1]^2 with count x count Gauss points, for contact with another rule."""
    a, b, c, d = kind.nodes[nodes[0, :4]]
    tangents = np.stack([b - a, d - a], axis=1) / 2.0

    def faces(rule: Rule, other: FaceKind | None) -> FaceKind:
        point, weight = rule
        s, t = (grid.ravel() for grid in np.meshgrid(point, point, indexing="ij"))
        points = (a + b + c + d) / 4.0 + np.stack([s, t], axis=1) @ tangents.T
        tables = _tables(kind, nodes[0], points, tangents)
        return FaceKind(4, nodes, *tables, np.outer(weight, weight).ravel(), other)

    return faces(np.polynomial.legendre.leggauss(count), faces(at_nodes, None))


def _triangles(kind: ElementKind, nodes: IntArray) -> FaceKind:
    """Plane faces over a triangle: one point is exact for membranes, contact has seven."""
    corners = kind.nodes[nodes[0]]
    tangents = np.stack([corners[1] - corners[0], corners[2] - corners[0]], axis=1)

    def faces(rule: Rule, other: FaceKind | None) -> FaceKind:
        points, weights = rule
        tables = _tables(kind, nodes[0], points @ corners, tangents)
        return FaceKind(3, nodes, *tables, weights, other)

    return faces(MIDDLE, faces(SEVEN, None))


def _tables(
    kind: ElementKind, nodes: IntArray, points: FloatArray, tangents: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Y_K and Y_K,alpha at points of the master element, shapes (q, k) and (q, k, 2)."""
    shapes = np.ascontiguousarray(kind.shapes(points)[:, nodes])
    return shapes, np.ascontiguousarray(kind.gradients(points)[:, nodes] @ tangents)


_BRICK = np.array(
    [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]
)  # fmt: skip
_TETRAHEDRON = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])


def _with_middles(faces: IntArray) -> IntArray:
    """Faces of brick 20: corners, then the mid-node of each edge in the same order."""
    place = {frozenset(edge): 8 + number for number, edge in enumerate(BRICK_EDGES.tolist())}
    rows = faces.tolist()
    middles = [[place[frozenset((row[i], row[(i + 1) % 4]))] for i in range(4)] for row in rows]
    return np.concatenate([faces, middles], axis=1)


#: Kind of element -> its kinds of faces.
FACE_KINDS: dict[str, tuple[FaceKind, ...]] = {
    "brick8": (_quadrilaterals(BRICK8, _BRICK, 2, SIMPSON),),
    "brick20": (_quadrilaterals(BRICK20, _with_middles(_BRICK), 3, LOBATTO5),),
    "tetrahedron4": (_triangles(TETRAHEDRON4, _TETRAHEDRON),),
    "prism6": (
        _triangles(PRISM6, np.array([[0, 2, 1], [3, 4, 5]])),
        _quadrilaterals(PRISM6, np.array([[0, 1, 4, 3], [1, 2, 5, 4], [2, 0, 3, 5]]), 2, SIMPSON),
    ),
}
