"""Skin: a thin hyperelastic membrane on a named surface (5)-(10), (13), (14)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from dolfin_tongue.base.values import Value, require_positive_values
from dolfin_tongue.body.faces import BOUNDARY
from dolfin_tongue.terms.term import Expr, Fields, SurfaceTerm

if TYPE_CHECKING:  # UFL
    from dolfin_tongue.terms.kinematics import SurfaceKinematics


@dataclass(frozen=True)
class Skin(SurfaceTerm):
    """Incompressible neo-Hookean membrane, stress-free in the reference configuration.

    With the surface's right Cauchy-Green tensor C_s = a^-1 A, the metrics a (7) and A (8), the skin
    keeps its volume by growing thinner: its stretch across is 1 / sqrt(det C_s), the h of (9). So

        W = mu h / 2 (tr C_s + 1 / det C_s - 3)   per reference area.

    Membrane forces per deformed length, for principal stretches l1 and l2 (N/m, positive in
    tension): mu h (l1^2 - 1 / (l1 l2)^2) / (l1 l2) along the first. Equibiaxial stretch l gives
    mu h (1 - l^-6); a strip that may contract, l2 = l^-1/2, mu h (l^2 - 1/l) l^-1/2. It resists
    stretching and shear, not bending: in compression it wrinkles, which a mesh shows as soft modes.

    Parameters
    ----------
    shear_modulus : mu, Pa, > 0.
    thickness : h at rest, m, > 0.
    surface : name of a surface of the body; the whole boundary if not named.

    Raises
    ------
    OutOfRange : a number that is not positive.
    """

    numbers: ClassVar[tuple[str, ...]] = ("shear_modulus", "thickness")
    shear_modulus: Value
    thickness: Value
    surface: str = BOUNDARY

    def __post_init__(self) -> None:
        require_positive_values(self, "Pa", shear_modulus=self.shear_modulus)
        require_positive_values(self, "m", thickness=self.thickness)

    def energy_density(self, kin: SurfaceKinematics, fields: Fields) -> Expr:
        """Energy mu h / 2 (tr C_s + 1 / det C_s - 3) per reference area, J/m2."""
        scale = fields.value(self.shear_modulus) * fields.value(self.thickness) / 2
        return scale * (kin.surface_C_trace + 1 / kin.area_ratio**2 - 3)
