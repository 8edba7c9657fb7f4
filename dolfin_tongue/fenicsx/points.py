"""Fields of a state at the quadrature points: deformation, pressure, stress of each term."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import basix
import numpy as np
import scipy.sparse as sp
import ufl
from dolfinx import fem

from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.body.point_set import PointSet, gradients_at_points, points_of
from dolfin_tongue.fenicsx.arguments import Arguments
from dolfin_tongue.fenicsx.block import Block
from dolfin_tongue.fenicsx.compile import compile_expression
from dolfin_tongue.march.observed import PointFields
from dolfin_tongue.terms.term import EnergyTerm, Expr, StressTerm


class Points:
    """The quadrature points of the volume, cell after cell of the body.

    Parameters
    ----------
    block : of the volume.
    """

    def __init__(self, block: Block):
        self.block, self._domain = block, block.domain
        numbering = self._domain.numbering
        if numbering.nodal_only:  # in the order of the body's own rule
            self._rule = (numbering.body.blocks[0].kind.rule.points + 1) / 2
        else:
            cell = basix.CellType[self._domain.cell]
            degree = numbering.pair.quadrature_degree
            self._rule = np.asarray(basix.make_quadrature(cell, degree)[0])
        self._order = np.argsort(self._domain.owners, kind="stable")

    @cached_property
    def places(self) -> PointSet:
        """The points, with means over cells and around nodes."""
        if self._domain.numbering.nodal_only:
            return points_of(self._domain.numbering.body)
        return PointSet(self.cells, self.weights, self.hats)

    @property
    def cells(self) -> IntArray:
        """Cell of the body of each point, shape (Q,)."""
        return np.repeat(self._domain.owners[self._order], len(self._rule))

    @cached_property
    def weights(self) -> FloatArray:
        """Reference volume of each point, shape (Q,), m3."""
        numbering = self._domain.numbering
        cell, degree = basix.CellType[self._domain.cell], numbering.pair.quadrature_degree
        weights = np.asarray(basix.make_quadrature(cell, degree)[1])
        jacobian = self._evaluate(ufl.JacobianDeterminant(self._domain.mesh), ())
        return np.abs(jacobian) * np.tile(weights, len(self._order))

    def hats(self) -> Any:
        """Values at the points from values at the nodes, sparse, shape (Q, n)."""
        numbering = self._domain.numbering
        cell = basix.CellType[self._domain.cell]
        linear = basix.create_element(basix.ElementFamily.P, cell, 1)
        table = np.asarray(linear.tabulate(0, self._rule))[0, :, :, 0]
        original = np.asarray(self._domain.mesh.topology.original_cell_index)[self._order]
        corners = np.repeat(numbering.cells[original], len(table), axis=0)
        values = np.tile(table, (len(original), 1))
        rows = np.repeat(np.arange(len(corners)), corners.shape[1])
        shape = (len(corners), len(numbering.body.points))
        return sp.coo_array((values.ravel(), (rows, corners.ravel())), shape=shape).tocsr()

    def _evaluate(self, expression: Expr, shape: tuple[int, ...]) -> FloatArray:
        """Values at the points, shape (Q, *shape)."""
        compiled = compile_expression(expression, self._rule)
        return self._values(compiled, shape)

    def _values(self, compiled: fem.Expression, shape: tuple[int, ...]) -> FloatArray:
        count = len(self._domain.owners)
        found = compiled.eval(self._domain.mesh, np.arange(count, dtype=np.int32))
        return found.reshape(count, len(self._rule), *shape)[self._order].reshape(-1, *shape)

    @cached_property
    def _deformation(self) -> fem.Expression:
        kin = self.block.kin
        parts = [kin.F]
        if self.block.dynamic:
            parts.append(ufl.grad(kin.velocity))
        rows = [part[i, j] for part in parts for i in range(3) for j in range(3)]
        return compile_expression(ufl.as_vector(rows), self._rule)

    def deformation(self, at: Arguments) -> tuple[FloatArray, FloatArray]:
        """F and its rate, 1/s, shape (Q, 3, 3) each."""
        numbering = self._domain.numbering
        if numbering.nodal_only:
            u, v = (x[numbering.nodes].reshape(-1, 3) for x in (at.state, at.rate))
            body = numbering.body
            return np.eye(3) + gradients_at_points(body, u), gradients_at_points(body, v)
        self.block.set_all(at)
        shape = (2, 3, 3) if self.block.dynamic else (1, 3, 3)
        found = self._values(self._deformation, shape)
        return found[:, 0], found[:, 1] if self.block.dynamic else np.zeros_like(found[:, 0])

    @cached_property
    def _stresses(self) -> tuple[list[str], fem.Expression]:
        """Pressure and first Piola-Kirchhoff stress of all terms that have one, as one vector."""
        names, rows = [], [self.block.state[3]]
        for label, term, fields in self.block.terms:
            if isinstance(term, StressTerm | EnergyTerm):
                kin: Any = self.block.kin  # of the volume
                stress = term.first_piola(kin, fields)
                if stress is not None:
                    names.append(label)
                    rows += [stress[i, j] for i in range(3) for j in range(3)]
        return names, compile_expression(ufl.as_vector(rows), self._rule)

    def fields(self, at: Arguments) -> PointFields:
        """All fields of a state."""
        F, _ = self.deformation(at)
        names, compiled = self._stresses  # makes coefficients, which are to be set
        self.block.set_all(at)
        found = self._values(compiled, (1 + 9 * len(names),))
        parts: dict[str, FloatArray] = {
            name: found[:, 1 + 9 * i : 10 + 9 * i].reshape(-1, 3, 3) for i, name in enumerate(names)
        }
        return PointFields(self.places, F, found[:, 0], parts)
