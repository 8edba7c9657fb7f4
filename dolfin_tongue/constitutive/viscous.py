"""Viscous stress: the dashpot beside the elastic tissue (Kelvin-Voigt)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from dolfin_tongue.base.values import Value, require_positive_values
from dolfin_tongue.terms.term import Expr, Fields, StressTerm

if TYPE_CHECKING:  # UFL
    from dolfin_tongue.terms.kinematics import Kinematics


@dataclass(frozen=True)
class Viscosity(StressTerm):
    """Newtonian stress T = 2 eta dev(D), parallel to the passive tissue.

    Parameters
    ----------
    eta : dynamic viscosity, Pa s, > 0. The published tongue's stiffness damping of 0.03 s times its
        shear modulus of 2.07 kPa is 62 Pa s.
    """

    numbers: ClassVar[tuple[str, ...]] = ("eta",)
    eta: Value

    def __post_init__(self) -> None:
        require_positive_values(self, "Pa s", eta=self.eta)

    def first_piola(self, kin: Kinematics, fields: Fields) -> Expr | None:
        """P = 2 eta J dev(D) F^-T, Pa; None in a static scene."""
        import ufl

        if kin.static:
            return None
        return 2 * fields.value(self.eta) * kin.J * ufl.dev(kin.D) * ufl.inv(kin.F).T
