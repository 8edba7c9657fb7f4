"""The report's preliminary tongue: 42 bricks in a Bezier solid with eight muscles (section 5).

Frame: x from front to back, y to the right (y > 0) and left (y < 0), z up; metres. In the block,
r runs from the root (r = 0, the base at the hyoid) to the tip (r = 1), s from the right side to
the left, t from the underside to the upper surface. Three elements across leave no nodes in the
midsagittal plane: lines and landmarks "in the middle" lie at s = 1/3, a sixth of the width to the
right of it, in every refinement. They are nodes of the 42 parents, hence the same material points.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.base.errors import BadMesh
from dolfin_tongue.base.units import mm
from dolfin_tongue.body.body import TISSUE_DENSITY, Body
from dolfin_tongue.geometry.bezier import BezierSolid
from dolfin_tongue.geometry.block import DIVISIONS, Box, UnitBlock, unit_block
from dolfin_tongue.geometry.muscles import block_fibres

#: Control points of the right half, mm. One block per control plane from root to tip (report,
#: fig. 12), its rows from the underside up: x, y, z near the middle, then x, y, z at the side.
_RIGHT_HALF = np.array(
    [
        [[[111, 6, 57], [114, 17, 59]],
         [[121, 7, 64], [122, 22, 66]],
         [[128, 7, 73], [127, 19, 74]]],
        [[[98, 5, 53], [102, 14, 56]],
         [[116, 7, 74], [117, 32, 77]],
         [[138, 7, 95], [132, 21, 92]]],
        [[[75, 4, 47], [79, 10, 51]],
         [[98, 7, 86], [100, 32, 88]],
         [[121, 8, 124], [117, 19, 116]]],
        [[[70, 4, 73], [74, 11, 76]],
         [[82, 7, 97], [84, 27, 98]],
         [[91, 8, 121], [90, 18, 113]]],
        [[[71, 4, 91], [74, 13, 92]],
         [[70, 6, 99], [74, 20, 100]],
         [[68, 7, 110], [72, 15, 104]]],
        [[[59, 4, 93], [62, 9.5, 94]],
         [[56, 4, 97], [60.5, 12, 97]],
         [[58, 4, 101], [61, 10, 100]]],
    ]
)  # fmt: skip

#: Named regions as boxes of the parents' node lattice (i along r, j along s, k along t). The first
#: three are the fixed nodes of the report's fig. 11.
REGIONS: Mapping[str, Sequence[Box]] = {
    "base": [((0, 0), (0, 3), (0, 2))],
    "genioglossus_origin": [((3, 4), (1, 2), (0, 0))],
    "styloglossus_insertion": [((1, 2), (0, 0), (2, 2)), ((1, 2), (3, 3), (2, 2))],
    "upper_surface": [((0, 7), (0, 3), (2, 2))],
    "lower_surface": [((0, 7), (0, 3), (0, 0))],
    "midsagittal": [((0, 7), (1, 1), (0, 2))],
    "dorsum": [((0, 7), (1, 1), (2, 2))],
}

#: Landmarks as nodes (i, j, k) of the parents' lattice.
LANDMARKS: Mapping[str, tuple[int, int, int]] = {
    "tip": (7, 1, 1),
    "blade": (6, 1, 2),
    "dorsum": (4, 1, 2),
    "back": (2, 1, 2),
    "root": (1, 1, 2),
    "body": (4, 1, 1),
    "underside": (6, 1, 0),
}


def default_control_points() -> FloatArray:
    """Control points of the preliminary tongue, symmetric about y = 0.

    Returns
    -------
    ndarray, shape (6, 4, 3, 3), m -- planes along the tongue, columns from right to left, rows from
    the underside up, coordinates.
    """
    inner, outer = _RIGHT_HALF[:, :, 0] * mm, _RIGHT_HALF[:, :, 1] * mm
    mirror = np.array([1.0, -1.0, 1.0])
    return np.stack([outer, inner, inner * mirror, outer * mirror], axis=1)


def preliminary_tongue(
    refinement: int | Sequence[int] = 1,
    density: float = TISSUE_DENSITY,
    control_points: FloatArray | None = None,
) -> Body:
    """Build the preliminary tongue.

    Parameters
    ----------
    refinement : cells per parent element along every axis, or one number per axis (r, s, t).
    density : mass density, kg/m3.
    control_points : ndarray, shape (6, m + 1, n + 1, 3), m -- another tongue in the same block;
        six control planes as in the report. Default: `default_control_points`.

    Returns
    -------
    Body
        Node sets ``base``, ``genioglossus_origin``, ``styloglossus_insertion`` (the report's fixed
        nodes), ``upper_surface``, ``lower_surface``, ``midsagittal`` (the sheet at s = 1/3),
        ``midsagittal_contour`` (its outline, ordered from the hyoid along the underside to
        the tip and back over the dorsum to the root) and ``dorsum`` (its upper line, from root to
        tip); the surface ``upper``, which faces the palate; landmarks ``tip, blade, dorsum,
        back, root, body, underside``; eight muscles.

    Raises
    ------
    OutOfRange : a refinement < 1, a density <= 0.
    BadMesh : control points of a wrong shape, or so placed that cells are inverted (listed).
    """
    control = default_control_points() if control_points is None else np.asarray(control_points)
    if control.ndim != 4 or control.shape[0] != 6:
        raise BadMesh(
            "the preliminary tongue has six control planes: control points must have shape "
            f"(6, m + 1, n + 1, 3), not {control.shape}"
        )
    solid = BezierSolid(control)
    block = unit_block(refinement, REGIONS)
    landmarks = {
        name: block.node_at([float(x) for x in np.divide(node, DIVISIONS)])
        for name, node in LANDMARKS.items()
    }
    regions = {**block.regions, "midsagittal_contour": _outline(block)}
    body = Body(
        points=solid.map(block.rst),
        cells=block.cells,
        node_sets=regions,
        landmarks=landmarks,
        density=density,
        name="preliminary_tongue",
    )
    # The shape is checked by now: fibre densities need volumes > 0.
    surfaces = {"upper": _faces_within(body, regions["upper_surface"])}
    return replace(body, fibres=block_fibres(block, solid), surfaces=surfaces)


def _faces_within(body: Body, nodes: IntArray) -> IntArray:
    """Outer faces whose corners are all among some nodes, shape (k, 4)."""
    return body.boundary[np.isin(body.boundary, nodes).all(axis=1)]


def _outline(block: UnitBlock) -> IntArray:
    """Outline of the midsagittal sheet: underside towards the tip, tip, dorsum towards the root."""
    sheet = block.regions["midsagittal"]
    r, _, t = block.rst[sheet].T
    under, front, upper = sheet[t == 0], sheet[(r == 1) & (t > 0) & (t < 1)], sheet[t == 1]
    return np.concatenate([under, front, upper[::-1]])
