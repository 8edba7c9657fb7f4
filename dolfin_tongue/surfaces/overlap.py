"""Overlap of a body with a surface."""

from __future__ import annotations

import numpy as np

from dolfin_tongue.arrays import FloatArray
from dolfin_tongue.surfaces.base import Surface


def overlap(surface: Surface, points: FloatArray) -> FloatArray:
    """How deep points are in the wall.

    Parameters
    ----------
    surface : any.
    points : ndarray, shape (k, 3), m.

    Returns
    -------
    ndarray, shape (k,), m -- 0 on the free side and where the surface does not reach.
    """
    return np.maximum(-surface.gap(np.asarray(points, dtype=float)).distance, 0.0)
