"""Volumes of elements with gradient (96) and Hessian (101) from the kappa coefficients.

All sums are taken with positions relative to the first node of the element. kappa does not see a
common shift (the shape functions add up to 1), but round-off does.
"""

from __future__ import annotations

import numpy as np

from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.base.compiled import compiled
from dolfin_tongue.body.cells import CellKind


@compiled
def volume_gradients(
    x: FloatArray, cells: IntArray, triples: IntArray, kappa: FloatArray, out: FloatArray
) -> None:
    """Write dA/dx of every element (96) into out, shape (m, k, 3), m2; x has shape (n, 3)."""
    local = np.empty((cells.shape[1], 3))
    for cell in range(cells.shape[0]):
        for node in range(cells.shape[1]):
            for i in range(3):
                local[node, i] = x[cells[cell, node], i] - x[cells[cell, 0], i]
                out[cell, node, i] = 0.0
        for t in range(len(kappa)):
            a, b, c = triples[t, 0], triples[t, 1], triples[t, 2]
            value = kappa[t]
            out[cell, c, 0] += value * (local[a, 1] * local[b, 2] - local[a, 2] * local[b, 1])
            out[cell, c, 1] += value * (local[a, 2] * local[b, 0] - local[a, 0] * local[b, 2])
            out[cell, c, 2] += value * (local[a, 0] * local[b, 1] - local[a, 1] * local[b, 0])


@compiled
def volumes(x: FloatArray, cells: IntArray, gradients: FloatArray, out: FloatArray) -> None:
    """Write the volumes, shape (m,), m3: A = x . dA/dx / 3, since A is cubic in x."""
    for cell in range(cells.shape[0]):
        total = 0.0
        for node in range(cells.shape[1]):
            for i in range(3):
                position = x[cells[cell, node], i] - x[cells[cell, 0], i]
                total += position * gradients[cell, node, i]
        out[cell] = total / 3.0


@compiled
def volume_rates(v: FloatArray, cells: IntArray, gradients: FloatArray, out: FloatArray) -> None:
    """Write dA/dx . v, shape (m,), m3/s."""
    for cell in range(cells.shape[0]):
        total = 0.0
        for node in range(cells.shape[1]):
            for i in range(3):
                total += v[cells[cell, node], i] * gradients[cell, node, i]
        out[cell] = total


@compiled
def add_pressure_forces(
    pressure: FloatArray, cells: IntArray, gradients: FloatArray, out: FloatArray
) -> None:
    """Add p dA/dx of every element to nodal forces, shape (n, 3), N."""
    for cell in range(cells.shape[0]):
        for node in range(cells.shape[1]):
            for i in range(3):
                out[cells[cell, node], i] += pressure[cell] * gradients[cell, node, i]


@compiled
def volume_accelerations(
    x: FloatArray,
    v: FloatArray,
    cells: IntArray,
    triples: IntArray,
    kappa: FloatArray,
    out: FloatArray,
) -> None:
    """Write v.H v, the part of the second time derivative of A without acceleration, (m,), m3/s2.

    With (101): sum over K, N, M of kappa_KNM x^K . (v^N x v^M).
    """
    for cell in range(cells.shape[0]):
        total = 0.0
        for t in range(len(kappa)):
            # The triples hold each pair (a < b) once: the sign of kappa and of the vector product
            # change together, so that the other order adds the same again.
            a, b, c = cells[cell, triples[t, 0]], cells[cell, triples[t, 1]], triples[t, 2]
            k, first = cells[cell, c], cells[cell, 0]
            x0, x1, x2 = x[k, 0] - x[first, 0], x[k, 1] - x[first, 1], x[k, 2] - x[first, 2]
            part = x0 * (v[a, 1] * v[b, 2] - v[a, 2] * v[b, 1])
            part += x1 * (v[a, 2] * v[b, 0] - v[a, 0] * v[b, 2])
            part += x2 * (v[a, 0] * v[b, 1] - v[a, 1] * v[b, 0])
            total += 2.0 * kappa[t] * part
        out[cell] = total


@compiled
def add_volume_hessians(
    x: FloatArray,
    cells: IntArray,
    triples: IntArray,
    kappa: FloatArray,
    factor: FloatArray,
    out: FloatArray,
) -> None:
    """Add factor[m] times the Hessian (101) to element matrices, shape (m, 3k, 3k), m per unit.

    Rows and columns are ordered by component, then node: dof = component * k + node.
    """
    count = cells.shape[1]
    for cell in range(cells.shape[0]):
        if factor[cell] == 0.0:
            continue
        for t in range(len(kappa)):
            a, b, c = triples[t, 0], triples[t, 1], triples[t, 2]
            value = factor[cell] * kappa[t]
            for s in range(3):
                j, k = (s + 1) % 3, (s + 2) % 3
                # eps_jls x_s with (j, l) = (j, k): +, (k, j): -; kappa_cab = kappa_abc.
                part = value * (x[cells[cell, c], s] - x[cells[cell, 0], s])
                out[cell, j * count + a, k * count + b] += part
                out[cell, k * count + a, j * count + b] -= part
                out[cell, j * count + b, k * count + a] -= part
                out[cell, k * count + b, j * count + a] += part


def element_volume(kind: CellKind, corners: FloatArray) -> float:
    """Volume of one element, m3, from its node positions of shape (k, 3), m."""
    cells = np.arange(kind.node_count)[None]
    value = np.empty(1)
    volumes(corners, cells, element_gradient(kind, corners)[None], value)
    return float(value[0])


def element_gradient(kind: CellKind, corners: FloatArray) -> FloatArray:
    """Gradient (96) of the volume of one element, shape (k, 3), m2."""
    out = np.empty((1, *corners.shape))
    volume_gradients(corners, np.arange(kind.node_count)[None], *kind.triples, out)
    return out[0]


def element_hessian(kind: CellKind, corners: FloatArray) -> FloatArray:
    """Hessian (101) of the volume of one element, shape (k, 3, k, 3), m."""
    count = kind.node_count
    out = np.zeros((1, 3 * count, 3 * count))
    add_volume_hessians(corners, np.arange(count)[None], *kind.triples, np.ones(1), out)
    return out[0].reshape(3, count, 3, count).transpose(1, 0, 3, 2)
