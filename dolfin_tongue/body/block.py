"""Cells of one kind in a body: what sums over cells and their quadrature points need."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.body.cells import KINDS, CellKind, determinants


@dataclass(frozen=True, eq=False)
class Block:
    """Cells of one kind.

    Parameters
    ----------
    kind : of the cells.
    cells : ndarray, shape (m, k) -- node numbers.
    numbers : their place among all cells of the body.
    points : ndarray, shape (n, 3), m -- reference positions of all nodes of the body.
    """

    kind: CellKind
    cells: IntArray
    numbers: slice
    points: FloatArray

    @property
    def shape(self) -> tuple[int, int]:
        """Number of cells and of quadrature points in each, (m, q)."""
        return len(self.cells), len(self.kind.rule.weights)

    @property
    def corners(self) -> IntArray:
        """Node numbers of the corners, shape (m, c)."""
        return self.cells[:, : self.kind.corner_count]

    @cached_property
    def _reference(self) -> tuple[FloatArray, FloatArray]:
        return self.kind.reference_gradients(self.points[self.cells])

    @property
    def gradients(self) -> FloatArray:
        """Gradients of the shape functions by X (19), shape (m, q, k, 3), 1/m."""
        return self._reference[0]

    @cached_property
    def weights(self) -> FloatArray:
        """Weights of the quadrature with det J, shape (m, q), m3."""
        return self.volumes_at_points(self.points)

    @property
    def places(self) -> FloatArray:
        """Reference positions of the quadrature points, shape (m, q, 3), m."""
        return np.einsum("qk,mki->mqi", self.kind.at_points[0], self.points[self.cells])

    def volumes_at_points(self, points: FloatArray) -> FloatArray:
        """Volumes that the quadrature points stand for, shape (m, q), m3; their sums are exact.

        Parameters
        ----------
        points : ndarray, shape (n, 3), m -- positions of the nodes, deformed or not.
        """
        return self.kind.rule.weights * determinants(self.kind.jacobians(points[self.cells]))

    def deformation_gradients(self, displacement: FloatArray) -> FloatArray:
        """F = I + grad u (1) at the quadrature points, shape (m, q, 3, 3)."""
        gradient = np.einsum("mki,mqkj->mqij", displacement[self.cells], self.gradients)
        return np.eye(3) + gradient

    @property
    def scaled_jacobians(self) -> FloatArray:
        """Corner Jacobians over the product of the edges, shape (m, c); 1 at right angles."""
        kind = self.kind
        jacobian = kind.jacobians(self.points[self.cells], kind.nodes[: kind.corner_count])
        edges = np.linalg.norm(jacobian, axis=2).prod(axis=2)
        with np.errstate(invalid="ignore", divide="ignore"):
            return determinants(jacobian) / edges


def blocks_of(points: FloatArray, cells: Mapping[str, IntArray]) -> tuple[Block, ...]:
    """Blocks of cells by kind, which are numbered through in this order."""
    blocks, first = [], 0
    for name, nodes in cells.items():
        numbers = slice(first, first + len(nodes))
        blocks.append(Block(KINDS[name], np.ascontiguousarray(nodes), numbers, points))
        first += len(nodes)
    return tuple(blocks)
