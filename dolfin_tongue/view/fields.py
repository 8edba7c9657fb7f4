"""Fields to colour a body with, computed from a state."""

from __future__ import annotations

import numpy as np

from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.body.body import Body


def deformation_gradients(body: Body, displacement: FloatArray) -> FloatArray:
    """F = I + grad u at the centres of the cells (1).

    Parameters
    ----------
    body : the body.
    displacement : ndarray, shape (n, 3), m.

    Returns
    -------
    ndarray, shape (m, 3, 3).
    """
    parts = []
    for block in body.blocks:
        centre = block.kind.nodes.mean(axis=0)[None]
        reference, moved = (
            block.kind.jacobians(x[block.cells], centre)[:, 0]
            for x in (body.points, body.points + displacement)
        )
        parts.append(moved @ np.linalg.inv(reference))
    return np.concatenate(parts)


def largest_stretch(body: Body, displacement: FloatArray) -> FloatArray:
    """Largest principal stretch at the centres of the cells, shape (m,), dimensionless."""
    gradients = deformation_gradients(body, displacement)
    return np.linalg.svd(gradients, compute_uv=False)[:, 0]


def corner_means(body: Body, values: FloatArray) -> FloatArray:
    """Means over the corners of each cell of values at nodes, shape (n, k) -> (m, k)."""
    return np.concatenate([values[block.corners].mean(axis=1) for block in body.blocks])


def half_lengths(body: Body, cells: IntArray, directions: FloatArray) -> FloatArray:
    """Half the extent of cells along directions (k, 3): exact for bricks along their edges."""
    spread = np.zeros(body.cell_count)
    along = np.zeros((body.cell_count, 3))
    along[cells] = directions
    for block in body.blocks:
        heights = np.einsum("kai,ki->ka", body.points[block.corners], along[block.numbers])
        spread[block.numbers] = heights.std(axis=1)
    return spread[cells]
