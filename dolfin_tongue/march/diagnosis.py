"""What to say when convergence is lost: where it happened, and what may help."""

from __future__ import annotations

import numpy as np

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.base.errors import Diagnosis, listing
from dolfin_tongue.body.body import Body
from dolfin_tongue.body.shape import VERY_LONG, largest_stretches, smallest_ratios


def diagnosis(body: Body, displacement: FloatArray) -> Diagnosis:
    """Name the most distorted cells of the last accepted state and what may help."""
    ratios = smallest_ratios(body, displacement)
    worst = np.argsort(ratios)[:5]
    stretch = largest_stretches(body, displacement)
    longest = int(stretch.argmax())
    if ratios.min() < 0.3:
        advice = "cells are close to inversion: lower the activation or refine the mesh there"
    elif stretch[longest] > VERY_LONG:
        advice = (
            f"cell {longest} is stretched {stretch[longest]:.2f} times, where stiffening tissue "
            "is steep and may overflow: lower the load or take a smaller dt"
        )
    else:
        advice = (
            "no cell is near inversion: try a smaller dt, a slower ramp of the activations or some "
            "Viscosity"
        )
    cells = listing(f"{cell} (smallest det F {ratios[cell]:.3f})" for cell in worst)
    text = f"Most distorted cells at the last accepted state: {cells}; {advice}"
    return Diagnosis(text, tuple(map(int, worst)), float(ratios.min()), float(stretch[longest]))
