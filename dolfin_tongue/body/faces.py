"""Faces of hexahedra: the boundary of a body and named parts of it, in plain NumPy."""

from __future__ import annotations

import numpy as np

from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.base.errors import BadMesh, listing
from dolfin_tongue.body.shape import FACES

#: Name of the surface that every body has: all its outer faces.
BOUNDARY = "boundary"


def outer_faces(cells: IntArray) -> tuple[IntArray, IntArray]:
    """Faces that belong to one cell only.

    Parameters
    ----------
    cells : ndarray, shape (m, 8) -- node numbers of hexahedra.

    Returns
    -------
    faces : ndarray, shape (k, 4) -- node numbers, outward by the right-hand rule.
    owners : ndarray, shape (k,) -- the cell of each face.
    """
    faces = cells[:, FACES].reshape(-1, 4)
    _, first, count = np.unique(
        np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True
    )
    single = np.sort(first[count == 1])
    return faces[single], single // len(FACES)


def faces_between(faces: IntArray, nodes: IntArray) -> IntArray:
    """Those of the faces, shape (k, 4), whose nodes all belong to a set of nodes."""
    return faces[np.isin(faces, nodes).all(axis=1)]


def from_smallest(faces: IntArray) -> IntArray:
    """Faces turned so that each begins with its smallest node number; the sense is kept."""
    start = faces.argmin(axis=1)[:, None]
    return np.take_along_axis(faces, (start + np.arange(faces.shape[1])) % faces.shape[1], axis=1)


def row_places(rows: IntArray, among: IntArray) -> IntArray:
    """Place of each row among the rows of another array, which are distinct; -1 where absent."""
    every, inverse = np.unique(np.concatenate([among, rows]), axis=0, return_inverse=True)
    place = np.full(len(every), -1)
    place[inverse.ravel()[: len(among)]] = np.arange(len(among))
    return place[inverse.ravel()[len(among) :]]


def check_surface(name: str, faces: IntArray, boundary: IntArray) -> None:
    """Refuse a surface that is no part of the boundary.

    Parameters
    ----------
    name : of body and surface, for the message.
    faces : ndarray, shape (k, 4) -- the surface.
    boundary : ndarray, shape (b, 4) -- all outer faces.

    Raises
    ------
    BadMesh : an empty surface, a wrong shape, faces that are no outer face of a cell, that point
        inward or cross themselves, or that occur twice; the message lists their places.
    """
    if faces.ndim != 2 or faces.shape[1] != 4 or not np.issubdtype(faces.dtype, np.integer):
        raise BadMesh(
            f"{name}: a surface must be node numbers of shape (k, 4), not {faces.dtype} of shape "
            f"{faces.shape}"
        )
    if not len(faces):
        raise BadMesh(f"{name} is empty")
    outside = np.flatnonzero(row_places(np.sort(faces, axis=1), np.sort(boundary, axis=1)) < 0)
    if outside.size:
        raise BadMesh(
            f"{name}: quadrilateral(s) {listing(outside)} are not the face of exactly one cell"
        )
    places = row_places(from_smallest(faces), from_smallest(boundary))
    turned = np.flatnonzero(places < 0)
    if turned.size:
        raise BadMesh(
            f"{name}: quadrilateral(s) {listing(turned)} point inward or cross themselves; number "
            "their nodes counter-clockwise as seen from outside"
        )
    if len(np.unique(places)) != len(places):
        raise BadMesh(f"{name} names a quadrilateral twice")


def areas(points: FloatArray, faces: IntArray) -> FloatArray:
    """Areas of bilinear quadrilaterals with 2x2 Gauss points, shape (k,), m2.

    Parameters
    ----------
    points : ndarray, shape (n, 3), m.
    faces : ndarray, shape (k, 4) -- node numbers, in order around the face.
    """
    corner = points[faces]
    total = np.zeros(len(faces))
    for s in (-1, 1) / np.sqrt(3.0):
        along_t = (1 - s) * (corner[:, 3] - corner[:, 0]) + (1 + s) * (corner[:, 2] - corner[:, 1])
        for t in (-1, 1) / np.sqrt(3.0):
            along_s = (1 - t) * (corner[:, 1] - corner[:, 0])
            along_s = along_s + (1 + t) * (corner[:, 2] - corner[:, 3])
            total += np.linalg.norm(np.cross(along_s, along_t), axis=1) / 16.0
    return total
