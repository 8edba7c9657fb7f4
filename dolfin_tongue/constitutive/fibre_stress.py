"""Stress along the fibres of muscles under given activations."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.base.errors import BadScene
from dolfin_tongue.base.values import Value, require_positive_values
from dolfin_tongue.body.body import Body
from dolfin_tongue.body.fibres import SPECIFIC_TENSION, Slots
from dolfin_tongue.body.regions import CellValues, by_muscle, on_slots
from dolfin_tongue.control import Control, Instant
from dolfin_tongue.control.sources import require_activation
from dolfin_tongue.control.timed import Timed
from dolfin_tongue.terms.term import Expr, Fields, StressTerm

if TYPE_CHECKING:  # UFL
    from dolfin_tongue.terms.kinematics import Kinematics


@dataclass(frozen=True)
class FibreStress(StressTerm):
    """Base of the stresses along muscle fibres under given activations.

    The muscles of a cell share its *slots* (`body.fibres`); the stress is a sum over slots, so that
    the size of the form depends on how many muscles overlap, not on how many there are.

    Parameters
    ----------
    activation : activation over time of each muscle that takes part, values in [0, 1]. Muscles of
        the body that are not named take no part and cost nothing.
    max_stress : stress at full activation, Pa; which measure, the subclass says. A mapping may name
        muscles.
    """

    #: Whether the spherical part of the stress is taken out (36).
    deviatoric: ClassVar[bool] = True

    activation: Mapping[str, Control]
    max_stress: Value = SPECIFIC_TENSION

    def __post_init__(self) -> None:
        require_positive_values(self, "Pa", max_stress=self.max_stress)
        if not isinstance(self.activation, Mapping):
            raise BadScene(
                f"{type(self).__name__}: activation must map names of muscles to controls, e.g. "
                '{"styloglossus": Ramp(0.5)}'
            )
        for name, control in self.activation.items():
            if not isinstance(control, Control):
                raise BadScene(
                    f"the activation of {name!r} is {control!r}, which is no control; use "
                    "Constant(level), Ramp(level), Table(times, values) or a class of your own "
                    "that derives from Control"
                )
        if not self.activation:
            raise BadScene(
                f"{type(self).__name__} without muscles: leave the term out of the scene instead"
            )

    def check(self, body: Body) -> None:
        """Raise UnknownName for a muscle that the body does not have."""
        for name in self.activation:
            body.fibres[name]
        self.strength(self.slots(body), body)

    @property
    def names(self) -> tuple[str, ...]:
        """Muscles that take part, in the order of the activation vector."""
        return tuple(self.activation)

    @property
    def parts(self) -> Mapping[str, Timed]:
        """The controls, by muscle."""
        return self.activation

    def activations(self, now: Instant) -> FloatArray:
        """Activation vector at an instant, shape (len(names),)."""
        values = [control.at(now.of(name)) for name, control in self.activation.items()]
        try:
            levels = np.array(values, dtype=float)
            fine = levels.ndim == 1 and levels.min() >= 0.0 and levels.max() <= 1.0
        except (TypeError, ValueError):
            fine = False
        if not fine:  # the check of each costs more than all the rest
            for name, value in zip(self.activation, values, strict=True):
                require_activation(value, f"activation of {name!r} at t = {now.time:g} s")
        return levels

    def slots(self, body: Body) -> Slots:
        """Slots of the muscles that take part."""
        return body.fibres.slots(self.names, body.cell_count)

    def strength(self, slots: Slots, body: Body) -> CellValues:
        """Largest stress on the slots, Pa."""
        values = by_muscle(self.max_stress, self.names)
        return on_slots(f"{type(self).__name__}.max_stress", values, slots, body)

    # -- stress ------------------------------------------------------------------------------------

    def first_piola(self, kin: Kinematics, fields: Fields) -> Expr:
        """Sum over slots of J tau / stretch^2 F N x N (34), without its spherical part (36), Pa."""
        import ufl

        slots = self.slots(fields.body)
        fibres = fields.on_cells(slots.directions.reshape(len(slots.directions), -1))
        level = fields.varying(lambda now: slots.level(self.activations(now)), slots.count)
        strength = fields.resolved(self.strength(slots, fields.body))
        factors = self.factors(fields.resolved, slots, fields.body)
        spherical = ufl.inv(kin.F).T / 3 if self.deviatoric else ufl.zero(3, 3)
        total = ufl.zero(3, 3)
        for slot in range(slots.count):
            fibre = ufl.as_vector([fibres[3 * slot + i] for i in range(3)])
            stretch = kin.stretch(fibre)
            rate = 0.0 if kin.static else kin.stretch_rate(fibre)
            tension = kin.loaded(component(strength, slot) * component(level, slot))
            stress = tension * factors(slot, stretch, rate, kin.J)
            along = ufl.outer(kin.F * fibre, fibre) / stretch**2
            total += kin.J * stress * (along - spherical)
        return total

    @abstractmethod
    def factors(
        self, resolve: Callable[[CellValues], Any], slots: Slots, body: Body
    ) -> Callable[[int, Any, Any, Any], Any]:
        """Return a function: Cauchy stress along the fibres over max_stress times activation.

        It takes a slot, the fibre stretch, its rate (1/s; 0 in statics) and J, as arrays or as UFL
        expressions.

        Parameters
        ----------
        resolve : turns values on cells into arrays or UFL expressions.
        slots : the fibre slots of all cells.
        body : the body.
        """


def component(values: Any, slot: int) -> Any:
    """Component of a vector over slots; a scalar is the same for all."""
    if isinstance(values, np.ndarray):
        return values[..., slot] if values.ndim else values
    return values[slot] if values.ufl_shape else values
