"""Shape of trilinear hexahedra: Jacobians at Gauss points and corners, in plain NumPy."""

from __future__ import annotations

import numpy as np

from dolfin_tongue.base.arrays import FloatArray, IntArray

#: Corners of the master element [-1, 1]^3 in the usual brick order, shape (8, 3).
CORNERS = np.array(
    [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1],
     [-1, 1, 1]], dtype=float)  # fmt: skip

#: Quadrilateral faces of the brick, outward by the right-hand rule, shape (6, 4).
FACES = np.array(
    [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]])  # fmt: skip

#: Stretch beyond which stiffening tissue may be too steep for a time step, or overflow.
VERY_LONG = 1.6


def shape_gradients(xi: FloatArray) -> FloatArray:
    """Gradients of the 8 trilinear shape functions in the master element.

    Parameters
    ----------
    xi : ndarray, shape (q, 3), in [-1, 1] -- points of the master element.

    Returns
    -------
    ndarray, shape (q, 8, 3).
    """
    factor = 1.0 + CORNERS[None] * xi[:, None]
    gradient = np.empty((len(xi), 8, 3))
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        gradient[..., i] = CORNERS[:, i] * factor[..., j] * factor[..., k] / 8.0
    return gradient


def _jacobians(points: FloatArray, cells: IntArray, xi: FloatArray) -> FloatArray:
    """dX/dxi in all cells at the points xi, shape (m, q, 3, 3)."""
    corners = points[cells].swapaxes(1, 2)  # (m, 3, 8); one large product is fastest
    return np.tensordot(corners, shape_gradients(xi), axes=(2, 1)).swapaxes(1, 2)


def _determinants(matrices: FloatArray) -> FloatArray:
    """Take determinants of 3x3 matrices, shape (...); faster than a LAPACK call for each."""
    a, b, c = matrices[..., 0, :], matrices[..., 1, :], matrices[..., 2, :]
    return (
        a[..., 0] * (b[..., 1] * c[..., 2] - b[..., 2] * c[..., 1])
        + a[..., 1] * (b[..., 2] * c[..., 0] - b[..., 0] * c[..., 2])
        + a[..., 2] * (b[..., 0] * c[..., 1] - b[..., 1] * c[..., 0])
    )


_GAUSS = CORNERS / np.sqrt(3.0)


def gauss_jacobians(points: FloatArray, cells: IntArray) -> FloatArray:
    """Jacobian determinants times weight (1) at the 2x2x2 Gauss points.

    Their sum over the points is the exact volume of the cell, since the determinant of a trilinear
    map is at most quadratic in each coordinate.

    Parameters
    ----------
    points : ndarray, shape (n, 3), m.
    cells : ndarray, shape (m, 8).

    Returns
    -------
    ndarray, shape (m, 8), m3.
    """
    return _determinants(_jacobians(points, cells, _GAUSS))


def volume_ratios(points: FloatArray, displacement: FloatArray, cells: IntArray) -> FloatArray:
    """Det F at the 2x2x2 Gauss points of all cells, shape (m, 8).

    A cell keeps its mean volume; what it leaves free inside shows what the mesh is worth.
    """
    return gauss_jacobians(points + displacement, cells) / gauss_jacobians(points, cells)


def largest_stretches(points: FloatArray, displacement: FloatArray, cells: IntArray) -> FloatArray:
    """Largest principal stretch at the 2x2x2 Gauss points of every cell, shape (m,)."""
    deformed, reference = (_jacobians(x, cells, _GAUSS) for x in (points + displacement, points))
    gradient = deformed @ np.linalg.inv(reference)
    return np.linalg.norm(gradient, ord=2, axis=(-2, -1)).max(axis=1)


def corner_jacobians(points: FloatArray, cells: IntArray) -> FloatArray:
    """Scaled Jacobians at the corners: determinant over the product of the three edge lengths.

    Returns
    -------
    ndarray, shape (m, 8), dimensionless, 1 at a right-angled corner.
    """
    jacobian = _jacobians(points, cells, CORNERS)
    edges = np.linalg.norm(jacobian, axis=2).prod(axis=2)
    with np.errstate(invalid="ignore", divide="ignore"):
        return _determinants(jacobian) / edges
