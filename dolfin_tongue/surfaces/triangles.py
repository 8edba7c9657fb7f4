"""Triangulated surfaces as plain arrays: what they must be, and their normals."""

from __future__ import annotations

import numpy as np

from dolfin_tongue.base.arrays import BoolArray, FloatArray, IntArray
from dolfin_tongue.base.errors import BadMesh, listing
from dolfin_tongue.base.units import LARGEST_SIZE

#: Twice the area of a triangle over the square of its longest edge, below which it has no normal.
SLIVER = 1e-10


def check_triangles(
    name: str, points: FloatArray, triangles: IntArray, *, sheet: bool, inside_out: str
) -> None:
    """Refuse triangles that bound no body (or, for a sheet, have no two sides).

    Parameters
    ----------
    name : for the messages.
    points : ndarray, shape (n, 3), m.
    triangles : ndarray, shape (t, 3) -- numbers of points, counter-clockwise seen from outside
        (of a sheet: from its free side).
    sheet : whether the surface may have a rim.
    inside_out : what to do about triangles that point inward, for the message.

    Raises
    ------
    BadMesh : wrong shapes, points that are not finite or in millimetres, numbers out of range,
        triangles without area, edges of three or more triangles, neighbours that point to different
        sides; unless a sheet: border edges, a volume <= 0. The message lists the offenders.
    """
    _check_arrays(name, points, triangles)
    _check_areas(name, points, triangles)
    _check_edges(name, triangles, sheet)
    if not sheet and volume(points, triangles) <= 0:
        raise BadMesh(f"{name} is inside out: its triangles point inward; {inside_out}")


def _check_arrays(name: str, points: FloatArray, triangles: IntArray) -> None:
    """Shapes, numbers, metres."""
    if points.ndim != 2 or points.shape[1] != 3:
        raise BadMesh(f"{name}: points must have shape (n, 3), not {points.shape}")
    if triangles.ndim != 2 or triangles.shape[1] != 3 or not len(triangles):
        raise BadMesh(
            f"{name}: triangles must have shape (t, 3) with t >= 1, not {triangles.shape}"
        )
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if bad.size:
        raise BadMesh(f"{name}: coordinates of point(s) {listing(bad)} are not finite")
    outside = np.flatnonzero(((triangles < 0) | (triangles >= len(points))).any(axis=1))
    if outside.size:
        raise BadMesh(
            f"{name}: triangle(s) {listing(outside)} name points that do not exist; the "
            f"{len(points)} points have the numbers 0 to {len(points) - 1}"
        )
    size = np.ptp(points[triangles].reshape(-1, 3), axis=0).max()
    if size > LARGEST_SIZE:
        raise BadMesh(
            f"{name}: it is {size:.3g} m long; coordinates are metres: multiply by 1e-3 (or pass "
            "scale=1e-3 when reading a file) if yours are millimetres"
        )


def _check_areas(name: str, points: FloatArray, triangles: IntArray) -> None:
    """Every triangle needs a normal."""
    corners = points[triangles]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    twice_area = np.linalg.norm(area_vectors(points, triangles), axis=1) * 2
    flat = np.flatnonzero(twice_area <= SLIVER * longest**2)
    if flat.size:
        raise BadMesh(
            f"{name}: triangle(s) {listing(flat)} are degenerate (no area); remove them, or merge "
            "points that coincide"
        )


def _check_edges(name: str, triangles: IntArray, sheet: bool) -> None:
    """No edge of three triangles, none that its two triangles run along in the same sense."""
    edges, count, forward = edge_table(triangles)
    owner = np.repeat(np.arange(len(triangles)), 3)
    crowded = np.unique(owner[count[edges] > 2])
    if crowded.size:
        raise BadMesh(
            f"{name} is not a surface: more than two triangles meet at an edge of triangle(s) "
            f"{listing(crowded)}"
        )
    senses = np.bincount(edges, np.where(forward, 1, -1))
    torn = np.unique(owner[(count[edges] == 2) & (senses[edges] != 0)])
    if torn.size:
        raise BadMesh(
            f"{name}: triangle(s) {listing(torn)} and a neighbour point to different sides; number "
            "the points of all triangles counter-clockwise as seen from the same side"
        )
    border = int((count == 1).sum())
    if border and not sheet:
        raise BadMesh(
            f"{name} is open: it has {border} border edge(s). Pass sheet=True if it is an open "
            "sheet whose normals point to the free side, or close it (if its triangles do not "
            "share their points, as in an STL file, merge the points that coincide)"
        )


