"""Meshes that mix kinds of elements: blocks of equal elements over one set of points."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.base.errors import BadMesh, UnknownName, listing
from dolfin_tongue.body.body import Body
from dolfin_tongue.direct.elements import KINDS, ElementKind


@dataclass(frozen=True, eq=False)
class Block:
    """Elements of one kind with what the element loops need.

    Parameters
    ----------
    kind : of the elements.
    cells : ndarray, shape (m, k) -- node numbers.
    numbers : their place among all cells of the mesh.
    gradients : ndarray, shape (m, q, k, 3), 1/m -- of the shape functions, by X (19).
    weights : ndarray, shape (m, q), m3 -- of the quadrature, with det J.
    """

    kind: ElementKind
    cells: IntArray
    numbers: slice
    gradients: FloatArray
    weights: FloatArray

    @property
    def shape(self) -> tuple[int, int]:
        """Number of elements and of quadrature points in each, (m, q)."""
        return self.weights.shape


@dataclass(frozen=True, eq=False)
class Mesh:
    """Points and blocks of elements.

    Parameters
    ----------
    points : ndarray, shape (n, 3), m.
    cells : kind of element (`elements.KINDS`) -> node numbers, ndarray of shape (m, k). Cells are
        numbered through, in the order of the blocks.

    Raises
    ------
    UnknownName : a kind that does not exist.
    BadMesh : a wrong number of nodes, no cells, unused points, inverted cells (listed).
    """

    points: FloatArray
    cells: Mapping[str, IntArray]

    def __post_init__(self) -> None:
        used = [np.zeros(0, dtype=np.int64)]
        for name, cells in self.cells.items():
            if name not in KINDS:
                raise UnknownName("element kind", name, KINDS)
            count = KINDS[name].node_count
            if cells.ndim != 2 or cells.shape[1] != count or not len(cells):
                raise BadMesh(f"{name}: cells must have shape (m, {count}), not {cells.shape}")
            used.append(cells.ravel())
        nodes = np.unique(np.concatenate(used))
        if not np.array_equal(nodes, np.arange(len(self.points))):
            raise BadMesh(
                f"the cells use {len(nodes)} nodes, there are {len(self.points)} points: every "
                "point must belong to a cell and every node number to a point"
            )
        self._check_orientation()

    def _check_orientation(self) -> None:
        for block in self.blocks:
            bad = np.flatnonzero(~(block.weights.min(axis=1) > 0)) + block.numbers.start
            if bad.size:
                raise BadMesh(
                    f"inverted {block.kind.name} cell(s) (Jacobian <= 0 at a quadrature point): "
                    f"{listing(bad.tolist())}. Check the node order"
                )

    @cached_property
    def blocks(self) -> tuple[Block, ...]:
        """Elements by kind."""
        blocks, first = [], 0
        for name, cells in self.cells.items():
            kind = KINDS[name]
            gradients, weights = kind.reference_gradients(self.points[cells])
            numbers = slice(first, first + len(cells))
            blocks.append(Block(kind, np.ascontiguousarray(cells), numbers, gradients, weights))
            first += len(cells)
        return tuple(blocks)

    @property
    def cell_count(self) -> int:
        """Number of cells of all kinds."""
        return sum(len(cells) for cells in self.cells.values())


def mesh_of(body: Body) -> Mesh:
    """Mesh of a body: one block of 8-node bricks."""
    return Mesh(body.points, {"brick8": np.asarray(body.cells, dtype=np.int64)})
