"""Shape of the cells of a body, at rest and deformed: volumes, stretches, quality."""

from __future__ import annotations

import numpy as np

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.body.body import Body

#: Stretch beyond which stiffening tissue may be too steep for a time step, or overflow.
VERY_LONG = 1.6


def volume_changes(body: Body, displacement: FloatArray) -> FloatArray:
    """Relative volume change of every cell, shape (m,), from the node positions alone."""
    x = body.points + displacement
    volumes = [block.volumes_at_points(x).sum(axis=1) for block in body.blocks]
    return np.concatenate(volumes) / body.volumes - 1


def volume_ratios(body: Body, displacement: FloatArray) -> list[FloatArray]:
    """Det F at the quadrature points of all cells, per block of shape (m, q).

    A cell keeps its mean volume; what it leaves free inside shows what the mesh is worth.
    """
    x = body.points + displacement
    return [block.volumes_at_points(x) / block.weights for block in body.blocks]


def smallest_ratios(body: Body, displacement: FloatArray) -> FloatArray:
    """Smallest det F at the quadrature points of every cell, shape (m,)."""
    return np.concatenate([part.min(axis=1) for part in volume_ratios(body, displacement)])


def largest_stretches(body: Body, displacement: FloatArray) -> FloatArray:
    """Largest principal stretch at the quadrature points of every cell, shape (m,)."""
    parts = []
    for block in body.blocks:
        gradient = block.deformation_gradients(displacement)
        parts.append(np.linalg.norm(gradient, ord=2, axis=(-2, -1)).max(axis=1))
    return np.concatenate(parts)
