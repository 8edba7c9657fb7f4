"""Passive tissue: strain energies, evaluated at the isochoric part of the deformation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from dolfin_tongue.base.values import (
    Value,
    at_least_one,
    require_not_negative_values,
    require_positive_values,
)
from dolfin_tongue.body.body import Body
from dolfin_tongue.terms.term import EnergyTerm, Expr, Fields

if TYPE_CHECKING:  # UFL
    from dolfin_tongue.terms.kinematics import Kinematics


def strain_invariants(strain: Expr) -> tuple[Expr, Expr]:
    """Invariants J1 = tr E and J2 = (E:E - (tr E)^2)/2 of the law (67).

    J2 is the negative of the usual second invariant: only so is a2 = 6 > 0 stable, and only so do
    (67) and (68) agree.
    """
    import ufl

    first = ufl.tr(strain)
    return first, (ufl.inner(strain, strain) - first**2) / 2


@dataclass(frozen=True)
class ReportTissue(EnergyTerm):
    """Isotropic exponential tissue of the report (67), from Bovendeerd et al. 1992.

    W = a0 (exp(a1 J1^2 + a2 J2) - 1); the shear modulus at rest is a0 a2 / 2 = 1.5 kPa.

    Parameters
    ----------
    a0 : Pa, > 0.
    a1 : dimensionless, >= 0.
    a2 : dimensionless, > 0.
    """

    numbers: ClassVar[tuple[str, ...]] = ("a0", "a1", "a2")
    a0: Value = 500.0
    a1: Value = 3.0
    a2: Value = 6.0

    def __post_init__(self) -> None:
        require_positive_values(self, "Pa", a0=self.a0)
        require_positive_values(self, "", a2=self.a2)
        require_not_negative_values(self, "", a1=self.a1)

    def exponent(self, kin: Kinematics, fields: Fields) -> Expr:
        """Q = a1 J1^2 + a2 J2 of (67), dimensionless."""
        j1, j2 = strain_invariants(kin.E_iso)
        return fields.value(self.a1) * j1**2 + fields.value(self.a2) * j2

    def energy_density(self, kin: Kinematics, fields: Fields) -> Expr:
        """W = a0 (exp(Q) - 1) (67), J/m3."""
        import ufl

        return fields.value(self.a0) * (ufl.exp(self.exponent(kin, fields)) - 1)


@dataclass(frozen=True)
class FibreReinforcedTissue(ReportTissue):
    """Transversely isotropic extension of (67) by the fibre strain, after Bovendeerd et al. 1992.

    W = a0 (exp(a1 J1^2 + a2 J2 + a3 E_ff^2) - 1) with the fibre strain E_ff = N.E N, in the cells
    of one muscle; elsewhere the law is (67).

    Parameters
    ----------
    a3 : dimensionless, > 0.
    muscle : the muscle whose fibres stiffen the tissue.
    """

    numbers: ClassVar[tuple[str, ...]] = (*ReportTissue.numbers, "a3")
    a3: Value = 3.0
    muscle: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_positive_values(self, "", a3=self.a3)

    def check(self, body: Body) -> None:
        """Raise UnknownName if the body has no such muscle."""
        super().check(body)
        body.fibres[self.muscle]

    def exponent(self, kin: Kinematics, fields: Fields) -> Expr:
        """Q + a3 E_ff^2, dimensionless."""
        import ufl

        slots = fields.body.fibres.slots((self.muscle,), fields.body.cell_count)
        fibre = fields.on_cells(slots.directions[:, 0])
        present = fields.on_cells((slots.density[:, 0] > 0).astype(float))
        fibre_strain = ufl.inner(fibre, kin.E_iso * fibre)
        return super().exponent(kin, fields) + fields.value(self.a3) * present * fibre_strain**2


@dataclass(frozen=True)
class MooneyRivlin(EnergyTerm):
    """W = c10 (I1 - 3) + c01 (I2 - 3) + c20 (I1 - 3)^2 of the isochoric C; Yeoh for c01 = 0.

    The published tongue uses c10 = 1037 Pa, c20 = 486 Pa (Buchaillard et al. 2009). The shear
    modulus at rest is 2 (c10 + c01).

    Parameters
    ----------
    c10 : Pa, > 0.
    c20 : Pa, >= 0; with 0 the term is not in the form.
    c01 : Pa, >= 0; with 0 the term is not in the form.
    """

    numbers: ClassVar[tuple[str, ...]] = ("c10", "c20", "c01")
    c10: Value = 1037.0
    c20: Value = 486.0
    c01: Value = 0.0

    def __post_init__(self) -> None:
        require_positive_values(self, "Pa", c10=self.c10)
        require_not_negative_values(self, "Pa", c20=self.c20, c01=self.c01)

    def energy_density(self, kin: Kinematics, fields: Fields) -> Expr:
        """Energy per reference volume, J/m3."""
        import ufl

        first = ufl.tr(kin.C_iso)
        energy = fields.value(self.c10) * (first - 3)
        if at_least_one(self.c20):
            energy += fields.value(self.c20) * (first - 3) ** 2
        if at_least_one(self.c01):
            second = (first**2 - ufl.inner(kin.C_iso, kin.C_iso)) / 2
            energy += fields.value(self.c01) * (second - 3)
        return energy
