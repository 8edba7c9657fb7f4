"""What a term is: a frozen piece of physics that a scene lists.

A term holds numbers and names. It states its physics once, in UFL (loaded when a form is made, so
that a scene can be written and solved by the direct solver without it); the direct solver has a
part of its own for the same class. What a scene does not list is not compiled, stored or evaluated.

Which base to take for a law of your own: a stress, `StressTerm`; an energy per volume,
`EnergyTerm`, or per area of a surface, `SurfaceTerm`; anything else, `FormTerm`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

import numpy as np

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.base.errors import BadScene
from dolfin_tongue.base.values import Value
from dolfin_tongue.body.body import Body
from dolfin_tongue.body.regions import CellValues, on_cells
from dolfin_tongue.control.timed import Instant, Timed

if TYPE_CHECKING:  # UFL
    from dolfin_tongue.terms.kinematics import Deformation, Kinematics

#: Any UFL expression or form (UFL ships no usable types).
Expr = Any
Form = Any


class Fields(Protocol):
    """What the FEniCSx solver lends to a term: numbers and values on cells as UFL expressions."""

    body: Body

    def value(self, value: Value, what: str = "a value") -> Expr:
        """Value of a law: a constant, or a coefficient; see `base.values`."""

    def resolved(self, values: CellValues) -> Expr:
        """Values that have been spread over cells, or over cells and fibre slots."""

    def on_cells(self, values: FloatArray) -> Expr:
        """UFL coefficient of values on cells.

        Parameters
        ----------
        values : ndarray of shape (m,), (m, k) for a vector of k components, or (m, q, k) with
            values at the quadrature points.
        """

    def varying(self, values: Callable[[Instant], FloatArray], components: int = 0) -> Expr:
        """UFL coefficient of values on cells that are evaluated anew at each new instant.

        Parameters
        ----------
        values : of an instant, with the term's own memory: ndarray of shape (m,) or (m, k).
        components : k, or 0 for scalars.
        """


class Term(Timed, ABC):
    """Base of all terms.

    Attributes
    ----------
    numbers : names of the fields that are a `Value` on cells.
    """

    numbers: ClassVar[tuple[str, ...]] = ()

    @property
    def domain(self) -> str | None:
        """Name of the surface on which it acts, its field `surface`; None for the volume."""
        return getattr(self, "surface", None)

    def check(self, body: Body) -> None:
        """Refuse names and numbers that do not fit the body, before any solve."""
        for name in self.numbers:
            on_cells(f"{type(self).__name__}.{name}", getattr(self, name), body)


class FormTerm(Term):
    """A term that does (virtual) power, stated as a UFL form."""

    @abstractmethod
    def virtual_power(self, kin: Any, fields: Fields, test: Expr) -> Form | None:
        """State internal minus external virtual power of the test velocity, W.

        Returns None where the term has no part (a rate term in a static scene).

        Parameters
        ----------
        kin : `Kinematics` of the volume, or `SurfaceKinematics` of the term's surface.
        fields : coefficients.
        test : the test velocity w, or a velocity.
        """

    def energy(self, kin: Any, fields: Fields) -> Form | None:
        """Potential energy of the whole body, J; None for a term without one."""
        return None


class StressTerm(FormTerm):
    """A term that is a stress in the tissue."""

    @abstractmethod
    def first_piola(self, kin: Kinematics, fields: Fields) -> Expr | None:
        """First Piola-Kirchhoff stress P, shape (3, 3), Pa; None where the term has no part."""

    def virtual_power(self, kin: Kinematics, fields: Fields, test: Expr) -> Form | None:
        """Integral of P : grad w (26)."""
        stress = self.first_piola(kin, fields)
        return None if stress is None else kin.power(stress, test)


class EnergyTerm(FormTerm):
    """A term that derives from an energy density W of the deformation or of the displacement."""

    #: Whether it resists deformation, so that a static body has an equilibrium.
    elastic: ClassVar[bool] = True

    @abstractmethod
    def energy_density(self, kin: Any, fields: Fields) -> Expr:
        """Energy per reference volume, J/m3 (of a `SurfaceTerm`: per reference area, J/m2)."""

    def energy(self, kin: Deformation, fields: Fields) -> Form:
        """Integral of W, J."""
        return self.energy_density(kin, fields) * kin.dx

    def first_piola(self, kin: Kinematics, fields: Fields) -> Expr | None:
        """Stress dW/dF (29), (39), Pa; None for an energy that does not depend on `kin.F`."""
        return kin.by_F(self.energy_density(kin, fields))

    def virtual_power(self, kin: Deformation, fields: Fields, test: Expr) -> Form:
        """Take the derivative of the energy along w, the integral of dW/dF : grad w (29), (39).

        An energy may depend on the displacement itself, not on F alone; then its derivative by the
        whole state is taken.
        """
        density = self.energy_density(kin, fields)
        if kin.through_F(density):
            return kin.power(kin.by_F(density), test)
        return kin.derivative(density * kin.dx, test)


class SurfaceTerm(EnergyTerm):
    """An energy per reference area of a named surface of the body, W in J/m2.

    `kin` is a `SurfaceKinematics`, which knows the tangential part of F only: take
    `kin.area_ratio` and `kin.surface_C_trace`, `kin.normal` and `kin.displacement`.
    """

    #: Name of the surface; a field of the dataclass.
    surface: str

    def check(self, body: Body) -> None:
        """Refuse a surface that the body does not have."""
        super().check(body)
        body.surface(self.surface)
        for name in self.numbers:
            if np.ndim(getattr(self, name)) == 2:
                raise BadScene(
                    f"{type(self).__name__}.{name} has values at the quadrature points of cells, "
                    "which a surface does not have; give one value for each cell"
                )
