"""What a term is: a frozen piece of physics that a scene lists.

A term holds numbers and names. It states its virtual power once, in UFL; the direct solver has one
nodal force for the same class. What a scene does not list is not compiled, stored or evaluated.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Any, ClassVar, Protocol

import numpy as np
import ufl

from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.base.errors import OutOfRange, is_number
from dolfin_tongue.body.body import Body
from dolfin_tongue.terms.kinematics import Expr, Kinematics


class Fields(Protocol):
    """What the FEniCSx side lends to a term: values on cells, constant or varying in time."""

    body: Body

    def on_cells(self, values: FloatArray) -> Expr:
        """UFL coefficient that is constant in each cell; `values` of shape (m,) or (m, k)."""

    def varying_on_cells(self, values: Callable[[float], FloatArray]) -> Expr:
        """Like `on_cells`, with values that are evaluated anew at each time t, s."""

    def surface(self, name: str) -> ufl.Measure:
        """Measure dS of a named surface of the reference body, m2; UnknownName lists them."""


class Term(ABC):
    """Base of the terms that do (virtual) power."""

    def check(self, body: Body) -> None:
        """Refuse names and numbers that do not fit the body, before any solve."""

    @abstractmethod
    def virtual_power(self, kin: Kinematics, fields: Fields, test: Expr) -> ufl.Form | None:
        """State internal minus external virtual power of the test velocity, W.

        Returns None where the term has no part (a rate term in a static scene).
        """

    def energy(self, kin: Kinematics, fields: Fields) -> ufl.Form | None:
        """Potential energy of the whole body, J; None for a term without one."""
        return None

    @property
    def breakpoints(self) -> tuple[float, ...]:
        """Times (s) at which the term is not smooth; steps end there."""
        return ()

    @property
    def jumps(self) -> tuple[float, ...]:
        """Those of the break points at which the term itself jumps."""
        return ()


class EnergyTerm(Term):
    """A term that derives from an energy density W; its first Piola-Kirchhoff stress is dW/dF."""

    #: Whether it resists deformation, so that a static body has an equilibrium.
    elastic: ClassVar[bool] = True

    @abstractmethod
    def energy_density(self, kin: Kinematics, fields: Fields) -> Expr:
        """Energy per reference volume, J/m3 (of a `SurfaceTerm`: per reference area, J/m2)."""

    def measure(self, kin: Kinematics, fields: Fields) -> ufl.Measure:
        """Where the energy sits: the volume of the body."""
        return kin.dx

    def energy(self, kin: Kinematics, fields: Fields) -> ufl.Form:
        """Integral of W, J."""
        return self.energy_density(kin, fields) * self.measure(kin, fields)

    def virtual_power(self, kin: Kinematics, fields: Fields, test: Expr) -> ufl.Form:
        """Integral of dW/dF : grad w (29), (39): the derivative of the energy along w."""
        stress = ufl.diff(self.energy_density(kin, fields), kin.F)
        return ufl.inner(stress, ufl.grad(test)) * self.measure(kin, fields)


class SurfaceTerm(EnergyTerm):
    """An energy per reference area of a named surface of the body, W in J/m2.

    W depends on the tangential part of F only, `kin.area_ratio` and `kin.surface_C_trace`, so that
    dW/dF : grad w is the power of the membrane forces, S^ab dE_ab (14).
    """

    #: Name of the surface; a field of the dataclass.
    surface: str

    def check(self, body: Body) -> None:
        """Refuse a surface that the body does not have."""
        body.surface(self.surface)

    def measure(self, kin: Kinematics, fields: Fields) -> ufl.Measure:
        """Where the energy sits: the surface."""
        return fields.surface(self.surface)


class Support(ABC):
    """A kinematic condition on nodes; no node may belong to two of them."""

    @property
    def label(self) -> str:
        """What messages call it."""
        return type(self).__name__

    def check(self, body: Body) -> None:
        """Refuse names and numbers that do not fit the body, before any solve."""

    @abstractmethod
    def nodes(self, body: Body) -> IntArray:
        """Node numbers that it acts on."""

    @property
    def breakpoints(self) -> tuple[float, ...]:
        """Times (s) at which it is not smooth; steps end there."""
        return ()

    @property
    def jumps(self) -> tuple[float, ...]:
        """Those of the break points at which forces of it jump."""
        return ()


class Held(Support):
    """Nodes whose displacement is prescribed."""

    @abstractmethod
    def displacement(self, points: FloatArray, time: float) -> FloatArray:
        """Prescribed displacement of the nodes at a time.

        Parameters
        ----------
        points : ndarray, shape (k, 3), m -- reference positions of the nodes, in order of `nodes`.
        time : s.

        Returns
        -------
        ndarray, shape (k, 3), m.
        """


def require_vector(owner: object, name: str, value: Any) -> None:
    """Raise OutOfRange unless the value has three finite components."""
    parts = value.tolist() if isinstance(value, np.ndarray) else value
    if not (isinstance(parts, tuple | list) and len(parts) == 3 and all(map(is_number, parts))):
        raise OutOfRange(f"{type(owner).__name__}.{name}", value, "three finite numbers")


def labels_of(terms: Sequence[Term]) -> list[str]:
    """Class names of the terms in small letters, numbered where one occurs twice."""
    names = [type(term).__name__ for term in terms]
    labels = []
    for i, name in enumerate(names):
        suffix = f"_{names[: i + 1].count(name)}" if names.count(name) > 1 else ""
        words = "".join(f"_{c.lower()}" if c.isupper() else c for c in name).lstrip("_")
        labels.append(words + suffix)
    return labels
