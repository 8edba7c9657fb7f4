"""The surface of a body as VTK draws it: bilinear patches with shading normals, in plain NumPy."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import scipy.sparse

from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.body.body import Body
from dolfin_tongue.body.faces import corners_of, outer_faces

#: Faces that meet at a larger angle keep a crease between them, degrees.
CREASE = 50.0


class Skin:
    """Boundary faces of a body, each cut into small quadrilaterals.

    Faces share no points in the picture, so that a colour may jump from one to the next; where they
    meet smoothly they share their normals.

    Parameters
    ----------
    body : the body, whose reference shape decides where creases are.
    cuts : parts of each edge in the patch of a face.

    Attributes
    ----------
    faces : ndarray, shape (q, 4) -- nodes of the boundary faces, outward by the right-hand rule;
        a triangle has its last corner twice.
    cell_of_face : ndarray, shape (q,) -- the cell of each face.
    edges : ndarray, shape (e, 2) -- nodes of the element edges on the surface.
    patches : ndarray, shape (q cuts^2, 4) -- small quadrilaterals, as numbers of `points`.
    """

    def __init__(self, body: Body, cuts: int = 3):
        faces, self.cell_of_face = outer_faces(body.cells_by_kind)
        self.faces: IntArray = corners_of(faces)
        pairs = np.stack([self.faces, np.roll(self.faces, -1, axis=1)], axis=-1).reshape(-1, 2)
        pairs = pairs[pairs[:, 0] != pairs[:, 1]]
        self.edges: IntArray = np.unique(np.sort(pairs, axis=1), axis=0)
        line = np.linspace(0.0, 1.0, cuts + 1)
        s, t = (grid.ravel() for grid in np.meshgrid(line, line, indexing="ij"))
        self._weights = np.stack([(1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t], axis=1)
        i, j = np.meshgrid(np.arange(cuts), np.arange(cuts), indexing="ij")
        corner = (i * (cuts + 1) + j).ravel()
        small = np.stack([corner, corner + cuts + 1, corner + cuts + 2, corner + 1], axis=1)
        offset = np.arange(len(self.faces))[:, None, None] * len(self._weights)
        self.patches: IntArray = (offset + small).reshape(-1, 4)
        self._neighbours = self._smooth_neighbours(body.points)

    def _area_normals(self, points: FloatArray) -> np.ndarray:
        """Outward normals of the faces, times twice their area, shape (q, 3)."""
        corner = points[self.faces]
        return np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])

    def _smooth_neighbours(self, points: FloatArray) -> scipy.sparse.csr_matrix:
        """Which faces count for the normal at each face corner, shape (4 q, q)."""
        normals = self._area_normals(points)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        corners, count = self.faces.ravel(), len(self.faces)
        at_node = scipy.sparse.csr_matrix(
            (np.ones(corners.size), (corners, np.arange(corners.size) // 4)),
            shape=(len(points), count),
        )
        touching = at_node[corners].tocoo()
        alike = np.einsum("ij,ij->i", normals[touching.row // 4], normals[touching.col])
        keep = alike >= np.cos(np.radians(CREASE))
        return scipy.sparse.csr_matrix(
            (np.ones(keep.sum()), (touching.row[keep], touching.col[keep])), shape=touching.shape
        )

    def points(self, points: FloatArray) -> FloatArray:
        """Points of the patches of a deformed body with nodes at `points` (n, 3), m."""
        return self._spread(points[self.faces])

    def normals(self, points: FloatArray) -> FloatArray:
        """Return unit normals for shading at the points of the patches."""
        corner = (self._neighbours @ self._area_normals(points)).reshape(-1, 4, 3)
        # Each corner of a face counts the same inside of it, whatever the size of its neighbours.
        corner /= np.maximum(np.linalg.norm(corner, axis=-1, keepdims=True), 1e-30)
        normals = self._spread(corner)
        return normals / np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-30)

    def of_nodes(self, values: FloatArray) -> FloatArray:
        """Values at nodes (n, k), interpolated to the points of the patches."""
        return self._spread(values[self.faces])

    def of_cells(self, values: FloatArray) -> FloatArray:
        """Values of cells (m, k), constant on each face, at the points of the patches."""
        return np.repeat(values[self.cell_of_face], len(self._weights), axis=0)

    def _spread(self, corner: FloatArray) -> FloatArray:
        """Bilinear interpolation from face corners (q, 4, k) to the points of all patches."""
        return np.einsum("ac,qck->qak", self._weights, corner).reshape(-1, corner.shape[-1])

    @cached_property
    def nodes(self) -> IntArray:
        """Nodes of the surface, sorted."""
        return np.unique(self.faces)
