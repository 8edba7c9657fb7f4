"""Overlap of a body with a surface."""

from __future__ import annotations

import numpy as np

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.surfaces.base import Surface, require_places, require_surface


def overlap(surface: Surface, points: FloatArray) -> FloatArray:
    """How deep points are in the wall.

    Parameters
    ----------
    surface : any.
    points : ndarray, shape (k, 3), m.

    Returns
    -------
    ndarray, shape (k,), m -- 0 on the free side and where the surface does not reach.

    Raises
    ------
    BadScene : no surface.
    BadMesh : points of another shape, or not finite.
    """
    require_surface("overlap: the surface", surface)
    places = require_places("overlap: points", points)
    return np.maximum(-surface.gap(places).distance, 0.0)
