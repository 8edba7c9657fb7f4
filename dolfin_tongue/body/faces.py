"""Faces of cells: the boundary of a body and named parts of it, in plain NumPy.

Faces are rows of four node numbers, in order around the face and outward by the right-hand rule; a
triangle has -1 as the fourth.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from dolfin_tongue.base.arrays import BoolArray, FloatArray, IntArray
from dolfin_tongue.base.errors import BadMesh, listing
from dolfin_tongue.body.cells import KINDS

#: Name of the surface that every body has: all its outer faces.
BOUNDARY = "boundary"


def all_faces(cells: Mapping[str, IntArray]) -> tuple[IntArray, IntArray]:
    """Corner faces of all cells, shape (k, 4), cell after cell in each kind, and their owners."""
    faces: list[IntArray] = [np.zeros((0, 4), dtype=np.int64)]
    owners: list[IntArray] = [np.zeros(0, dtype=np.int64)]
    first = 0
    for name, nodes in cells.items():
        numbers = np.arange(first, first + len(nodes))
        for corners in KINDS[name].faces:
            rows = nodes[:, corners].reshape(-1, corners.shape[1])
            faces.append(_padded(rows))
            owners.append(np.repeat(numbers, len(corners)))
        first += len(nodes)
    return np.concatenate(faces), np.concatenate(owners)


def _padded(rows: IntArray) -> IntArray:
    """Triangles with -1 as the fourth."""
    return np.pad(rows, ((0, 0), (0, 4 - rows.shape[1])), constant_values=-1)


def outer_faces(cells: IntArray | Mapping[str, IntArray]) -> tuple[IntArray, IntArray]:
    """Faces that belong to one cell only.

    Parameters
    ----------
    cells : node numbers by kind, or ndarray of shape (m, 8) of hexahedra.

    Returns
    -------
    faces : ndarray, shape (k, 4).
    owners : ndarray, shape (k,) -- the cell of each face.
    """
    if not isinstance(cells, Mapping):
        cells = {"hexahedron8": cells}
    faces, owners = all_faces(cells)
    _, first, count = np.unique(
        np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True
    )
    single = np.sort(first[count == 1])
    return faces[single], owners[single]


def faces_between(faces: IntArray, nodes: IntArray) -> IntArray:
    """Those of the faces, shape (k, 4), whose nodes all belong to a set of nodes."""
    return faces[(np.isin(faces, nodes) | (faces < 0)).all(axis=1)]


def from_smallest(faces: IntArray) -> IntArray:
    """Faces turned so that each begins with its smallest node number; the sense is kept."""
    result = faces.copy()
    for count in (3, 4):
        rows = np.flatnonzero((faces >= 0).sum(axis=1) == count)
        part = faces[rows, :count]
        places = (part.argmin(axis=1)[:, None] + np.arange(count)) % count
        result[rows, :count] = np.take_along_axis(part, places, axis=1)
    return result


def row_places(rows: IntArray, among: IntArray) -> IntArray:
    """Place of each row among the rows of another array, which are distinct; -1 where absent."""
    every, inverse = np.unique(np.concatenate([among, rows]), axis=0, return_inverse=True)
    place = np.full(len(every), -1)
    place[inverse.ravel()[: len(among)]] = np.arange(len(among))
    return place[inverse.ravel()[len(among) :]]


def as_surface(name: str, faces: IntArray, boundary: IntArray) -> IntArray:
    """Faces of a surface, shape (k, 4); refused unless they are part of the boundary.

    Parameters
    ----------
    name : of body and surface, for the message.
    faces : ndarray, shape (k, 4), or (k, 3) for triangles -- the surface.
    boundary : ndarray, shape (b, 4) -- all outer faces.

    Raises
    ------
    BadMesh : an empty surface, a wrong shape, faces that are no outer face of a cell, that point
        inward or cross themselves, or that occur twice; the message lists their places.
    """
    if (
        faces.ndim != 2
        or faces.shape[1] not in (3, 4)
        or not np.issubdtype(faces.dtype, np.integer)
    ):
        raise BadMesh(
            f"{name}: a surface must be node numbers of shape (k, 4), or (k, 3) for triangles, not "
            f"{faces.dtype} of shape {faces.shape}"
        )
    if not len(faces):
        raise BadMesh(f"{name} is empty")
    faces = _padded(faces.astype(np.int64))
    outside = np.flatnonzero(row_places(np.sort(faces, axis=1), np.sort(boundary, axis=1)) < 0)
    if outside.size:
        raise BadMesh(f"{name}: face(s) {listing(outside)} are not the face of exactly one cell")
    places = row_places(from_smallest(faces), from_smallest(boundary))
    turned = np.flatnonzero(places < 0)
    if turned.size:
        raise BadMesh(
            f"{name}: face(s) {listing(turned)} point inward or cross themselves; number "
            "their nodes counter-clockwise as seen from outside"
        )
    if len(np.unique(places)) != len(places):
        raise BadMesh(f"{name} names a face twice")
    return faces


def owners_of(faces: IntArray, boundary: IntArray, owners: IntArray) -> IntArray:
    """Return the cell of each of some outer faces, shape (k,)."""
    return owners[row_places(np.sort(faces, axis=1), np.sort(boundary, axis=1))]


def corners_of(faces: IntArray) -> IntArray:
    """Corner numbers of faces, shape (k, 4); a triangle has its last corner twice."""
    return np.where(faces < 0, faces[:, 2:3], faces)


def is_triangle(faces: IntArray) -> BoolArray:
    """Mask of the triangles among faces, shape (k,)."""
    return faces[:, 3] < 0


def areas(points: FloatArray, faces: IntArray) -> FloatArray:
    """Areas of bilinear quadrilaterals with 2x2 Gauss points, shape (k,), m2.

    Parameters
    ----------
    points : ndarray, shape (n, 3), m.
    faces : ndarray, shape (k, 4).
    """
    corner = points[corners_of(faces)]
    total = np.zeros(len(faces))
    for s in (-1, 1) / np.sqrt(3.0):
        along_t = (1 - s) * (corner[:, 3] - corner[:, 0]) + (1 + s) * (corner[:, 2] - corner[:, 1])
        for t in (-1, 1) / np.sqrt(3.0):
            along_s = (1 - t) * (corner[:, 1] - corner[:, 0])
            along_s = along_s + (1 + t) * (corner[:, 2] - corner[:, 3])
            total += np.linalg.norm(np.cross(along_s, along_t), axis=1) / 16.0
    return total
