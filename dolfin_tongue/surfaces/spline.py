"""Tricubic B-splines on a regular grid: a smooth function with its first and second derivatives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from dolfin_tongue.base.arrays import FloatArray, IntArray
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
    known: IntArray

    def evaluate(self, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Value (k,), gradient (k, 3) and Hessian (k, 3, 3); inf, 0, 0 where it is not known."""
        count = len(points)
        value, gradient = np.full(count, np.inf), np.zeros((count, 3))
        hessian = np.zeros((count, 3, 3))
        place = np.ascontiguousarray((points - self.origin) / self.spacing)
        _evaluate(place, self.spacing, self.coefficients, self.known, value, gradient, hessian)
        return value, gradient, hessian


def spline_through(
    origin: FloatArray, spacing: float, samples: FloatArray, known: IntArray
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
def _fill(share, weights):
    """Write the four cubic B-splines that are not zero at a place in a cell; two derivatives."""
    t, s = share, 1.0 - share
    weights[0, 0], weights[0, 3] = s * s * s / 6.0, t * t * t / 6.0
    weights[0, 1] = 2.0 / 3.0 - 0.5 * t * t * (2.0 - t)
    weights[0, 2] = 2.0 / 3.0 - 0.5 * s * s * (2.0 - s)
    weights[1, 0], weights[1, 3] = -0.5 * s * s, 0.5 * t * t
    weights[1, 1], weights[1, 2] = t * (1.5 * t - 2.0), -s * (1.5 * s - 2.0)
    weights[2, 0], weights[2, 1], weights[2, 2], weights[2, 3] = s, 3.0 * t - 2.0, 3.0 * s - 2.0, t


@compiled
def _evaluate(place, spacing, coefficients, known, value, gradient, hessian):
    """Sum the 64 B-splines around each place, which is in units of the spacing."""
    shape = known.shape
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
        f, fx, fy, fz = 0.0, 0.0, 0.0, 0.0
        fxx, fyy, fzz, fxy, fxz, fyz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for a in range(4):
            g, gy, gz, gyy, gzz, gyz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            for b in range(4):
                h, hz, hzz = 0.0, 0.0, 0.0
                for c in range(4):
                    coefficient = coefficients[i + a - 1, j + b - 1, k + c - 1]
                    h += z[0, c] * coefficient
                    hz += z[1, c] * coefficient
                    hzz += z[2, c] * coefficient
                g += y[0, b] * h
                gy += y[1, b] * h
                gyy += y[2, b] * h
                gz += y[0, b] * hz
                gyz += y[1, b] * hz
                gzz += y[0, b] * hzz
            f += x[0, a] * g
            fx += x[1, a] * g
            fxx += x[2, a] * g
            fy += x[0, a] * gy
            fxy += x[1, a] * gy
            fz += x[0, a] * gz
            fxz += x[1, a] * gz
            fyy += x[0, a] * gyy
            fyz += x[0, a] * gyz
            fzz += x[0, a] * gzz
        value[p] = f
        gradient[p, 0], gradient[p, 1], gradient[p, 2] = fx, fy, fz
        own = hessian[p]
        own[0, 0], own[1, 1], own[2, 2] = fxx, fyy, fzz
        own[0, 1], own[1, 0], own[0, 2], own[2, 0] = fxy, fxy, fxz, fxz
        own[1, 2], own[2, 1] = fyz, fyz
        for q in range(3):
            gradient[p, q] /= spacing
            for r in range(3):
                own[q, r] /= spacing * spacing
