"""Faces of cells as isoparametric surfaces (43): tables by kind, the faces of a surface.

The shape functions Y_K of a face are those of the cell on that face, so that their derivatives by
the two parameters of the face are those of the cell along two edges of the master element.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import sqrt

import numpy as np

from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.body.body import Body
from dolfin_tongue.body.cells import BRICK_EDGES, KINDS, CellKind
from dolfin_tongue.body.faces import row_places


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
    block : place of the block of cells in `Body.blocks`.
    cells : ndarray, shape (f,) -- the element of each face, as its place in the block.
    local : ndarray, shape (f, k) -- nodes of the face as places among those of the cell.
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


def face_groups(body: Body, surface: str) -> list[FaceGroup]:
    """Faces of a surface, grouped by the kind of face and the block of cells that they belong to.

    Parameters
    ----------
    body : the body.
    surface : its name; UnknownName lists the known ones.
    """
    wanted = np.sort(body.surface(surface), axis=1)
    groups = []
    for number, block in enumerate(body.blocks):
        for kind in FACE_KINDS[block.kind.name]:
            count, faces = len(block.cells), len(kind.nodes)
            cells = np.repeat(np.arange(count), faces)
            local = np.tile(kind.nodes, (count, 1))
            group = FaceGroup(kind, number, cells, local, block.cells[cells[:, None], local])
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


def _quadrilaterals(kind: CellKind, nodes: IntArray, count: int, at_nodes: Rule) -> FaceKind:
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


def _triangles(kind: CellKind, nodes: IntArray) -> FaceKind:
    """Plane faces over a triangle: one point is exact for membranes, contact has seven."""
    corners = kind.nodes[nodes[0]]
    tangents = np.stack([corners[1] - corners[0], corners[2] - corners[0]], axis=1)

    def faces(rule: Rule, other: FaceKind | None) -> FaceKind:
        points, weights = rule
        tables = _tables(kind, nodes[0], points @ corners, tangents)
        return FaceKind(3, nodes, *tables, weights, other)

    return faces(MIDDLE, faces(SEVEN, None))


def _tables(
    kind: CellKind, nodes: IntArray, points: FloatArray, tangents: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Y_K and Y_K,alpha at points of the master element, shapes (q, k) and (q, k, 2)."""
    shapes = np.ascontiguousarray(kind.shapes(points)[:, nodes])
    return shapes, np.ascontiguousarray(kind.gradients(points)[:, nodes] @ tangents)


def _with_middles(faces: IntArray) -> IntArray:
    """Faces of hexahedron 20: corners, then the mid-node of each edge in the same order."""
    place = {frozenset(map(int, edge)): 8 + number for number, edge in enumerate(BRICK_EDGES)}
    rows = [tuple(map(int, face)) for face in faces]
    middles = [[place[frozenset((row[i], row[(i + 1) % 4]))] for i in range(4)] for row in rows]
    return np.concatenate([faces, middles], axis=1)


def _kinds_of(kind: CellKind) -> tuple[FaceKind, ...]:
    """Kinds of faces of a kind of cells."""
    kinds = []
    for corners in kind.faces:
        if corners.shape[1] == 3:
            kinds.append(_triangles(kind, corners))
        elif kind.node_count == 20:
            kinds.append(_quadrilaterals(kind, _with_middles(corners), 3, LOBATTO5))
        else:
            kinds.append(_quadrilaterals(kind, corners, 2, SIMPSON))
    return tuple(kinds)


#: Kind of cell -> its kinds of faces.
FACE_KINDS = {name: _kinds_of(kind) for name, kind in KINDS.items()}
