"""One block of a system: the terms of a domain, compiled, in our numbering."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
import ufl
from dolfinx import fem

from dolfin_tongue.base.arrays import FloatArray, IntArray, sums_at
from dolfin_tongue.fenicsx.arguments import Arguments, Shifts
from dolfin_tongue.fenicsx.compile import compile_form
from dolfin_tongue.fenicsx.domains import Domain
from dolfin_tongue.fenicsx.fields import Coefficients, TermFields
from dolfin_tongue.fenicsx.incompressible import pressure_power, volume_condition
from dolfin_tongue.terms.kinematics import Deformation, Kinematics, SurfaceKinematics
from dolfin_tongue.terms.term import Expr, Form, FormTerm


class Block:
    """Residual and tangent of some terms on a domain.

    The volume has inertia, pressure and the volume condition besides the terms.

    Parameters
    ----------
    domain : cells or faces.
    terms : those that act there, with their labels.
    dynamic : with inertia and rates; otherwise with a load factor.
    """

    def __init__(self, domain: Domain, terms: Sequence[tuple[str, FormTerm]], dynamic: bool):
        self.domain, self.dynamic = domain, dynamic
        self.coefficients = Coefficients(domain)
        space = domain.space
        self.state = fem.Function(space, name="state")
        self.load: Any = None if dynamic else fem.Constant(domain.mesh, 1.0)
        self.rate: Any = fem.Function(space, name="rate") if dynamic else None
        self.acceleration: Any = fem.Function(space, name="acceleration") if dynamic else None
        self.end: Any = fem.Function(space, name="end") if dynamic else self.state
        self.kin = self.kinematics(self.state, self.rate)
        #: Terms that have a part in the form, with their labels and what they borrow; the parts.
        self.terms: list[tuple[str, FormTerm, TermFields]] = []
        self.parts: dict[str, Form] = {}
        self.residual_form = self._residual_form(terms)
        self._residual = compile_form(self.residual_form)
        self._part = np.zeros(len(domain.dofs))
        present = set(self.residual_form.coefficients())
        vectors = {"state": self.state, "rate": self.rate, "acceleration": self.acceleration}
        if dynamic:
            vectors["end"] = self.end
        #: Arguments that the residual depends on, and the arrays of their coefficients.
        self._vectors = [(name, x.x.array) for name, x in vectors.items() if x in present]

    def kinematics(self, state: fem.Function, rate: fem.Function | None) -> Deformation:
        """Kinematics of a state and its rate."""
        kind = Kinematics if self.domain.surface is None else SurfaceKinematics
        return kind(state, rate, self.domain.dx, self.coefficients.number, self.load)

    # -- forms -------------------------------------------------------------------------------------

    def _residual_form(self, terms: Sequence[tuple[str, FormTerm]]) -> Form:
        """Sum of the virtual powers of all terms."""
        form, test = self._of_volume() if self.domain.surface is None else self._of_surface()
        for label, term in terms:
            fields = TermFields(self.coefficients, label)
            part = term.virtual_power(self.kin, fields, test)
            if part is not None:
                form += part
                self.terms.append((label, term, fields))
                self.parts[label] = part
        return form

    def _of_surface(self) -> tuple[Form, Expr]:
        return ufl.Form([]), ufl.TestFunction(self.domain.space)

    def _of_volume(self) -> tuple[Form, Expr]:
        """Inertia (40), pressure, volume condition (91); and the test velocity."""
        test_u, test_p = ufl.TestFunctions(self.domain.space)
        kin: Any = self.kin
        form = pressure_power(kin, self.state[3], test_u)
        end = kin
        if self.dynamic:
            acceleration = ufl.as_vector([self.acceleration[i] for i in range(3)])
            form += self.density * ufl.inner(acceleration, test_u) * self.domain.dx
            end = self.kinematics(self.end, None)
        return form + volume_condition(end, test_p), test_u

    @cached_property
    def density(self) -> Expr:
        """Mass density, kg/m3."""
        fields = TermFields(self.coefficients, self.coefficients.body.name)
        return fields.value(self.coefficients.body.density, "density")

    @cached_property
    def _shifts(self) -> list[fem.Constant]:
        return [fem.Constant(self.domain.mesh, 0.0) for _ in range(3)]

    @cached_property
    def jacobian_form(self) -> Form:
        """Derivative by the state, and shifted ones by those other states that occur."""
        trial, residual = ufl.TrialFunction(self.domain.space), self.residual_form
        form = ufl.derivative(residual, self.state, trial)
        if self.dynamic:
            others = (self.rate, self.acceleration, self.end)
            present = residual.coefficients()
            for shift, other in zip(self._shifts, others, strict=True):
                if other in present:
                    form += shift * ufl.derivative(residual, other, trial)
        return form

    @cached_property
    def _jacobian(self) -> fem.Form:
        return compile_form(self.jacobian_form)

    # -- values ------------------------------------------------------------------------------------

    def set(self, at: Arguments) -> None:
        """Hand the arguments to the coefficients of the forms."""
        self.coefficients.set_instant(at.now)
        dofs = self.domain.dofs
        for name, values in self._vectors:
            values[:] = getattr(at, name)[dofs]
        if self.load is not None and self.load.value != at.load:
            self.load.value = at.load

    def set_all(self, at: Arguments) -> None:
        """Hand over those arguments too that the residual does not depend on."""
        self.set(at)
        dofs = self.domain.dofs
        self.state.x.array[:] = at.state[dofs]
        if self.dynamic:
            self.rate.x.array[:] = at.rate[dofs]

    def residual(self, at: Arguments, size: int) -> FloatArray:
        """Part of the residual, shape (size,): N in rows of u, m3 in rows of p."""
        self.set(at)
        self._part[:] = 0.0
        fem.assemble_vector(self._part, self._residual)
        return sums_at(self.domain.dofs, self._part, size)

    def set_parameter(self, name: str, value: float) -> None:
        """Give a named parameter another value, where the block has it."""
        if name in self.coefficients.parameters:
            constant = self.coefficients.parameters[name].ufl_operands[0]
            constant.value = value

    @cached_property
    def pressure_weights(self) -> FloatArray:
        """Integral of the square of each pressure shape function in our numbers; else 0."""
        _, trial = ufl.TrialFunctions(self.domain.space)
        _, test = ufl.TestFunctions(self.domain.space)
        matrix = fem.assemble_matrix(compile_form(trial * test * self.domain.dx))
        return sums_at(self.domain.dofs, matrix.to_scipy().diagonal())

    @cached_property
    def _matrix(self) -> Any:
        return fem.create_matrix(self._jacobian)

    @cached_property
    def entries(self) -> tuple[IntArray, IntArray]:
        """Row and column, in our numbers, of each entry of the tangent's data."""
        matrix = self._matrix
        size = matrix.block_size[0]
        rows = np.repeat(np.arange(len(matrix.indptr) - 1), np.diff(matrix.indptr))
        places = np.arange(size)
        row = size * rows[:, None, None] + places[:, None] + 0 * places
        column = size * matrix.indices[:, None, None] + places + 0 * places[:, None]
        return self.domain.dofs[row.ravel()], self.domain.dofs[column.ravel()]

    def tangent(self, at: Arguments, shifts: Shifts) -> FloatArray:
        """Values of the entries of the tangent."""
        self.set(at)
        values = (shifts.rate, shifts.acceleration, shifts.end)
        for constant, value in zip(self._shifts, values, strict=True):
            constant.value = value
        matrix = self._matrix
        matrix.data[:] = 0.0
        fem.assemble_matrix(matrix, self._jacobian)
        return matrix.data
