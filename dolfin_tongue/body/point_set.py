"""The quadrature points of a body, and means of values at them over cells and around nodes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from dolfin_tongue.base.arrays import FloatArray, IntArray, sums_at
from dolfin_tongue.body.body import Body


@dataclass(frozen=True, eq=False)
class PointSet:
    """Q quadrature points, cell after cell.

    Parameters
    ----------
    cells : ndarray, shape (Q,) -- the cell of each point.
    weights : ndarray, shape (Q,), m3 -- reference volume that it stands for.
    hats_of : returns the values of the nodes' shape functions there, sparse, shape (Q, n).
    """

    cells: IntArray
    weights: FloatArray
    hats_of: Callable[[], Any]

    @cached_property
    def hats(self) -> Any:
        """Sparse matrix, shape (Q, n): values at the points from values at the nodes."""
        return self.hats_of()

    @cached_property
    def volumes(self) -> FloatArray:
        """Reference volumes of the cells, shape (m,), m3."""
        return sums_at(self.cells, self.weights)

    def on_cells(self, values: FloatArray, points: IntArray | None = None) -> FloatArray:
        """Means over the cells, weighted with volume, shape (m, ...).

        Parameters
        ----------
        values : ndarray, shape (Q, ...).
        points : to which they belong, where these are not all; NaN in cells without any.
        """
        at = slice(None) if points is None else points
        cells, weights, count = self.cells[at], self.weights[at], len(self.volumes)
        flat = values.reshape(len(values), -1)
        sums = [sums_at(cells, weights * column, count) for column in flat.T]
        return _means(sums, sums_at(cells, weights, count), values.shape[1:])

    def on_nodes(self, values: FloatArray, points: IntArray | None = None) -> FloatArray:
        """Means around the nodes, weighted with volume and shape functions, shape (n, ...).

        Parameters
        ----------
        values, points : as for `on_cells`.
        """
        at = slice(None) if points is None else points
        hats, weights = self.hats[at], self.weights[at]
        flat = values.reshape(len(values), -1)
        sums = list((hats.T @ (weights[:, None] * flat)).T)
        return _means(sums, hats.T @ weights, values.shape[1:])


def _means(sums: list[FloatArray], weight: FloatArray, shape: tuple[int, ...]) -> FloatArray:
    with np.errstate(invalid="ignore", divide="ignore"):
        means = np.stack(sums, axis=1) / np.where(weight > 0, weight, np.nan)[:, None]
    return means.reshape(-1, *shape)


def points_of(body: Body) -> PointSet:
    """Return the quadrature points of the cells of a body."""
    cells = np.repeat(np.arange(body.cell_count), body.point_counts)
    weights = np.concatenate([block.weights.ravel() for block in body.blocks])
    return PointSet(cells, weights, lambda: _hats(body))


def _hats(body: Body) -> sp.csr_array:
    tables = []
    for block in body.blocks:
        shapes = block.kind.at_points[0]
        values = np.tile(shapes, (len(block.cells), 1))
        columns = np.repeat(block.cells, len(shapes), axis=0)
        rows = np.repeat(np.arange(len(values)), values.shape[1])
        size = (len(values), len(body.points))
        tables.append(sp.coo_array((values.ravel(), (rows, columns.ravel())), shape=size).tocsr())
    return sp.vstack(tables, format="csr")


def gradients_at_points(body: Body, values: FloatArray) -> FloatArray:
    """Gradients by X of vectors at the nodes, shape (Q, 3, 3): component, direction."""
    parts = [
        np.einsum("mki,mqkj->mqij", values[block.cells], block.gradients).reshape(-1, 3, 3)
        for block in body.blocks
    ]
    return np.concatenate(parts)
