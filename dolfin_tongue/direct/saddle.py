"""Linear systems [A -G^T; G 0] of the implicit method: dense LU when small, sparse when large.

Milliseconds on one core for a factorisation and a solve, the report's tongue refined (dense by
LAPACK on OpenBLAS, sparse by SuperLU with COLAMD, its best ordering here by far):

    unknowns   dense          sparse
      270       0.6   0.02      1.4   0.03
      552       4.5   0.13      3.4   0.11
     1005      22     0.32     11     0.23
     5472       -      -      284     4.9
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp
from scipy.linalg import lapack
from scipy.sparse.linalg import splu

from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.direct import points
from dolfin_tongue.direct.model import Model
from dolfin_tongue.direct.multipliers import dense_gradient

#: Unknowns up to which the matrix is dense.
DENSE_SIZE = 400

#: Maps the right-hand sides (momentum of free components, constraints) to (velocity, multipliers),
#: of shapes (3f,) and (c,), or (3f, k) and (c, k).
SaddleSolver = Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]


class Saddle:
    """Assembles and factors [A -G^T; G 0] from element matrices and volume gradients.

    Parameters
    ----------
    model : gives the numbering and the pattern.
    """

    def __init__(self, model: Model):
        self.model = model
        self.free, self.cells = 3 * len(model.numbering.free), model.constraints.count
        self.dense = self.free + self.cells <= DENSE_SIZE
        if not self.dense:
            self._build_pattern()

    def factor(self, matrices: list[FloatArray], gradients: list[FloatArray]) -> SaddleSolver:
        """Factor the matrix of these element matrices (m, 3k, 3k) and gradients (m, k, 3)."""
        factor = self._dense if self.dense else self._sparse
        solve = factor(matrices, gradients)

        def parts(momentum: FloatArray, volume: FloatArray) -> tuple[FloatArray, FloatArray]:
            solution = solve(np.concatenate([momentum, volume]))
            return solution[: self.free], solution[self.free :]

        return parts

    def _dense(
        self, matrices: list[FloatArray], gradients: list[FloatArray]
    ) -> Callable[[FloatArray], FloatArray]:
        size, free = self.free + self.cells, self.free
        matrix = np.zeros((size, size))
        for dofs, part in zip(self.model.numbering.part_dofs, matrices, strict=True):
            points.scatter_dense(part, dofs, matrix)
        G = dense_gradient(self.model, gradients)
        matrix[free:, :free] = G
        matrix[:free, free:] = -G.T
        # The transpose of a C-ordered array is what LAPACK can overwrite; solve with it transposed.
        factors, pivots, _ = lapack.dgetrf(matrix.T, overwrite_a=True)
        return lambda rhs: lapack.dgetrs(factors, pivots, rhs, trans=1)[0]

    def _sparse(
        self, matrices: list[FloatArray], gradients: list[FloatArray]
    ) -> Callable[[FloatArray], FloatArray]:
        values = np.zeros(self._pattern.nnz)
        for places, part in zip(self._places, matrices, strict=True):
            points.scatter_sparse(part, places, values)
        for (lower, upper), gradient in zip(self._gradient_places, gradients, strict=True):
            keep = lower >= 0
            values[lower[keep]] = gradient[keep]
            values[upper[keep]] = -gradient[keep]
        matrix = sp.csc_array(
            (values, self._pattern.indices, self._pattern.indptr), shape=self._pattern.shape
        )
        return splu(matrix).solve

    def _build_pattern(self) -> None:
        """Sparsity, and the place of every entry of the element matrices in it."""
        pairs = [_pairs(dofs, dofs) for dofs in self.model.numbering.part_dofs]
        gradient_pairs = []
        for block in self.model.constraints.parts:
            dofs = self.model.numbering.dofs[block.cells]  # (m, k, 3), like the gradients
            number = np.arange(block.numbers.start, block.numbers.stop) + self.free
            row = np.broadcast_to(number[:, None, None], dofs.shape)
            gradient_pairs.append((np.where(dofs >= 0, row, -1), dofs))
        every = [*pairs, *gradient_pairs, *[(b, a) for a, b in gradient_pairs]]
        row, column = (np.concatenate([pair[i].ravel() for pair in every]) for i in (0, 1))
        keep = (row >= 0) & (column >= 0)
        size = self.free + self.cells
        ones = np.ones(int(keep.sum()))
        self._pattern = sp.coo_array((ones, (row[keep], column[keep])), (size, size)).tocsc()
        self._pattern.sort_indices()
        columns = np.repeat(np.arange(size), np.diff(self._pattern.indptr))
        key = columns * size + self._pattern.indices
        self._places = [_places(pair, key, size) for pair in pairs]
        self._gradient_places = [
            (_places((a, b), key, size), _places((b, a), key, size)) for a, b in gradient_pairs
        ]


def _pairs(rows: IntArray, columns: IntArray) -> tuple[IntArray, IntArray]:
    """Row and column of every entry of element matrices, shape (m, d, d)."""
    shape = (*rows.shape, columns.shape[1])
    return np.broadcast_to(rows[:, :, None], shape), np.broadcast_to(columns[:, None], shape)


def _places(pair: tuple[IntArray, IntArray], key: IntArray, size: int) -> IntArray:
    """Index into the values of the pattern, -1 for held components."""
    row, column = pair
    place = np.searchsorted(key, column * size + row)
    return np.where((row >= 0) & (column >= 0), place, -1)
