"""Rigid coordinates as a border of systems over the free nodes.

With nodal unknowns x, the unknown rates z of rigid coordinates add rows and columns,

    [B C] [x]   [f]                                               X = B^-1 C,
    [R E] [z] = [h],     z = S^-1 (h - R B^-1 f),   x = B^-1 f - X z,   S = E - R X.

B is what the solver has without rigid bodies, factored as it was. It is regular wherever a body
whose bodies stand still can be solved. S has one row for each unknown coordinate.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.linalg as la

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.direct.model import Model


class MassBorder:
    """Inverse mass of free nodes and rigid coordinates: B = M_ff, C = M_fa P, E = P^T M_aa P + I.

    P are the `Bodies.columns`. All that does not turn with the bodies is prepared here.

    Parameters
    ----------
    model : with rigid bodies.
    solve : B^-1 on arrays of shape (f, c).
    """

    def __init__(self, model: Model, solve: Callable[[FloatArray], FloatArray]):
        bodies = model.bodies
        mass, self._nodes = model.whole_mass, len(model.numbering.free)
        self._coupling = mass[bodies.rows][:, model.numbering.free]  # (k, f)
        self._spread = solve(self._coupling.T.toarray())  # (f, k)
        at_points = mass[bodies.rows][:, bodies.rows].toarray()
        self._reduced = at_points - self._coupling @ self._spread
        self._inertia = np.diag(bodies.inertia[bodies.unknown])

    def update_geometry(self, columns: FloatArray) -> None:
        """Take the position of the bodies from their `Bodies.columns`."""
        points, _, count = columns.shape
        self._columns = columns.reshape(-1, count)
        wide = columns.reshape(points, -1)
        self._X = (self._spread @ wide).reshape(-1, count)
        S = self._columns.T @ (self._reduced @ wide).reshape(-1, count) + self._inertia
        self._inverse = la.inv(S)

    @property
    def inverse(self) -> FloatArray:
        """S^-1: accelerations of the coordinates by forces on them, with free nodes following."""
        return self._inverse

    def complete(self, x: FloatArray, h: FloatArray) -> FloatArray:
        """Solution from x = B^-1 f, shape (3f,) or (3f, c), and h, shape (r,) or (r, c)."""
        shape = (len(self._columns), *x.shape[1:])
        drag = (self._coupling @ x.reshape(self._nodes, -1)).reshape(shape)
        z = self._inverse @ (h - self._columns.T @ drag)
        return np.concatenate([x - self._X @ z, z])


class Border:
    """Solver of a bordered saddle system.

    Parameters
    ----------
    base : solver over free components and constraints.
    C : momentum rows (3f, r) and constraint rows (c, r).
    R : momentum columns (r, 3f) and multiplier columns (r, c).
    E : shape (r, r).
    """

    def __init__(
        self,
        base: Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]],
        C: tuple[FloatArray, FloatArray],
        R: tuple[FloatArray, FloatArray],
        E: FloatArray,
    ):
        self._base, self._R = base, R
        self._X = base(*C)
        self._S = la.lu_factor(E - R[0] @ self._X[0] - R[1] @ self._X[1], check_finite=False)

    def __call__(self, momentum: FloatArray, volume: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Velocity of free components and coordinates, and multipliers."""
        free = len(self._X[0])
        x, y = self._base(momentum[:free], volume)
        h = momentum[free:] - self._R[0] @ x - self._R[1] @ y
        z = la.lu_solve(self._S, h, check_finite=False)
        return np.concatenate([x - self._X[0] @ z, z]), y - self._X[1] @ z


def condensed(
    model: Model, matrices: list[FloatArray], columns: FloatArray, rows: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Border of element matrices A: A_fa P, Q^T A_af, Q^T A_aa P; (3f, r), (r, 3f), (r, r).

    Parameters
    ----------
    model : with rigid bodies.
    matrices : element matrices (m, 3k, 3k).
    columns, rows : P and Q, see `Bodies.columns`.
    """
    count, free = columns.shape[2], 3 * len(model.numbering.free)
    C, R, E = np.zeros((free, count)), np.zeros((free, count)), np.zeros((count, count))
    fields = [_field(model, part) for part in (columns, rows)]
    for block, dofs, part, near in zip(
        model.body.blocks,
        model.numbering.part_dofs,
        matrices,
        model.numbering.near_bodies,
        strict=False,
    ):
        P, Q = (
            field[block.cells[near]].transpose(0, 2, 1, 3).reshape(len(near), part.shape[1], count)
            for field in fields
        )
        A = part[near]
        right, left = A @ P, A.transpose(0, 2, 1) @ Q
        keep = dofs[near] >= 0
        np.add.at(C, dofs[near][keep], right[keep])
        np.add.at(R, dofs[near][keep], left[keep])
        E += np.einsum("mai,maj->ij", Q, right)
    return C, R.T, E


def condensed_gradient(
    model: Model, gradients: list[FloatArray], columns: FloatArray
) -> FloatArray:
    """G_a P: constraints by the unknown coordinates, shape (c, r)."""
    field = _field(model, columns)
    out = np.zeros((model.constraints.count, columns.shape[2]))
    for block, gradient, near in zip(
        model.body.blocks, gradients, model.numbering.near_bodies, strict=False
    ):
        numbers = block.numbers.start + near
        out[numbers] = np.einsum("mki,mkir->mr", gradient[near], field[block.cells[near]])
    return out


def _field(model: Model, columns: FloatArray) -> FloatArray:
    """Columns spread over all rows, zero elsewhere."""
    field = np.zeros((*model.numbering.shape, columns.shape[2]))
    field[model.bodies.rows] = columns
    return field
