"""Fields to colour a body with, computed from a state."""

from __future__ import annotations

import numpy as np

from dolfin_tongue.body.body import Body
from dolfin_tongue.body.fibres import FloatArray
from dolfin_tongue.body.shape import shape_gradients

_CENTRE = np.zeros((1, 3))


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
    gradient = shape_gradients(_CENTRE)[0]
    reference = np.einsum("mki,kj->mij", body.points[body.cells], gradient)
    increment = np.einsum("mki,kj->mij", displacement[body.cells], gradient)
    return np.eye(3) + increment @ np.linalg.inv(reference)


def largest_stretch(body: Body, displacement: FloatArray) -> np.ndarray:
    """Largest principal stretch at the centres of the cells, shape (m,), dimensionless."""
    gradients = deformation_gradients(body, displacement)
    return np.linalg.svd(gradients, compute_uv=False)[:, 0]
