"""The trivariate Bezier solid of the report, section 5.1: a unit cube, bent by control points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import comb

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.base.errors import BadMesh


def bernstein(degree: int, t: FloatArray) -> FloatArray:
    """Bernstein polynomials B_i^n(t) = C(n, i) t^i (1 - t)^(n - i), report (63).

    Parameters
    ----------
    degree : n >= 0.
    t : ndarray, shape (k,), in [0, 1].

    Returns
    -------
    ndarray, shape (k, n + 1) -- rows sum to 1.
    """
    i = np.arange(degree + 1)
    t = np.asarray(t, dtype=float)[:, None]
    return comb(degree, i) * t**i * (1.0 - t) ** (degree - i)


@dataclass(frozen=True)
class BezierSolid:
    """Map of the unit cube (r, s, t) to space by Bernstein polynomials, report (63)-(66).

    Parameters
    ----------
    control_points : ndarray, shape (l + 1, m + 1, n + 1, 3), m -- b_ijk; degrees l, m, n >= 1.

    Raises
    ------
    BadMesh : a wrong shape, or coordinates that are not finite.
    """

    control_points: FloatArray

    def __post_init__(self) -> None:
        shape = np.shape(self.control_points)
        if len(shape) != 4 or shape[3] != 3 or min(shape[:3]) < 2:
            raise BadMesh(
                "control points must have shape (l + 1, m + 1, n + 1, 3) with degrees l, m, n "
                f">= 1, not {shape}"
            )
        if not np.isfinite(self.control_points).all():
            raise BadMesh("a control point has coordinates that are not finite")

    def map(self, rst: FloatArray) -> FloatArray:
        """Points of the solid, report (64) and (65): b = sum_ijk b_ijk B_i(r) B_j(s) B_k(t).

        Parameters
        ----------
        rst : ndarray, shape (k, 3), in [0, 1].

        Returns
        -------
        ndarray, shape (k, 3), m.
        """
        return _combine(np.asarray(self.control_points, dtype=float), rst)

    def jacobian(self, rst: FloatArray) -> FloatArray:
        """Tangent vectors of the solid, report (66).

        The derivative along r is a solid of degree l - 1 with control points
        l (b_(i+1)jk - b_ijk); the report prints this difference with the opposite sign.

        Parameters
        ----------
        rst : ndarray, shape (k, 3), in [0, 1].

        Returns
        -------
        ndarray, shape (k, 3, 3), m -- entry [q, a, b] is d(point a)/d(rst b).
        """
        points = np.asarray(self.control_points, dtype=float)
        columns = [
            _combine((points.shape[axis] - 1) * np.diff(points, axis=axis), rst)
            for axis in range(3)
        ]
        return np.stack(columns, axis=-1)

    def push_forward(self, rst: FloatArray, directions: FloatArray) -> FloatArray:
        """Carry directions of the block to unit directions of the solid by the Jacobian.

        Parameters
        ----------
        rst : ndarray, shape (k, 3) -- where.
        directions : ndarray, shape (k, 3) -- components along r, s and t; any length > 0.

        Returns
        -------
        ndarray, shape (k, 3) -- unit vectors.

        Raises
        ------
        BadMesh : a direction that the map sends to zero.
        """
        vectors = np.einsum("qab,qb->qa", self.jacobian(rst), directions)
        length = np.linalg.norm(vectors, axis=1, keepdims=True)
        if not (length > 0).all():
            raise BadMesh("a fibre direction in the block is zero")
        return vectors / length


def _combine(points: FloatArray, rst: FloatArray) -> FloatArray:
    """Sum of control points times the product basis (64) at rst, shape (k, 3)."""
    factors = [bernstein(points.shape[axis] - 1, rst[:, axis]) for axis in range(3)]
    return np.einsum("qi,qj,qk,ijka->qa", *factors, points, optimize=True)
