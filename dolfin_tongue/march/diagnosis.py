"""What to say when convergence is lost: where it happened, and what may help."""

from __future__ import annotations

import numpy as np

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.base.errors import listing
from dolfin_tongue.body.body import Body
from dolfin_tongue.body.shape import VERY_LONG, largest_stretches, volume_ratios


def where_and_why(body: Body, displacement: FloatArray) -> str:
    """Name the most distorted cells of the last accepted state and what may help."""
    ratios = volume_ratios(body.points, displacement, body.cells).min(axis=1)
    worst = np.argsort(ratios)[:5]
    cells = listing(f"{cell} (smallest det F {ratios[cell]:.3f})" for cell in worst)
    stretch = largest_stretches(body.points, displacement, body.cells)
    longest = int(stretch.argmax())
    if ratios.min() < 0.3:
        cause = "cells are close to inversion: lower the activation or refine the mesh there"
    elif stretch[longest] > VERY_LONG:
        cause = (
            f"cell {longest} is stretched {stretch[longest]:.2f} times, where stiffening tissue "
            "is steep and may overflow: lower the load or take a smaller dt"
        )
    else:
        cause = (
            "no cell is near inversion: try a smaller dt, a slower ramp of the activations or some "
            "Viscosity"
        )
    return f"Most distorted cells at the last accepted state: {cells}; {cause}"
