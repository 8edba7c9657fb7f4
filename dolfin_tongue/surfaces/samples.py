"""Signed distance of a triangulated surface on a regular grid, in a band around it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from dolfin_tongue.base.arrays import BoolArray, FloatArray, IntArray
from dolfin_tongue.base.errors import OutOfRange
from dolfin_tongue.surfaces.nearest import Tree
from dolfin_tongue.surfaces.triangles import feature_normals

#: Samples beyond the band that are exact too, so that splines in the band see nothing else; and
#: how many smoothing lengths more.
MARGIN, WIDTHS = 5, 4

#: Samples along the edge of a block, of which one decides whether the others are needed.
BLOCK = 4

#: Most samples of a grid (8 bytes each, and as many again while it is built).
MOST_SAMPLES = 40_000_000


@dataclass(frozen=True, eq=False)
class Samples:
    """Distances on a grid.

    Parameters
    ----------
    origin : ndarray, shape (3,), m.
    spacing : m.
    distance : ndarray, shape (nx, ny, nz), m -- on the side of the normals > 0.
    known : ndarray of bool, shape (nx, ny, nz) -- within the band, and not beyond a rim.
    """

    origin: FloatArray
    spacing: float
    distance: FloatArray
    known: BoolArray

    @property
    def places(self) -> FloatArray:
        """Places of the samples, shape (nx ny nz, 3), m."""
        index = np.moveaxis(np.indices(self.distance.shape), 0, -1).reshape(-1, 3)
        return self.origin + self.spacing * index


def signed_distance(
    points: FloatArray, triangles: IntArray, tree: Tree, places: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """Exact signed distance of a triangulated surface.

    Where the nearest point lies on the rim of a sheet there is no side; there the sheet is
    continued along its tangents, and the distance is from that continuation.

    Returns
    -------
    distance : ndarray, shape (k,), m -- > 0 on the side to which the triangles' normals point.
    inner : ndarray of bool, shape (k,) -- whether the nearest point is not on a rim.
    """
    normals, rim = feature_normals(points, triangles)
    triangle, feature, nearest = tree.nearest(places)
    arm = places - nearest
    across = (arm * normals[triangle, feature]).sum(axis=1)
    on_rim = rim[triangle, feature]
    exact = np.copysign(np.linalg.norm(arm, axis=1), across)
    return np.where(on_rim, across, exact), ~on_rim


def sample(
    points: FloatArray,
    triangles: IntArray,
    tree: Tree,
    *,
    spacing: float,
    band: float,
    smoothing: float,
) -> Samples:
    """Sample the signed distance around a surface.

    Parameters
    ----------
    points, triangles : the surface.
    tree : of its triangles.
    spacing : of the samples, m.
    band : distance from the surface up to which it is wanted, m.
    smoothing : length over which the kinks between triangles are smoothed, m; 0 for none.

    Raises
    ------
    OutOfRange : a spacing so small that the samples would not fit into memory.
    """
    used = points[triangles].reshape(-1, 3)
    reach = band + MARGIN * spacing + WIDTHS * smoothing
    origin = used.min(axis=0) - reach
    blocks = np.ceil((np.ptp(used, axis=0) + 2 * reach) / (BLOCK * spacing)).astype(int)
    shape = BLOCK * blocks
    if shape.astype(float).prod() > MOST_SAMPLES:
        raise OutOfRange(
            "spacing", spacing, f"larger: the surface would need {shape.astype(float).prod():.2g} "
            f"samples, and the most are {MOST_SAMPLES:.2g}",
        )  # fmt: skip
    near = _needed(tree, origin, blocks, spacing, reach)
    index = np.argwhere(near)
    exact, inner = signed_distance(points, triangles, tree, origin + spacing * index)
    distance, known = np.zeros(shape), np.zeros(shape, dtype=bool)
    # The corners of every cell that has a point in the band must be known.
    within = np.abs(exact) <= band + np.sqrt(3.0) * spacing
    distance[near], known[near] = exact, inner & within
    # Elsewhere the nearest exact sample goes on: a jump would ring through the spline.
    _, (i, j, k) = ndimage.distance_transform_edt(~near, return_indices=True)
    return Samples(origin, spacing, _smooth(distance[i, j, k], smoothing / spacing), known)


def _smooth(distance: FloatArray, width: float) -> FloatArray:
    """Smooth by 2 G - G^2, where G is a Gaussian: G alone would shrink what is curved."""
    if width == 0:
        return distance
    once = ndimage.gaussian_filter(distance, width, mode="nearest", truncate=WIDTHS)
    return 2 * once - ndimage.gaussian_filter(once, width, mode="nearest", truncate=WIDTHS)


def _needed(
    tree: Tree, origin: FloatArray, blocks: IntArray, spacing: float, reach: float
) -> BoolArray:
    """Mark the samples of all blocks whose centres are near enough to hold some of the band."""
    index = np.moveaxis(np.indices(tuple(blocks)), 0, -1).reshape(-1, 3)
    centres = origin + spacing * (BLOCK * index + (BLOCK - 1) / 2)
    distance = np.linalg.norm(tree.nearest(centres)[2] - centres, axis=1)
    near = distance <= reach + np.sqrt(3.0) * spacing * (BLOCK - 1) / 2
    full = near.reshape(tuple(blocks))
    for axis in range(3):
        full = full.repeat(BLOCK, axis=axis)
    return full
