"""From terms to forces: one law, load or membrane per class of term.

A law adds first Piola-Kirchhoff stress at quadrature points; a load is a nodal force; a membrane
acts on the faces of a surface, and so does an obstacle that they touch. A term whose class is not
registered is refused by name: a subclass may differ in physics, so that it does not
inherit the force of its base.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.base.errors import NoDirectForce, UnknownName
from dolfin_tongue.body.faces import BOUNDARY
from dolfin_tongue.body.fibres import Fibres, Slots
from dolfin_tongue.boundary.contact import Contact
from dolfin_tongue.boundary.gravity import Gravity
from dolfin_tongue.boundary.skin import Skin
from dolfin_tongue.boundary.surface_tension import SurfaceTension
from dolfin_tongue.constitutive.active import ActiveMuscles, ConstantFibreStress, FibreStress
from dolfin_tongue.constitutive.passive import FibreReinforcedTissue, MooneyRivlin, ReportTissue
from dolfin_tongue.constitutive.viscous import Viscosity
from dolfin_tongue.direct import passive, rates
from dolfin_tongue.direct.contacts import Obstacle
from dolfin_tongue.direct.faces import FaceGroup, outer_groups, surface_groups
from dolfin_tongue.direct.membranes import Film, Membrane, NeoHookean
from dolfin_tongue.direct.mesh import Block, Mesh
from dolfin_tongue.terms.term import SurfaceTerm, Term

#: Rate of F, shape (m, q, 3, 3), 1/s; None where no law of the scene needs it.
Rate = FloatArray | None


class Law(ABC):
    """Stress of one term in one block of elements.

    F and its rate have shape (m, q, 3, 3); the rate is None where no law of the scene is `rated`.
    """

    #: Whether the stress depends on the rate of F.
    rated = False

    @abstractmethod
    def add_stress(self, time: float, F: FloatArray, rate: Rate, out: FloatArray) -> None:
        """Add P, Pa, to out of shape (m, q, 3, 3)."""

    @abstractmethod
    def add_moduli(
        self,
        time: float,
        F: FloatArray,
        rate: Rate,
        factor: float,
        rate_factor: float,
        out: FloatArray,
    ) -> None:
        """Add factor dP/dF + rate_factor dP/d(rate) to out of shape (m, q, 9, 9)."""

    def energy(self, F: FloatArray) -> FloatArray | None:
        """Energy per reference volume, shape (m, q), J/m3; None for a law without one."""
        return None


@dataclass(frozen=True, eq=False)
class Surroundings:
    """What a term may ask for when its force is set up.

    Parameters
    ----------
    mesh : points and cells.
    density : kg/m3.
    fibres : the muscles; cells numbered as in the mesh.
    surfaces : named surfaces, as corners of faces of shape (k, 4); -1 in those of triangles.
    """

    mesh: Mesh
    density: float
    fibres: Fibres
    surfaces: Mapping[str, IntArray] = field(default_factory=dict)

    def faces(self, surface: str) -> list[FaceGroup]:
        """Faces of a surface; UnknownName lists the known ones."""
        if surface == BOUNDARY:
            return outer_groups(self.mesh)
        if surface not in self.surfaces:
            raise UnknownName("surface", surface, (*self.surfaces, BOUNDARY))
        return surface_groups(self.mesh, self.surfaces[surface])


@dataclass(frozen=True, eq=False)
class Exponential(Law):
    """Law (67), with the fibre part of `FibreReinforcedTissue` where a3 > 0."""

    term: ReportTissue
    a3: FloatArray
    fibres: FloatArray

    def add_stress(self, time: float, F: FloatArray, rate: Rate, out: FloatArray) -> None:
        """Add P, Pa."""
        term = self.term
        passive.exponential_stress(F, term.a0, term.a1, term.a2, self.a3, self.fibres, out)

    def add_moduli(
        self,
        time: float,
        F: FloatArray,
        rate: Rate,
        factor: float,
        rate_factor: float,
        out: FloatArray,
    ) -> None:
        """Add factor dP/dF."""
        t = self.term
        passive.exponential_moduli(F, t.a0, t.a1, t.a2, self.a3, self.fibres, factor, out)

    def energy(self, F: FloatArray) -> FloatArray:
        """Energy per reference volume, shape (m, q), J/m3."""
        strain = isochoric_strain(F)
        first = np.trace(strain, axis1=-2, axis2=-1)
        second = 0.5 * ((strain**2).sum(axis=(-2, -1)) - first**2)
        along = np.einsum("mi,mqij,mj->mq", self.fibres, strain, self.fibres)
        exponent = self.term.a1 * first**2 + self.term.a2 * second
        return self.term.a0 * np.expm1(exponent + self.a3[:, None] * along**2)


@dataclass(frozen=True, eq=False)
class Mooney(Law):
    """Law of `MooneyRivlin`."""

    term: MooneyRivlin

    def add_stress(self, time: float, F: FloatArray, rate: Rate, out: FloatArray) -> None:
        """Add P, Pa."""
        passive.mooney_stress(F, self.term.c10, self.term.c20, self.term.c01, out)

    def add_moduli(
        self,
        time: float,
        F: FloatArray,
        rate: Rate,
        factor: float,
        rate_factor: float,
        out: FloatArray,
    ) -> None:
        """Add factor dP/dF."""
        passive.mooney_moduli(F, self.term.c10, self.term.c20, self.term.c01, factor, out)

    def energy(self, F: FloatArray) -> FloatArray:
        """Energy per reference volume, shape (m, q), J/m3."""
        right = 2.0 * isochoric_strain(F) + np.eye(3)
        first = np.trace(right, axis1=-2, axis2=-1)
        second = 0.5 * (first**2 - (right**2).sum(axis=(-2, -1)))
        c10, c20, c01 = self.term.c10, self.term.c20, self.term.c01
        return c10 * (first - 3) + c20 * (first - 3) ** 2 + c01 * (second - 3)


@dataclass(frozen=True, eq=False)
class Viscous(Law):
    """Law of `Viscosity`."""

    term: Viscosity
    rated = True

    def add_stress(self, time: float, F: FloatArray, rate: Rate, out: FloatArray) -> None:
        """Add P, Pa."""
        rates.viscous_stress(F, rate, self.term.eta, out)

    def add_moduli(
        self,
        time: float,
        F: FloatArray,
        rate: Rate,
        factor: float,
        rate_factor: float,
        out: FloatArray,
    ) -> None:
        """Add factor dP/dF + rate_factor dP/d(rate)."""
        rates.viscous_moduli(F, rate, self.term.eta, factor, rate_factor, out)


class AlongFibres(Law):
    """Base of the laws of `FibreStress`, over the fibre slots of the cells of one block."""

    def __init__(self, term: FibreStress, slots: Slots, cells: slice):
        self.term, self.slots, self.cells = term, slots, cells
        self.fibres = np.ascontiguousarray(slots.directions[cells])
        self._time = np.nan
        self._level: FloatArray = np.zeros(0)

    def level(self, time: float) -> FloatArray:
        """Largest stress times density times activation of the slots, shape (m, s), Pa."""
        if time != self._time:
            level = self.slots.level(self.term.activations(time))[self.cells]
            self._time, self._level = time, self.term.max_stress * level
        return self._level


class Active(AlongFibres):
    """Law of `ActiveMuscles`."""

    rated = True

    def __init__(self, term: ActiveMuscles, slots: Slots, cells: slice):
        super().__init__(term, slots, cells)
        law = term.law
        self.law = np.array([law.a, law.b, law.shift, law.scale, law.rate_slope, law.rate_offset])

    def add_stress(self, time: float, F: FloatArray, rate: Rate, out: FloatArray) -> None:
        """Add P, Pa."""
        rates.active_stress(F, rate, self.level(time), self.fibres, self.law, out)

    def add_moduli(
        self,
        time: float,
        F: FloatArray,
        rate: Rate,
        factor: float,
        rate_factor: float,
        out: FloatArray,
    ) -> None:
        """Add factor dP/dF + rate_factor dP/d(rate)."""
        rates.active_moduli(
            F, rate, self.level(time), self.fibres, self.law, factor, rate_factor, out
        )


class ConstantAlongFibres(AlongFibres):
    """Law of `ConstantFibreStress`."""

    def add_stress(self, time: float, F: FloatArray, rate: Rate, out: FloatArray) -> None:
        """Add P, Pa."""
        rates.constant_stress(F, self.level(time), self.fibres, out)

    def add_moduli(
        self,
        time: float,
        F: FloatArray,
        rate: Rate,
        factor: float,
        rate_factor: float,
        out: FloatArray,
    ) -> None:
        """Add factor dP/dF."""
        rates.constant_moduli(self.level(time), self.fibres, factor, out)


def isochoric_strain(F: FloatArray) -> FloatArray:
    """E of the isochoric part of F, (J^(-2/3) F^T F - I)/2, shape (m, q, 3, 3)."""
    scale = np.linalg.det(F) ** (-2.0 / 3.0)
    return 0.5 * (scale[..., None, None] * np.einsum("mqki,mqkj->mqij", F, F) - np.eye(3))


# -- registry ------------------------------------------------------------------------------------


def _report_tissue(term: ReportTissue, around: Surroundings, block: Block) -> Law:
    count = len(block.cells)
    return Exponential(term, np.zeros(count), np.zeros((count, 3)))


def _fibre_reinforced(term: FibreReinforcedTissue, around: Surroundings, block: Block) -> Law:
    slots = around.fibres.slots((term.muscle,), around.mesh.cell_count)
    present = slots.density[block.numbers, 0] > 0
    fibres = np.ascontiguousarray(slots.directions[block.numbers, 0])
    return Exponential(term, term.a3 * present, fibres)


def _mooney_rivlin(term: MooneyRivlin, around: Surroundings, block: Block) -> Law:
    return Mooney(term)


def _viscosity(term: Viscosity, around: Surroundings, block: Block) -> Law:
    return Viscous(term)


def _active(term: ActiveMuscles, around: Surroundings, block: Block) -> Law:
    slots = around.fibres.slots(term.names, around.mesh.cell_count)
    return Active(term, slots, block.numbers)


def _constant(term: ConstantFibreStress, around: Surroundings, block: Block) -> Law:
    slots = around.fibres.slots(term.names, around.mesh.cell_count)
    return ConstantAlongFibres(term, slots, block.numbers)


def _gravity(term: Gravity, around: Surroundings) -> FloatArray:
    """Nodal weights int rho g N_K (38), shape (n, 3), N."""
    weight = np.zeros(len(around.mesh.points))
    for block in around.mesh.blocks:
        shape = block.kind.shapes(block.kind.mass_rule.points)
        jacobian = block.kind.jacobians(around.mesh.points[block.cells], block.kind.mass_rule)
        volume = block.kind.mass_rule.weights * np.linalg.det(jacobian)
        np.add.at(weight, block.cells, volume @ shape)
    return around.density * np.multiply.outer(weight, np.asarray(term.acceleration, dtype=float))


#: Class of term -> its stress in a block.
LAWS: dict[type[Term], Callable[..., Law]] = {
    ReportTissue: _report_tissue,
    FibreReinforcedTissue: _fibre_reinforced,
    MooneyRivlin: _mooney_rivlin,
    Viscosity: _viscosity,
    ActiveMuscles: _active,
    ConstantFibreStress: _constant,
}

#: Class of term -> a nodal force that depends neither on motion nor on time.
LOADS: dict[type[Term], Callable[..., FloatArray]] = {Gravity: _gravity}

#: Class of term -> its forces on a group of faces.
MEMBRANES: dict[type[SurfaceTerm], Callable[..., Membrane]] = {
    SurfaceTension: Film,
    Skin: NeoHookean,
}

#: Class of term -> its obstacle on some faces.
CONTACTS: dict[type[Term], Callable[..., Obstacle]] = {Contact: Obstacle}


def laws_of(term: Term, around: Surroundings) -> list[Law]:
    """Laws of a term, one per block; none for other kinds of terms. NoDirectForce without any."""
    if type(term) in LAWS:
        return [LAWS[type(term)](term, around, block) for block in around.mesh.blocks]
    if any(type(term) in registry for registry in (LOADS, MEMBRANES, CONTACTS)):
        return []
    raise NoDirectForce(term)


def load_of(term: Term, around: Surroundings) -> FloatArray | None:
    """Nodal force of a load, shape (n, 3), N; None for a law."""
    return LOADS[type(term)](term, around) if type(term) in LOADS else None


def membranes_of(term: Term, around: Surroundings) -> list[Membrane]:
    """Membranes of a term, one per group of faces; none for other terms."""
    if not (isinstance(term, SurfaceTerm) and type(term) in MEMBRANES):
        return []
    make, points = MEMBRANES[type(term)], around.mesh.points
    return [make(term, group, points) for group in around.faces(term.surface)]


def obstacle_of(term: Term, around: Surroundings) -> Obstacle | None:
    """Obstacle of a contact; None for other terms."""
    if not (isinstance(term, Contact) and type(term) in CONTACTS):
        return None
    return CONTACTS[type(term)](term, around.faces(term.surface), around.mesh.points)
