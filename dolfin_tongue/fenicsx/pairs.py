"""Pairs of displacement and pressure spaces, by name."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from dolfin_tongue.base.arrays import IntArray
from dolfin_tongue.base.errors import BadMesh, UnknownName
from dolfin_tongue.body.body import Body
from dolfin_tongue.body.faces import outer_faces, row_places

#: From the brick (VTK) order of corners to the tensor-product order of basix.
TENSOR_ORDER = {
    "hexahedron": np.array([0, 1, 3, 2, 4, 5, 7, 6]),
    "quadrilateral": np.array([0, 1, 3, 2]),
    "tetrahedron": np.arange(4),
    "triangle": np.arange(3),
}

#: Kuhn's six tetrahedra of a brick, all along the diagonal from corner 0 to corner 6.
TETRAHEDRA = np.array(
    [[0, 1, 2, 6], [0, 2, 3, 6], [0, 3, 7, 6], [0, 7, 4, 6], [0, 4, 5, 6], [0, 5, 1, 6]]
)


@dataclass(frozen=True)
class Pair:
    """A pair of displacement and pressure spaces.

    Parameters
    ----------
    shape, face : cells of the mesh, and those of its surfaces.
    degree : of the displacement, Lagrange.
    pressure : family and degree of the pressure.
    quadrature_degree : of all integrals.
    """

    shape: str
    face: str
    degree: int
    pressure: tuple[str, int]
    quadrature_degree: int

    @property
    def children(self) -> int:
        """Cells of the mesh in each hexahedron of the body."""
        return 1 if self.shape == "hexahedron" else len(TETRAHEDRA)

    def cells(self, body: Body) -> IntArray:
        """Corners of the cells of the mesh, in brick order, shape (children m, c)."""
        return body.hexahedra if self.shape == "hexahedron" else tetrahedra(body)

    def faces(self, body: Body, surface: str) -> IntArray:
        """Faces of the cells of the mesh on a surface of the body, outward, shape (k, 3 or 4)."""
        quads = body.surface(surface)
        if self.face == "quadrilateral":
            return quads
        triangles = outer_faces({"tetrahedron4": tetrahedra(body)})[0][:, :3]
        return triangles[_quads_of(triangles, quads) >= 0]

    def owners(self, body: Body, surface: str) -> IntArray:
        """Cell of the body below each of these faces, shape (k,)."""
        quads, faces = body.surface(surface), self.faces(body, surface)
        owners = body.owners(quads)
        return owners if self.face == "quadrilateral" else owners[_quads_of(faces, quads)]


#: The pairs by name. Q1/P0 is the report's: each cell keeps its mean volume, on 2x2x2 Gauss points.
#: The others are inf-sup stable and show what a mesh is worth: triquadratic with discontinuous
#: linear pressure, and Taylor-Hood on tetrahedra (each hexahedron is cut into six).
PAIRS = {
    "Q1/P0": Pair("hexahedron", "quadrilateral", 1, ("DG", 0), 3),
    "Q2/P1": Pair("hexahedron", "quadrilateral", 2, ("DPC", 1), 5),
    "P2/P1": Pair("tetrahedron", "triangle", 2, ("Lagrange", 1), 4),
}


def pair_of(name: str) -> Pair:
    """Return the pair of that name; UnknownName lists the known ones."""
    if name not in PAIRS:
        raise UnknownName("pair of spaces", name, PAIRS)
    return PAIRS[name]


def _quads_of(triangles: IntArray, quads: IntArray) -> IntArray:
    """Quadrilateral in which each triangle lies by its corners, shape (k,); -1 for none."""
    three = np.array(list(combinations(range(4), 3)))
    corners = np.sort(quads[:, three], axis=-1).reshape(-1, 3)
    place = row_places(np.sort(triangles, axis=1), corners)
    return np.where(place < 0, -1, place // len(three))


def tetrahedra(body: Body) -> IntArray:
    """Cut every hexahedron into six tetrahedra, shape (6 m, 4).

    Raises
    ------
    BadMesh : neighbours would cut their common face along different diagonals; the cells must all
        be numbered alike, as in a block.
    """
    cells = body.hexahedra[:, TETRAHEDRA].reshape(-1, 4)
    if len(outer_faces({"tetrahedron4": cells})[0]) != 2 * len(body.boundary):
        raise BadMesh(
            f"{body.name}: its hexahedra are not numbered alike, so that cutting them into "
            "tetrahedra does not fit together; use the pair Q2/P1"
        )
    return cells
