"""Element loops between nodes and quadrature points: F, nodal forces, element matrices."""

from __future__ import annotations

import numpy as np

from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.base.compiled import compiled


@compiled
def nodal_gradients(
    values: FloatArray, cells: IntArray, gradients: FloatArray, diagonal: float, out: FloatArray
) -> None:
    """Write diagonal * I + sum_K value^K (x) grad N_K (21), (22).

    Parameters
    ----------
    values : shape (n, 3) -- displacement (diagonal 1 gives F) or velocity (diagonal 0: its rate).
    cells : shape (m, k).
    gradients : shape (m, q, k, 3), 1/m.
    diagonal : 1 or 0.
    out : shape (m, q, 3, 3).
    """
    count = cells.shape[1]
    local = np.empty((count, 3))
    for cell in range(cells.shape[0]):
        for node in range(count):
            for i in range(3):
                local[node, i] = values[cells[cell, node], i]
        for q in range(gradients.shape[1]):
            for i in range(3):
                x, y, z = 0.0, 0.0, 0.0
                for node in range(count):
                    value = local[node, i]
                    x += value * gradients[cell, q, node, 0]
                    y += value * gradients[cell, q, node, 1]
                    z += value * gradients[cell, q, node, 2]
                out[cell, q, i, 0], out[cell, q, i, 1], out[cell, q, i, 2] = x, y, z
                out[cell, q, i, i] += diagonal


@compiled
def add_nodal_forces(
    stress: FloatArray, cells: IntArray, gradients: FloatArray, weights: FloatArray, out: FloatArray
) -> None:
    """Add minus the inner forces, -int P_iJ N_K,J (39), to out, shape (n, 3), N.

    Parameters
    ----------
    stress : first Piola-Kirchhoff stress P, shape (m, q, 3, 3), Pa.
    cells : shape (m, k).
    gradients : shape (m, q, k, 3), 1/m.
    weights : shape (m, q), m3.
    out : shape (n, 3), N.
    """
    for cell in range(cells.shape[0]):
        for node in range(cells.shape[1]):
            for i in range(3):
                force = 0.0
                for q in range(weights.shape[1]):
                    part = 0.0
                    for j in range(3):
                        part += stress[cell, q, i, j] * gradients[cell, q, node, j]
                    force += weights[cell, q] * part
                out[cells[cell, node], i] -= force


@compiled
def add_element_matrices(
    moduli: FloatArray, gradients: FloatArray, weights: FloatArray, out: FloatArray
) -> None:
    """Add int N_K,J A_iJkL N_L,L to element matrices.

    Parameters
    ----------
    moduli : A = dP/dF (or by its rate), shape (m, q, 9, 9): rows iJ, columns kL.
    gradients : shape (m, q, k, 3), 1/m.
    weights : shape (m, q), m3.
    out : shape (m, 3k, 3k) -- dofs ordered by component, then node.
    """
    count = gradients.shape[2]
    half = np.empty((9, 3 * count))
    for cell in range(weights.shape[0]):
        for q in range(weights.shape[1]):
            weight = weights[cell, q]
            for row in range(9):
                for k in range(3):
                    a0 = weight * moduli[cell, q, row, 3 * k]
                    a1 = weight * moduli[cell, q, row, 3 * k + 1]
                    a2 = weight * moduli[cell, q, row, 3 * k + 2]
                    for node in range(count):
                        half[row, k * count + node] = (
                            a0 * gradients[cell, q, node, 0]
                            + a1 * gradients[cell, q, node, 1]
                            + a2 * gradients[cell, q, node, 2]
                        )
            for i in range(3):
                for node in range(count):
                    g0 = gradients[cell, q, node, 0]
                    g1 = gradients[cell, q, node, 1]
                    g2 = gradients[cell, q, node, 2]
                    row = i * count + node
                    for column in range(3 * count):
                        out[cell, row, column] += (
                            g0 * half[3 * i, column]
                            + g1 * half[3 * i + 1, column]
                            + g2 * half[3 * i + 2, column]
                        )


@compiled
def scatter_dense(matrices: FloatArray, dofs: IntArray, out: FloatArray) -> None:
    """Add element matrices (m, d, d) to a dense matrix; dofs (m, d), -1 where held."""
    for cell in range(dofs.shape[0]):
        for a in range(dofs.shape[1]):
            row = dofs[cell, a]
            if row < 0:
                continue
            for b in range(dofs.shape[1]):
                column = dofs[cell, b]
                if column >= 0:
                    out[row, column] += matrices[cell, a, b]


@compiled
def scatter_sparse(matrices: FloatArray, places: IntArray, out: FloatArray) -> None:
    """Add element matrices (m, d, d) to the values of a sparse matrix; places (m, d, d) or -1."""
    for cell in range(places.shape[0]):
        for a in range(places.shape[1]):
            for b in range(places.shape[2]):
                place = places[cell, a, b]
                if place >= 0:
                    out[place] += matrices[cell, a, b]


@compiled
def scatter_gradients(
    gradients: FloatArray, cells: IntArray, dofs: IntArray, out: FloatArray
) -> None:
    """Write dA/dU (m, k, 3) into rows of a dense matrix (m, d); dofs (n, 3), -1 where held."""
    for cell in range(cells.shape[0]):
        for node in range(cells.shape[1]):
            for i in range(3):
                column = dofs[cells[cell, node], i]
                if column >= 0:
                    out[cell, column] += gradients[cell, node, i]
