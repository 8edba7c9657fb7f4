"""Derivatives of functions of a place by central differences of fourth order.

With features of size L and step h the gradient is exact to (h/L)^4 / 30 + 1e-16 L/h, the Hessian
to (h/L)^4 / 90 + 1e-16 (L/h)^2, relative to 1 and 1/L: with L = 20 mm and h = 0.1 mm to 2e-11 and
1e-11 or so.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dolfin_tongue.base.arrays import FloatArray

Function = Callable[[FloatArray], FloatArray]

#: Weights of f(x + h) - f(x - h) and f(x + 2h) - f(x - 2h) in the first derivative, times 1/h; of
#: the sums, less 2 f(x), in the second, times 1/h^2.
FIRST, SECOND = (8 / 12, -1 / 12), (16 / 12, -1 / 12)


def first_derivatives(function: Function, points: FloatArray, step: float) -> FloatArray:
    """Return df_.../dx_j: the shape of f's values with a last axis of 3.

    Parameters
    ----------
    function : of points (k, 3); values of shape (k, ...).
    points : ndarray, shape (k, 3), m.
    step : h, m.
    """
    columns = []
    for move in step * np.eye(3):
        parts = [
            weight * (function(points + i * move) - function(points - i * move))
            for i, weight in enumerate(FIRST, 1)
        ]
        columns.append(sum(parts) / step)
    return np.stack(columns, axis=-1)


def second_derivatives(function: Function, points: FloatArray, step: float) -> FloatArray:
    """Return d2f/dx_i dx_j of a function with values (k,), shape (k, 3, 3).

    From second differences along the axes and the diagonals: f_ij = (f_(i+j) - f_(i-j)) / 4.
    """
    axes = np.eye(3)
    middle = function(points)

    def along(direction: FloatArray) -> FloatArray:
        move = step * direction
        parts = [
            weight * (function(points + i * move) + function(points - i * move) - 2 * middle)
            for i, weight in enumerate(SECOND, 1)
        ]
        return np.sum(parts, axis=0) / step**2

    hessian = np.empty((len(points), 3, 3))
    for i in range(3):
        hessian[:, i, i] = along(axes[i])
        for j in range(i):
            mixed = along(axes[i] + axes[j]) - along(axes[i] - axes[j])
            hessian[:, i, j] = hessian[:, j, i] = mixed / 4
    return hessian
