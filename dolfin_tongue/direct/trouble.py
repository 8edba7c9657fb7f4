"""What to say when a motion is lost: when, where and why."""

from __future__ import annotations

import numpy as np

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.base.errors import NotConverged, listing
from dolfin_tongue.body.shape import VERY_LONG
from dolfin_tongue.direct.model import Model
from dolfin_tongue.march.state import State


def local_volume_ratios(model: Model, displacement: FloatArray) -> FloatArray:
    """Smallest det F at the quadrature points of every cell, shape (m,)."""
    ratio = np.empty(model.cell_count)
    for block, (F, _) in zip(
        model.blocks, model.strains(displacement, np.zeros_like(displacement)), strict=True
    ):
        ratio[block.numbers] = np.linalg.det(F).min(axis=1)
    return ratio


def largest_stretches(model: Model, displacement: FloatArray) -> FloatArray:
    """Largest principal stretch at the quadrature points of every cell, shape (m,)."""
    stretch = np.empty(model.cell_count)
    for block, (F, _) in zip(
        model.blocks, model.strains(displacement, np.zeros_like(displacement)), strict=True
    ):
        stretch[block.numbers] = np.linalg.norm(F, ord=2, axis=(-2, -1)).max(axis=1)
    return stretch


def lost(model: Model, state: State, dt: float, cause: str) -> NotConverged:
    """Error of a motion that is lost after an accepted state, with its most distorted cells."""
    ratio = local_volume_ratios(model, state.displacement)
    worst = np.argsort(ratio)[:5]
    cells = listing(f"{cell} (smallest det F {ratio[cell]:.3f})" for cell in worst)
    stretch = largest_stretches(model, state.displacement)
    if ratio.min() < 0.3:
        cause += "; cells are close to inversion: lower the activation or refine the mesh there"
    elif stretch.max() > VERY_LONG:
        cause += (
            f"; cell {stretch.argmax()} is stretched {stretch.max():.2f} times, where stiffening "
            "tissue is steep and may overflow: lower the load or take a smaller dt"
        )
    return NotConverged(
        f"the motion is lost in a step of {dt:.3g} s",
        state.time,
        f"Cause: {cause}. Most distorted cells at the last accepted state: {cells}",
    )
