"""Tricubic B-splines on a regular grid: a smooth function with its first and second derivatives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from dolfin_tongue.base.arrays import BoolArray, FloatArray
from dolfin_tongue.base.compiled import compiled


@dataclass(frozen=True, eq=False)
class Spline:
    """The C2 function through samples on a grid, known in some of its cells.

    Parameters
    ----------
    origin : ndarray, shape (3,), m -- place of the first sample.
    spacing : m, the same along all axes.
    coefficients : ndarray, shape (nx, ny, nz) -- of the B-splines.
    known : ndarray of bool, shape (nx - 1, ny - 1, nz - 1) -- cells in which the function is known.
    """

    origin: FloatArray
    spacing: float
    coefficients: FloatArray
    known: BoolArray

    def evaluate(self, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Value (k,), gradient (k, 3) and Hessian (k, 3, 3); inf, 0, 0 where it is not known."""
        count = len(points)
        value, gradient = np.full(count, np.inf), np.zeros((count, 3))
        hessian = np.zeros((count, 3, 3))
        place = np.ascontiguousarray((points - self.origin) / self.spacing)
        _evaluate(place, self.spacing, self.coefficients, self.known, value, gradient, hessian)
        return value, gradient, hessian


def spline_through(
    origin: FloatArray, spacing: float, samples: FloatArray, known: BoolArray
) -> Spline:
    """Interpolate samples.

    Parameters
    ----------
    origin, spacing : see `Spline`.
    samples : ndarray, shape (nx, ny, nz).
    known : ndarray of bool, shape (nx, ny, nz) -- samples that mean something; the others only
        continue them. A cell of the spline is known if its eight samples are.
    """
    coefficients = np.ascontiguousarray(ndimage.spline_filter(samples, order=3, mode="mirror"))
    cells = known.copy()
    for axis in range(3):
        lower, upper = [slice(None)] * 3, [slice(None)] * 3
        lower[axis], upper[axis] = slice(None, -1), slice(1, None)
        cells = cells[tuple(lower)] & cells[tuple(upper)]
    for axis in range(3):  # four B-splines along each axis: none are left in the outermost cells
        np.moveaxis(cells, axis, 0)[[0, -1]] = False
    return Spline(origin, spacing, coefficients, cells)


@compiled
def _fill(share: float, weights: FloatArray) -> None:
    """Write the four cubic B-splines that are not zero at a place in a cell; two derivatives."""
    t, s = share, 1.0 - share
    weights[0, 0], weights[0, 3] = s * s * s / 6.0, t * t * t / 6.0
    weights[0, 1] = 2.0 / 3.0 - 0.5 * t * t * (2.0 - t)
    weights[0, 2] = 2.0 / 3.0 - 0.5 * s * s * (2.0 - s)
    weights[1, 0], weights[1, 3] = -0.5 * s * s, 0.5 * t * t
    weights[1, 1], weights[1, 2] = t * (1.5 * t - 2.0), -s * (1.5 * s - 2.0)
    weights[2, 0], weights[2, 1], weights[2, 2], weights[2, 3] = s, 3.0 * t - 2.0, 3.0 * s - 2.0, t


@compiled
def _sum(
    x: FloatArray, y: FloatArray, z: FloatArray, coefficients: FloatArray, out: FloatArray
) -> None:
    """Sum 64 B-splines: write f, f_x, f_y, f_z, f_xx, f_yy, f_zz, f_xy, f_xz, f_yz.

    Parameters
    ----------
    x, y, z : ndarray, shape (3, 4) -- the splines along each axis with two derivatives.
    coefficients : ndarray, shape (4, 4, 4).
    """
    out[:] = 0.0
    for a in range(4):
        g, gy, gz, gyy, gzz, gyz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for b in range(4):
            h, hz, hzz = 0.0, 0.0, 0.0
            for c in range(4):
                h += z[0, c] * coefficients[a, b, c]
                hz += z[1, c] * coefficients[a, b, c]
                hzz += z[2, c] * coefficients[a, b, c]
            g += y[0, b] * h
            gy += y[1, b] * h
            gyy += y[2, b] * h
            gz += y[0, b] * hz
            gyz += y[1, b] * hz
            gzz += y[0, b] * hzz
        out[0] += x[0, a] * g
        out[1] += x[1, a] * g
        out[2] += x[0, a] * gy
        out[3] += x[0, a] * gz
        out[4] += x[2, a] * g
        out[5] += x[0, a] * gyy
        out[6] += x[0, a] * gzz
        out[7] += x[1, a] * gy
        out[8] += x[1, a] * gz
        out[9] += x[0, a] * gyz


@compiled
def _evaluate(
    place: FloatArray,
    spacing: float,
    coefficients: FloatArray,
    known: BoolArray,
    value: FloatArray,
    gradient: FloatArray,
    hessian: FloatArray,
) -> None:
    """Evaluate the spline at each place, which is in units of the spacing."""
    shape, f = known.shape, np.empty(10)
    x, y, z = np.empty((3, 4)), np.empty((3, 4)), np.empty((3, 4))
    for p in range(len(place)):
        u, v, w = place[p, 0], place[p, 1], place[p, 2]
        if not (0.0 <= u < shape[0] and 0.0 <= v < shape[1] and 0.0 <= w < shape[2]):
            continue
        i, j, k = int(u), int(v), int(w)
        if not known[i, j, k]:
            continue
        _fill(u - i, x)
        _fill(v - j, y)
        _fill(w - k, z)
        _sum(x, y, z, coefficients[i - 1 : i + 3, j - 1 : j + 3, k - 1 : k + 3], f)
        value[p] = f[0]
        own = hessian[p]
        own[0, 1], own[1, 0], own[0, 2], own[2, 0] = f[7], f[7], f[8], f[8]
        own[1, 2], own[2, 1] = f[9], f[9]
        for q in range(3):
            gradient[p, q] = f[1 + q] / spacing
            own[q, q] = f[4 + q]
            for r in range(3):
                own[q, r] /= spacing * spacing
