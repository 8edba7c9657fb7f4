"""Energies and powers of the terms of a block, integrated all at once."""

from __future__ import annotations

from collections.abc import Mapping

import basix.ufl
import numpy as np
import ufl
from dolfinx import fem

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.fenicsx.arguments import Arguments
from dolfin_tongue.fenicsx.block import Block
from dolfin_tongue.fenicsx.compile import compile_form
from dolfin_tongue.terms.term import Form


class Integrals:
    """Scalar forms on a block: each into its own component of a cell-wise test function.

    Parameters
    ----------
    block : their domain and coefficients.
    forms : by name.
    """

    def __init__(self, block: Block, forms: Mapping[str, Form]):
        self._block, self.names = block, tuple(forms)
        grid = block.domain.mesh
        self._columns = max(2, len(forms))
        if not forms:
            return
        element = basix.ufl.element("DG", block.domain.cell, 0, shape=(self._columns,))
        test = ufl.TestFunction(fem.functionspace(grid, element))
        total = ufl.Form([])
        for i, form in enumerate(forms.values()):
            for integral in form.integrals():
                total += ufl.Form([integral.reconstruct(integrand=integral.integrand() * test[i])])
        self._form = compile_form(total)
        self._vector = np.zeros(len(block.domain.owners) * self._columns)

    def __call__(self, at: Arguments) -> dict[str, float]:
        """Values by name."""
        if not self.names:
            return {}
        self._block.set_all(at)
        self._vector[:] = 0.0
        fem.assemble_vector(self._vector, self._form)
        sums: FloatArray = self._vector.reshape(-1, self._columns).sum(axis=0)
        return {name: float(x) for name, x in zip(self.names, sums, strict=False)}


def energies_of(block: Block) -> Integrals:
    """Kinetic energy, and that of each term that has one, J."""
    forms: dict[str, Form] = {}
    if block.dynamic and block.domain.surface is None:
        velocity = block.kin.velocity
        forms["kinetic"] = block.density / 2 * ufl.inner(velocity, velocity) * block.domain.dx
    for label, term, fields in block.terms:
        energy = term.energy(block.kin, fields)
        if energy is not None:
            forms[label] = energy
    return Integrals(block, forms)


def powers_of(block: Block) -> Integrals:
    """Virtual power along the velocity of each term without an energy, W: what it takes."""
    forms: dict[str, Form] = {}
    if block.dynamic:
        for label, term, fields in block.terms:
            if term.energy(block.kin, fields) is None:
                forms[label] = ufl.action(block.parts[label], block.rate)
    return Integrals(block, forms)
