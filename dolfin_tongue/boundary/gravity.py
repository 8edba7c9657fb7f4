"""Gravity as a body force (38)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import ufl

from dolfin_tongue.terms.kinematics import Expr, Kinematics
from dolfin_tongue.terms.term import EnergyTerm, Fields, require_vector

#: Standard gravity, m/s2.
STANDARD_GRAVITY = 9.81


@dataclass(frozen=True)
class Gravity(EnergyTerm):
    """Uniform gravity; energy density -rho_0 g.u.

    Parameters
    ----------
    acceleration : g, m/s2, three components.
    """

    elastic: ClassVar[bool] = False
    acceleration: tuple[float, float, float] = (0.0, 0.0, -STANDARD_GRAVITY)

    def __post_init__(self) -> None:
        require_vector(self, "acceleration", self.acceleration)

    def force_density(self, kin: Kinematics, fields: Fields) -> Expr:
        """B = rho_0 g, N/m3."""
        weight = [kin.number(fields.body.density * component) for component in self.acceleration]
        return kin.loaded(ufl.as_vector(weight))

    def energy_density(self, kin: Kinematics, fields: Fields) -> Expr:
        """-rho_0 g.u, J/m3, zero in the reference configuration."""
        return -ufl.inner(self.force_density(kin, fields), kin.displacement)

    def virtual_power(self, kin: Kinematics, fields: Fields, test: Expr) -> ufl.Form:
        """Integral of -B.w (38)."""
        return -ufl.inner(self.force_density(kin, fields), test) * kin.dx