def edge_table(triangles: IntArray) -> tuple[IntArray, IntArray, BoolArray]:
    """Edges of triangles.

    Parameters
    ----------
    triangles : ndarray, shape (t, 3).

    Returns
    -------
    edges : ndarray, shape (3 t,) -- number of the edge from corner 0 to 1, 1 to 2, 2 to 0.
    count : ndarray, shape (e,) -- how many triangles have the edge.
    forward : ndarray of bool, shape (3 t,) -- whether it runs from the lower number to the higher.
    """
    pairs = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1).reshape(-1, 2)
    key = pairs.min(axis=1) * (int(triangles.max()) + 1) + pairs.max(axis=1)
    _, edges, count = np.unique(key, return_inverse=True, return_counts=True)
    return edges.ravel(), count, pairs[:, 0] < pairs[:, 1]


def area_vectors(points: FloatArray, triangles: IntArray) -> FloatArray:
    """Return the normals of triangles times their areas, shape (t, 3), m2."""
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    return 0.5 * np.cross(b - a, c - a)


def volume(points: FloatArray, triangles: IntArray) -> float:
    """Volume inside a closed surface, m3; > 0 if its triangles point outward."""
    middle = points[triangles].mean(axis=1) - points[triangles].mean(axis=(0, 1))
    return float((middle * area_vectors(points, triangles)).sum() / 3)


def feature_normals(points: FloatArray, triangles: IntArray) -> tuple[FloatArray, BoolArray]:
    """Return unit normals that tell the side of a point from its nearest point of the surface.

    The normal at a corner is the mean of its triangles', weighted by their angles; the difference
    of point and nearest point has a positive product with it on the outer side: J. A. Baerentzen,
    H. Aanaes, IEEE Trans. Vis. Comput. Graph. 11 (2005) 243-253.

    Returns
    -------
    normals : ndarray, shape (t, 7, 3) -- at corners 0, 1, 2, at edges 01, 12, 20, inside.
    rim : ndarray of bool, shape (t, 7) -- whether corner or edge lies on the border of a sheet.
    """
    areas = area_vectors(points, triangles)
    faces = areas / np.linalg.norm(areas, axis=1, keepdims=True)
    edges, count, _ = edge_table(triangles)
    at_edge = np.zeros((len(count), 3))
    np.add.at(at_edge, edges, np.repeat(faces, 3, axis=0))
    at_point = np.zeros_like(points)
    weighted = faces[:, None] * _angles(points, triangles)[:, :, None]
    np.add.at(at_point, triangles.ravel(), weighted.reshape(-1, 3))
    normals = np.concatenate(
        [at_point[triangles], at_edge[edges].reshape(-1, 3, 3), faces[:, None]], axis=1
    )
    normals /= np.maximum(np.linalg.norm(normals, axis=2, keepdims=True), 1e-30)
    border = (count[edges] == 1).reshape(-1, 3)
    at_border = np.zeros(len(points), dtype=bool)
    at_border[triangles[border]] = True
    at_border[np.roll(triangles, -1, axis=1)[border]] = True
    inner = np.zeros((len(triangles), 1), dtype=bool)
    return normals, np.concatenate([at_border[triangles], border, inner], axis=1)


def _angles(points: FloatArray, triangles: IntArray) -> FloatArray:
    """Angles at the corners, shape (t, 3), rad."""
    corners = points[triangles]
    first = np.roll(corners, -1, axis=1) - corners
    second = np.roll(corners, 1, axis=1) - corners
    across = np.linalg.norm(np.cross(first, second), axis=2)
    return np.arctan2(across, (first * second).sum(axis=2))


def typical_edge(points: FloatArray, triangles: IntArray) -> float:
    """Median length of the edges, m."""
    corners = points[triangles]
    return float(np.median(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)))
