"""Mass of the elements and of the tissue (40)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.body.block import Block
from dolfin_tongue.body.body import Body
from dolfin_tongue.body.regions import on_cells


def element_masses(body: Body, block: Block, lumped: bool = False) -> FloatArray:
    """Mass matrices of the elements of a block, shape (m, k, k), kg.

    Parameters
    ----------
    body, block : the cells.
    lumped : the diagonal, scaled in each element to its mass (Hinton, Rock and Zienkiewicz 1976;
        positive for every kind of element), instead of the consistent mass (40).
    """
    density = on_cells("density", body.density, body).part(block.numbers).contiguous
    if density.shape[1] > 1 and block.kind.mass_rule is not block.kind.rule:
        # the points are those of another rule: means of the cells
        mean = (density * block.weights).sum(axis=1) / block.weights.sum(axis=1)
        density = mean[:, None]
    mass = block.kind.masses(block.points[block.cells], density)
    if lumped:
        diagonal = np.einsum("mkk->mk", mass)
        scale = mass.sum(axis=(1, 2)) / diagonal.sum(axis=1)
        mass = np.einsum("mk,kl->mkl", scale[:, None] * diagonal, np.eye(mass.shape[1]))
    return mass


def mass_matrix(body: Body, masses: Sequence[FloatArray], lumped: bool) -> sp.csr_array:
    """Mass matrix m_KL (40), the same for each component, shape (n, n), kg."""
    rows, columns, values = [], [], []
    for block, mass in zip(body.blocks, masses, strict=True):
        rows.append(np.repeat(block.cells, mass.shape[1], axis=1).ravel())
        columns.append(np.tile(block.cells, mass.shape[1]).ravel())
        values.append(mass.ravel())
    place = (np.concatenate(rows), np.concatenate(columns))
    count = len(body.points)
    matrix = sp.coo_array((np.concatenate(values), place), shape=(count, count)).tocsr()
    if lumped:
        matrix.eliminate_zeros()
    return matrix
