"""What to say when convergence is lost: where it happened, and what may help."""

from __future__ import annotations

import numpy as np

from dolfin_tongue.body import Body
from dolfin_tongue.errors import listing
from dolfin_tongue.fibres import FloatArray
from dolfin_tongue.shape import gauss_jacobians


def local_volume_ratios(body: Body, displacement: FloatArray) -> FloatArray:
    """Det F at the 2x2x2 Gauss points of all cells, shape (m, 8)."""
    deformed = gauss_jacobians(body.points + displacement, body.cells)
    return deformed / gauss_jacobians(body.points, body.cells)


def where_and_why(body: Body, displacement: FloatArray) -> str:
    """Name the most distorted cells of the last accepted state and what may help."""
    ratios = local_volume_ratios(body, displacement).min(axis=1)
    worst = np.argsort(ratios)[:5]
    cells = listing(f"{cell} (smallest det F {ratios[cell]:.3f})" for cell in worst)
    if ratios.min() < 0.3:
        cause = "cells are close to inversion: lower the activation or refine the mesh there"
    else:
        cause = (
            "no cell is near inversion: try a smaller dt, a slower ramp of the activations or some "
            "Viscosity"
        )
    return f"Most distorted cells at the last accepted state: {cells}; {cause}"
