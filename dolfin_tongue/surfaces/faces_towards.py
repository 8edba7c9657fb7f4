"""The part of a body's surface that faces an obstacle."""

from __future__ import annotations

import numpy as np

from dolfin_tongue.base.arrays import IntArray
from dolfin_tongue.base.errors import BadScene, require_not_negative, require_positive
from dolfin_tongue.body.body import Body
from dolfin_tongue.body.faces import corners_of
from dolfin_tongue.surfaces.base import Surface, require_surface


def faces_towards(body: Body, obstacle: Surface, reach: float, overlap: float = 0.0) -> IntArray:
    """Outer faces of a body at rest that face an obstacle.

    A sheet such as a palate has a rim, and what comes up behind it counts as deep in the wall. A
    body that surrounds the rim touches with the faces that look at the free side only.

    Parameters
    ----------
    body : with its outer faces.
    obstacle : a rigid surface.
    reach : largest distance of their corners, m, > 0.
    overlap : how far corners may lie behind the obstacle, m, >= 0.

    Returns
    -------
    ndarray, shape (k, 4) -- for `Body.surfaces`: all corners within reach and overlap, the outward
    normal against that of the obstacle.

    Raises
    ------
    BadScene : no body, no surface, or no face that faces the obstacle.
    OutOfRange : a reach or overlap out of its range.
    """
    if not isinstance(body, Body):
        raise BadScene(f"faces_towards takes a body first, not {body!r}")
    require_surface("faces_towards: the obstacle", obstacle)
    require_positive(body, "m", reach=reach)
    require_not_negative(body, "m", overlap=overlap)
    faces = body.boundary
    corners = body.points[corners_of(faces)]
    gap = obstacle.gap(corners.reshape(-1, 3))
    distance = gap.distance.reshape(-1, 4)
    outward = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    against = (outward * gap.normal.reshape(-1, 4, 3).mean(axis=1)).sum(axis=1) < 0
    near = (distance >= -overlap) & (distance <= reach)
    found = faces[against & near.all(axis=1)]
    if not len(found):
        raise BadScene(
            f"no outer face of {body.name} looks at the obstacle within {reach:g} m; give a longer "
            "reach, or turn the obstacle round"
        )
    return found
