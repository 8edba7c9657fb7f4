"""From terms to parts: one entry per class of term.

A term whose class is not registered is refused by name: a subclass may differ in physics, so that
it does not inherit the part of its base. So is a muscle's law of another class.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.base.errors import NoDirectForce
from dolfin_tongue.body.block import Block
from dolfin_tongue.body.body import Body
from dolfin_tongue.body.face_groups import face_groups
from dolfin_tongue.body.regions import CellValues, on_cells
from dolfin_tongue.boundary.contact import Contact
from dolfin_tongue.boundary.gravity import Gravity
from dolfin_tongue.boundary.skin import Skin
from dolfin_tongue.boundary.surface_tension import SurfaceTension
from dolfin_tongue.constitutive.active import ActiveMuscles, ConstantFibreStress
from dolfin_tongue.constitutive.fibre_stress import FibreStress
from dolfin_tongue.constitutive.passive import FibreReinforcedTissue, MooneyRivlin, ReportTissue
from dolfin_tongue.constitutive.viscous import Viscosity
from dolfin_tongue.direct import passive, rates
from dolfin_tongue.direct.contacts import Obstacle
from dolfin_tongue.direct.mass import element_masses
from dolfin_tongue.direct.membranes import Film, NeoHookean
from dolfin_tongue.direct.parts import Load, Part
from dolfin_tongue.direct.tissue import Level, PointLaw, Tissue
from dolfin_tongue.terms.mobilisation import StressMobilisation
from dolfin_tongue.terms.term import Term


def parts_of(body: Body, terms: Sequence[tuple[str, Term]]) -> list[Part]:
    """Parts of some terms with their labels: loads, membranes and obstacles, then the tissue.

    Raises
    ------
    NoDirectForce : a term, or a muscle's law, that has no part here.
    """
    parts: list[Part] = []
    laws = []
    for label, term in terms:
        if type(term) in LAWS:
            make = LAWS[type(term)]
            laws.append((label, [make(term, body, block) for block in body.blocks]))
        elif type(term) in PARTS:
            parts += PARTS[type(term)](label, term, body)
        else:
            raise NoDirectForce(term)
    return [*parts, Tissue(body, laws)] if laws else parts


# -- stress laws -----------------------------------------------------------------------------------


def _numbers(term: Term, body: Body, block: Block, names: Sequence[str]) -> FloatArray:
    """Numbers of a law in a block, shape (m or 1, q or 1, k)."""
    values = [
        on_cells(f"{type(term).__name__}.{name}", getattr(term, name), body).part(block.numbers)
        for name in names
    ]
    return _stacked([value.contiguous for value in values])


def _stacked(arrays: Sequence[FloatArray]) -> FloatArray:
    """Stack arrays that broadcast, along a new last axis."""
    return np.ascontiguousarray(np.stack(np.broadcast_arrays(*arrays), axis=-1))


def _report_tissue(term: ReportTissue, body: Body, block: Block) -> PointLaw:
    numbers = _numbers(term, body, block, ("a0", "a1", "a2"))
    numbers = np.concatenate([numbers, np.zeros((*numbers.shape[:2], 1))], axis=-1)
    return PointLaw(
        passive.exponential_stress, passive.exponential_moduli, numbers, passive.exponential_energy
    )


def _fibre_reinforced(term: FibreReinforcedTissue, body: Body, block: Block) -> PointLaw:
    slots = body.fibres.slots((term.muscle,), body.cell_count)
    present = (slots.density[block.numbers, 0] > 0).astype(float)[:, None]
    numbers = _numbers(term, body, block, ("a0", "a1", "a2", "a3"))
    a0, a1, a2, a3 = np.moveaxis(numbers, -1, 0)
    numbers = _stacked([a0, a1, a2, a3 * present])
    return PointLaw(
        passive.exponential_stress, passive.exponential_moduli, numbers,
        passive.exponential_energy, fibres=_contiguous(slots.directions[block.numbers, :1]),
    )  # fmt: skip


def _contiguous(array: FloatArray) -> FloatArray:
    return np.ascontiguousarray(array)


def _mooney_rivlin(term: MooneyRivlin, body: Body, block: Block) -> PointLaw:
    numbers = _numbers(term, body, block, ("c10", "c20", "c01"))
    return PointLaw(passive.mooney_stress, passive.mooney_moduli, numbers, passive.mooney_energy)


def _viscosity(term: Viscosity, body: Body, block: Block) -> PointLaw:
    numbers = _numbers(term, body, block, ("eta",))
    return PointLaw(rates.viscous_stress, rates.viscous_moduli, numbers, rate_dependent=True)


def _active(term: ActiveMuscles, body: Body, block: Block) -> PointLaw:
    slots = term.slots(body)
    laws = term.laws(slots, body)
    for part in laws:
        if type(part.law) is not StressMobilisation:
            raise NoDirectForce(part.law)
    law = laws[0].on_arrays
    names = ("a", "b", "shift", "scale", "rate_slope", "rate_offset")
    values = [getattr(law, name) for name in names] + [term.strength(slots, body).array]
    numbers = _of_slots(values, block)
    return PointLaw(
        rates.active_stress, rates.active_moduli, numbers, rate_dependent=True,
        **_fibres(term, body, block),
    )  # fmt: skip


def _constant(term: ConstantFibreStress, body: Body, block: Block) -> PointLaw:
    numbers = _of_slots([term.strength(term.slots(body), body).array], block)
    return PointLaw(
        rates.constant_stress, rates.constant_moduli, numbers, **_fibres(term, body, block)
    )


def _of_slots(values: Sequence[Any], block: Block) -> FloatArray:
    """Numbers on slots in a block, shape (m or 1, q or 1, s or 1, k)."""
    arrays = [CellValues(np.asarray(x, dtype=float)).part(block.numbers).array for x in values]
    return _stacked([x if x.ndim else x.reshape(1, 1, 1) for x in arrays])


def _fibres(term: FibreStress, body: Body, block: Block) -> dict[str, Any]:
    """Directions of the fibre slots in a block, and their level over time."""
    slots = term.slots(body)
    level = Level(lambda now: slots.level(term.activations(now))[block.numbers])
    return {"fibres": _contiguous(slots.directions[block.numbers]), "level": level}


# -- loads, membranes, obstacles -------------------------------------------------------------------


def _gravity(label: str, term: Gravity, body: Body) -> list[Part]:
    """Nodal weights int rho g N_K (38)."""
    weight = np.zeros(len(body.points))
    for block in body.blocks:
        np.add.at(weight, block.cells, element_masses(body, block).sum(axis=2))
    force = np.multiply.outer(weight, np.asarray(term.acceleration, dtype=float))
    return [Load(label, force)]


def _film(label: str, term: SurfaceTension, body: Body) -> list[Part]:
    return [Film(label, term, body, group) for group in face_groups(body, term.surface)]


def _skin(label: str, term: Skin, body: Body) -> list[Part]:
    return [NeoHookean(label, term, body, group) for group in face_groups(body, term.surface)]


def _contact(label: str, term: Contact, body: Body) -> list[Part]:
    return [Obstacle(label, term, face_groups(body, term.surface), body.points)]


#: Class of term -> its stress in a block.
LAWS: dict[type[Term], Callable[..., PointLaw]] = {
    ReportTissue: _report_tissue,
    FibreReinforcedTissue: _fibre_reinforced,
    MooneyRivlin: _mooney_rivlin,
    Viscosity: _viscosity,
    ActiveMuscles: _active,
    ConstantFibreStress: _constant,
}

#: Class of term -> its parts.
PARTS: dict[type[Term], Callable[..., list[Part]]] = {
    Gravity: _gravity,
    SurfaceTension: _film,
    Skin: _skin,
    Contact: _contact,
}
