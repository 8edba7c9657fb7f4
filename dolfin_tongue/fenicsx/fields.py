"""Coefficients that terms borrow: numbers and values on cells as UFL expressions."""

from __future__ import annotations

from collections.abc import Callable

import basix
import basix.ufl
import numpy as np
import ufl
from dolfinx import fem

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.base.errors import BadScene
from dolfin_tongue.base.values import Parameter, Value
from dolfin_tongue.body.regions import CellValues, on_cells
from dolfin_tongue.control import Instant
from dolfin_tongue.fenicsx.domains import Domain
from dolfin_tongue.terms.term import Expr

#: Values at an instant, shape (m,) or (m, k).
Varying = Callable[[Instant], FloatArray]


class Coefficients:
    """The coefficients of one domain.

    Attributes
    ----------
    parameters : UFL variables of the named parameters, whose operands are constants.
    """

    def __init__(self, domain: Domain):
        self.domain, self.body = domain, domain.numbering.body
        self.parameters: dict[str, Expr] = {}
        self._varying: list[tuple[fem.Function, Varying]] = []
        self._now: Instant | None = None

    def number(self, value: float) -> fem.Constant:
        """Return a constant of the forms: another value needs no new compilation."""
        return fem.Constant(self.domain.mesh, float(value))

    def parameter(self, parameter: Parameter) -> Expr:
        """Return the variable of a named parameter."""
        if parameter.name not in self.parameters:
            self.parameters[parameter.name] = ufl.variable(self.number(parameter.value))
        return self.parameters[parameter.name]

    def resolved(self, values: CellValues) -> Expr:
        """Values that have been spread over cells, or over cells and fibre slots."""
        total = self._array(values.base) if np.any(values.base) or not values.shares else 0
        for parameter, share in values.shares:
            total += self.parameter(parameter) * (self._array(share) if share.ndim else 1)
        return total

    def _array(self, array: FloatArray) -> Expr:
        if not array.ndim:
            return self.number(float(array))
        if array.shape[1] == 1:
            return self.on_cells(array[:, 0])
        return self._at_points(array)

    def on_cells(self, values: FloatArray) -> fem.Function:
        """Coefficient of values on cells, shape (m,) or (m, k)."""
        return self.domain.coefficient(values)

    def _at_points(self, values: FloatArray) -> fem.Function:
        """Coefficient of values at the quadrature points, shape (m, q) or (m, q, k)."""
        degree = self.domain.numbering.pair.quadrature_degree
        points = np.asarray(basix.make_quadrature(basix.CellType[self.domain.cell], degree)[0])
        rule = self.body.blocks[0].kind.rule.points
        ours = (rule + 1) / 2  # from [-1, 1]^3 to basix' unit cube
        distance = np.abs(points[:, None] - ours).max(axis=-1) if len(points) == len(ours) else None
        if self.domain.surface is not None or distance is None or distance.min(axis=1).max() > 1e-9:
            raise BadScene(
                "values at quadrature points belong to the points of Body.quadrature_points, which "
                "are those of the pair Q1/P0 and of the volume; give one value for each cell"
            )
        element = basix.ufl.quadrature_element(
            self.domain.cell, value_shape=values.shape[2:], degree=degree
        )
        function = fem.Function(fem.functionspace(self.domain.mesh, element))
        components = values.shape[2] if values.ndim > 2 else 1
        ordered = values[self.domain.owners][:, distance.argmin(axis=1)]
        table = function.function_space.dofmap.list
        function.x.array.reshape(-1, components)[table] = ordered.reshape(*table.shape, components)
        return function

    def varying(self, values: Varying, components: int = 0) -> fem.Function:
        """Coefficient whose values are evaluated at each new instant."""
        shape = (self.body.cell_count, components) if components else self.body.cell_count
        function = self.on_cells(np.zeros(shape))
        self._varying.append((function, values))
        self._now = None
        return function

    def set_instant(self, now: Instant) -> None:
        """Evaluate the varying coefficients."""
        old = self._now
        if old is not None and now.time == old.time and now.memory is old.memory:
            return
        for function, values in self._varying:
            self.domain.set_coefficient(function, values(now))
        self._now = now


class TermFields:
    """What one term borrows (see `terms.term.Fields`); it sees its own memory."""

    def __init__(self, coefficients: Coefficients, label: str):
        self.body, self._all, self._label = coefficients.body, coefficients, label

    def value(self, value: Value, what: str = "a value") -> Expr:
        """Value of a law: a constant, or a coefficient; see `base.values`."""
        return self._all.resolved(on_cells(f"{what} of {self._label}", value, self.body))

    def resolved(self, values: CellValues) -> Expr:
        """Values that have been spread over cells, or over cells and fibre slots."""
        return self._all.resolved(values)

    def on_cells(self, values: FloatArray) -> Expr:
        """UFL coefficient of values on cells, shape (m,) or (m, k)."""
        return self._all.on_cells(values)

    def varying(self, values: Varying, components: int = 0) -> Expr:
        """Like `on_cells`, with values that are evaluated anew at each new instant."""
        return self._all.varying(lambda now: values(now.of(self._label)), components)
