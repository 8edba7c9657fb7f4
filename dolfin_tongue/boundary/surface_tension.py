"""Surface tension of a named surface (11), (12), (44)-(47)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from dolfin_tongue.base.values import Value, require_positive_values
from dolfin_tongue.body.faces import BOUNDARY
from dolfin_tongue.terms.term import Expr, Fields, SurfaceTerm

if TYPE_CHECKING:  # UFL
    from dolfin_tongue.terms.kinematics import SurfaceKinematics


@dataclass(frozen=True)
class SurfaceTension(SurfaceTerm):
    """A constant energy sigma per deformed area: the film of a liquid.

    The surface pulls itself together: a sphere of radius R feels the pressure 2 sigma / R, and the
    edge of an open surface is drawn inward with the force sigma per length. In statics it grows
    with the load factor, like every force that acts on the reference configuration.

    Parameters
    ----------
    sigma : surface tension, N/m = J/m2, > 0. Water in air has 0.073.
    surface : name of a surface of the body; the whole boundary if not named.

    Raises
    ------
    OutOfRange : sigma <= 0.
    """

    numbers: ClassVar[tuple[str, ...]] = ("sigma",)
    sigma: Value
    surface: str = BOUNDARY

    def __post_init__(self) -> None:
        require_positive_values(self, "N/m", sigma=self.sigma)

    def energy_density(self, kin: SurfaceKinematics, fields: Fields) -> Expr:
        """Sigma |J F^-T N| per reference area, J/m2 (2), (11)."""
        return kin.loaded(fields.value(self.sigma)) * kin.area_ratio
