"""Gravity as a body force (38)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from dolfin_tongue.base.errors import require_vector
from dolfin_tongue.terms.term import EnergyTerm, Expr, Fields

if TYPE_CHECKING:  # UFL
    from dolfin_tongue.terms.kinematics import Kinematics

#: Standard gravity, m/s2.
STANDARD_GRAVITY = 9.81


@dataclass(frozen=True)
class Gravity(EnergyTerm):
    """Uniform gravity; energy density -rho_0 g.u, force B = rho_0 g (38).

    Parameters
    ----------
    acceleration : g, m/s2, three components.
    """

    elastic: ClassVar[bool] = False
    acceleration: tuple[float, float, float] = (0.0, 0.0, -STANDARD_GRAVITY)

    def __post_init__(self) -> None:
        require_vector(self, "acceleration", self.acceleration)

    def energy_density(self, kin: Kinematics, fields: Fields) -> Expr:
        """-rho_0 g.u, J/m3, zero in the reference configuration."""
        import ufl

        density = fields.value(fields.body.density, "density")
        pull = ufl.as_vector([kin.number(component) for component in self.acceleration])
        return -kin.loaded(density * ufl.inner(pull, kin.displacement))
