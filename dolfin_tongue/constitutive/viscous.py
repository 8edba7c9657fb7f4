"""Viscous stress: the dashpot beside the elastic tissue (Kelvin-Voigt)."""

from __future__ import annotations

from dataclasses import dataclass

import ufl

from dolfin_tongue.base.errors import require_positive
from dolfin_tongue.terms.kinematics import Expr, Kinematics
from dolfin_tongue.terms.term import Fields, Term


@dataclass(frozen=True)
class Viscosity(Term):
    """Newtonian stress T = 2 eta dev(D), parallel to the passive tissue.

    Parameters
    ----------
    eta : dynamic viscosity, Pa s, > 0. The published tongue's stiffness damping of 0.03 s times its
        shear modulus of 2.07 kPa is 62 Pa s.
    """

    eta: float

    def __post_init__(self) -> None:
        require_positive(self, "Pa s", eta=self.eta)

    def virtual_power(self, kin: Kinematics, fields: Fields, test: Expr) -> ufl.Form | None:
        """Integral of P : grad w with P = 2 eta J dev(D) F^-T; None in a static scene."""
        if kin.static:
            return None
        stress = 2 * kin.number(self.eta) * kin.J * ufl.dev(kin.D)
        return kin.power(stress * ufl.inv(kin.F).T, test)
