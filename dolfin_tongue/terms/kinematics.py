"""Large-deformation kinematics in UFL: equations (1), (3), (4), (30) of the report."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import ufl

#: Any UFL expression (UFL ships no usable types).
Expr = Any


@dataclass(frozen=True, eq=False)
class Kinematics:
    """What the terms of a scene may ask of the motion at a point.

    Parameters
    ----------
    displacement : UFL vector u, m.
    dx : volume measure of the reference body with the quadrature rule of the scene.
    number : turns a float into a UFL constant, so that a new value needs no new compilation.
    velocity : UFL vector v, m/s; None in a static problem, where every rate is absent.
    load : UFL factor in [0, 1] that statics raises in steps; None in dynamics.

    Notes
    -----
    F = I + grad u (1), C = F^T F, J = det F. ``C_iso`` = J^(-2/3) C is the isochoric part (Flory
    1961) and ``E_iso`` = (C_iso - I)/2: the derivative of an energy of E_iso is deviatoric by
    construction. At J = 1 it equals the deviator (36) of dW/dE; where a cell keeps its volume only
    in the mean, it still derives from an energy, which the projected stress does not.
    """

    displacement: Expr
    dx: ufl.Measure
    number: Callable[[float], Expr]
    velocity: Expr | None = None
    load: Expr | None = None
    F: Expr = field(init=False)
    J: Expr = field(init=False)
    C: Expr = field(init=False)
    C_iso: Expr = field(init=False)
    E_iso: Expr = field(init=False)

    def __post_init__(self) -> None:
        identity = ufl.Identity(3)
        deformation_gradient = ufl.variable(identity + ufl.grad(self.displacement))
        right_cauchy_green = deformation_gradient.T * deformation_gradient
        jacobian = ufl.det(deformation_gradient)
        isochoric = jacobian ** (-2.0 / 3.0) * right_cauchy_green
        for name, value in (
            ("F", deformation_gradient),
            ("J", jacobian),
            ("C", right_cauchy_green),
            ("C_iso", isochoric),
            ("E_iso", (isochoric - identity) / 2),
        ):
            object.__setattr__(self, name, value)

    @property
    def static(self) -> bool:
        """Whether the motion has no rates."""
        return self.velocity is None

    @property
    def E_rate(self) -> Expr:
        """Rate of the Green strain, sym(F^T grad v), 1/s (4)."""
        return ufl.sym(self.F.T * ufl.grad(self.velocity))

    @property
    def D(self) -> Expr:
        """Rate of deformation, the symmetric spatial velocity gradient, 1/s (4)."""
        return ufl.sym(ufl.grad(self.velocity) * ufl.inv(self.F))

    @property
    def normal(self) -> Expr:
        """Outward unit normal N of the reference surface; in integrals over a surface only."""
        return ufl.FacetNormal(self.dx.ufl_domain())

    @property
    def area_ratio(self) -> Expr:
        """Deformed over reference area of the surface, |J F^-T N| (2); cofactors need no 1/J."""
        image = ufl.cofac(self.F) * self.normal
        return ufl.sqrt(ufl.inner(image, image))

    @property
    def surface_C_trace(self) -> Expr:
        """Trace of the surface's right Cauchy-Green tensor, a^ab A_ab = tr C - N.C N (7), (8)."""
        return ufl.tr(self.C) - ufl.inner(self.normal, self.C * self.normal)

    def stretch(self, fibre: Expr) -> Expr:
        """Fibre stretch sqrt(N.C N) of a unit vector N of the reference body (30)."""
        return ufl.sqrt(ufl.inner(fibre, self.C * fibre))

    def stretch_rate(self, fibre: Expr) -> Expr:
        """Rate of the fibre stretch, N.E_rate N / stretch, 1/s, positive in lengthening (30)."""
        return ufl.inner(fibre, self.E_rate * fibre) / self.stretch(fibre)

    def loaded(self, expression: Expr) -> Expr:
        """Scale a load (gravity, active stress) by the load factor where there is one."""
        return expression if self.load is None else self.load * expression

    def power(self, first_piola: Expr, test: Expr) -> ufl.Form:
        """Virtual stress power, integral of P : grad w over the reference body, W (26)."""
        return ufl.inner(first_piola, ufl.grad(test)) * self.dx
