"""What is observed of a state of a DOLFINx system, in motion and in statics alike."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import ufl
from dolfinx import fem

from dolfin_tongue.base.arrays import FloatArray, sums_at
from dolfin_tongue.base.errors import UnknownName
from dolfin_tongue.body.state import State
from dolfin_tongue.constitutive.muscle_state import MuscleStates
from dolfin_tongue.control import Instant, Memory
from dolfin_tongue.fenicsx.arguments import Arguments
from dolfin_tongue.fenicsx.audit import Integrals, energies_of, powers_of
from dolfin_tongue.fenicsx.compile import compile_form
from dolfin_tongue.fenicsx.contact import ContactSurface
from dolfin_tongue.fenicsx.points import Points
from dolfin_tongue.fenicsx.system import System
from dolfin_tongue.march.observed import MuscleState, PointFields, Strain, Touch
from dolfin_tongue.march.solver import Observer


class SystemObserver(Observer):
    """Base of solvers on a system.

    Parameters
    ----------
    system : the equations.
    """

    def __init__(self, system: System):
        self.system, self.scene = system, system.scene

    def _at(self, state: State, now: Instant | None = None) -> Arguments:
        """Arguments of a state, at another instant if one is given."""
        return self.system.at_state(state, now)

    @cached_property
    def _energies(self) -> list[Integrals]:
        return [energies_of(block) for block in self.system.blocks]

    @cached_property
    def _powers(self) -> list[Integrals]:
        return [powers_of(block) for block in self.system.blocks]

    def energies(self, state: State, now: Instant | None = None) -> dict[str, float]:
        """Energies by name, J: kinetic, and those of all terms that have one."""
        at = self._at(state, now)
        parts = [integrals(at) for integrals in self._energies]
        parts += [coupling.energies(at) for coupling in self.system.couplings]
        return {name: value for part in parts for name, value in part.items()}

    def powers(self, state: State, now: Instant | None = None) -> dict[str, float]:
        """Power that each other term gives to the motion, by name, W."""
        at = self._at(state, now)
        forms = [integrals(at) for integrals in self._powers]
        found = {name: -value for part in forms for name, value in part.items()}
        for coupling in self.system.couplings:
            found |= coupling.powers(at)
        return found

    def support_work(self, first: State, second: State, middle: State) -> float:
        """Work of supports that move, J: their forces in the middle of a step times the way."""
        (y0, v0), (y1, v1) = self.system.vectors(first), self.system.vectors(second)
        y, _ = self.system.vectors(middle)
        dt = second.time - first.time
        now = Instant(middle.time, middle.memory)
        at = Arguments(now, middle.time, y, (y1 - y0) / dt, (v1 - v0) / dt, y)
        return self.system.support_work(at, y1 - y0)

    def contacts(self, state: State, now: Instant | None = None) -> dict[str, Touch]:
        """Return what is touched, by the contact's name."""
        at = self._at(state, now)
        parts = [part for part in self.system.couplings if isinstance(part, ContactSurface)]
        return {part.label: part.touch(at) for part in parts}

    @cached_property
    def _points(self) -> Points:
        return Points(self.system.volume)

    def strain(self, state: State) -> Strain:
        """Deformation at the quadrature points."""
        return Strain(self._points.places, self._points.deformation(self._at(state))[0])

    def fields(self, state: State) -> PointFields:
        """Strain, pressure and stress at the quadrature points."""
        return self._points.fields(self._at(state))

    @cached_property
    def _muscles(self) -> MuscleStates:
        named = zip(self.scene.labels, self.scene.terms, strict=True)
        return MuscleStates(self.scene.body, self._points.places, list(named))

    def muscles(self, state: State) -> dict[str, MuscleState]:
        """Activation, stretch, stress and force of each muscle that takes part."""
        if not self._muscles.any:
            return {}
        F, rate = self._points.deformation(self._at(state))
        return self._muscles(F, rate, Instant(state.time, state.memory))

    def sides(self, state: State) -> Memory:
        """Where points of contact with a sheet are."""
        return self.system.sides(state)

    # -- parameters --------------------------------------------------------------------------------

    def set_parameter(self, name: str, value: float) -> None:
        """Give a named parameter of the scene another value; UnknownName lists them."""
        self.scene = self.system.scene = self.scene.with_parameters(**{name: value})
        for block in self.system.blocks:
            block.set_parameter(name, value)
        self.__dict__.pop("_muscles", None)

    def force_by_parameter(self, name: str, state: State) -> FloatArray:
        """Return the derivative of all nodal forces by a named parameter, (n, 3), N per its unit.

        By differentiation of the form.
        """
        if name not in self.scene.parameters:
            raise UnknownName("parameter", name, self.scene.parameters)
        at, total = self._at(state), np.zeros(self.system.size)
        for block in self.system.blocks:
            if name in block.coefficients.parameters:
                form = ufl.diff(block.residual_form, block.coefficients.parameters[name])
                block.set_all(at)
                part = np.zeros(len(block.domain.dofs))
                fem.assemble_vector(part, compile_form(form))
                total += sums_at(block.domain.dofs, part, self.system.size)
        return -self.system.displacement(total)
