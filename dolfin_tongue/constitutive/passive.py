"""Passive tissue: strain energies, evaluated at the isochoric part of the deformation."""

from __future__ import annotations

from dataclasses import dataclass

import ufl

from dolfin_tongue.base.errors import require_not_negative, require_positive
from dolfin_tongue.body.body import Body
from dolfin_tongue.terms.kinematics import Expr, Kinematics
from dolfin_tongue.terms.term import EnergyTerm, Fields


def strain_invariants(strain: Expr) -> tuple[Expr, Expr]:
    """Invariants J1 = tr E and J2 = (E:E - (tr E)^2)/2 of the law (67).

    J2 is the negative of the usual second invariant: only so is a2 = 6 > 0 stable, and only so do
    (67) and (68) agree.
    """
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

    a0: float = 500.0
    a1: float = 3.0
    a2: float = 6.0

    def __post_init__(self) -> None:
        require_positive(self, "Pa", a0=self.a0)
        require_positive(self, "", a2=self.a2)
        require_not_negative(self, "", a1=self.a1)

    def exponent(self, kin: Kinematics) -> Expr:
        """Q = a1 J1^2 + a2 J2 of (67), dimensionless."""
        j1, j2 = strain_invariants(kin.E_iso)
        return kin.number(self.a1) * j1**2 + kin.number(self.a2) * j2

    def energy_density(self, kin: Kinematics, fields: Fields) -> Expr:
        """W = a0 (exp(Q) - 1) (67), J/m3."""
        return kin.number(self.a0) * (ufl.exp(self.exponent(kin)) - 1)


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

    a3: float = 3.0
    muscle: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_positive(self, "", a3=self.a3)

    def check(self, body: Body) -> None:
        """Raise UnknownName if the body has no such muscle."""
        body.fibres[self.muscle]

    def energy_density(self, kin: Kinematics, fields: Fields) -> Expr:
        """W = a0 (exp(Q + a3 E_ff^2) - 1), J/m3."""
        slots = fields.body.fibres.slots((self.muscle,), len(fields.body.cells))
        fibre = fields.on_cells(slots.directions[:, 0])
        present = fields.on_cells((slots.density[:, 0] > 0).astype(float))
        fibre_strain = ufl.inner(fibre, kin.E_iso * fibre)
        fibre_part = kin.number(self.a3) * present * fibre_strain**2
        return kin.number(self.a0) * (ufl.exp(self.exponent(kin) + fibre_part) - 1)


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

    c10: float = 1037.0
    c20: float = 486.0
    c01: float = 0.0

    def __post_init__(self) -> None:
        require_positive(self, "Pa", c10=self.c10)
        require_not_negative(self, "Pa", c20=self.c20, c01=self.c01)

    def energy_density(self, kin: Kinematics, fields: Fields) -> Expr:
        """Energy per reference volume, J/m3."""
        first = ufl.tr(kin.C_iso)
        energy = kin.number(self.c10) * (first - 3)
        if self.c20:
            energy += kin.number(self.c20) * (first - 3) ** 2
        if self.c01:
            second = (first**2 - ufl.inner(kin.C_iso, kin.C_iso)) / 2
            energy += kin.number(self.c01) * (second - 3)
        return energy
