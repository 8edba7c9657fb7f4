"""Large-deformation kinematics in UFL: equations (1), (3), (4), (30) of the report."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property
from typing import Any

import ufl
from ufl.classes import Grad, Variable

from dolfin_tongue.base.errors import BadScene

#: Any UFL expression (UFL ships no usable types).
Expr = Any


class Deformation:
    """What terms may ask of the motion of the tissue or of one of its surfaces.

    Parameters
    ----------
    state : UFL coefficient of the unknowns; its first three components are the displacement.
    rate : coefficient of its rate; None in a static problem, where every rate is absent.
    dx : measure of the reference body (of a surface: of that), with its quadrature rule.
    number : turns a float into a UFL constant, so that a new value needs no new compilation.
    load : UFL factor in [0, 1] that statics raises in steps; None in dynamics.
    """

    def __init__(
        self,
        state: Expr,
        rate: Expr | None,
        dx: ufl.Measure,
        number: Callable[[float], Expr],
        load: Expr | None = None,
    ):
        self.state, self.dx, self.number, self.load = state, dx, number, load
        self.displacement = ufl.as_vector([state[i] for i in range(3)])
        self.velocity = None if rate is None else ufl.as_vector([rate[i] for i in range(3)])

    @cached_property
    def F(self) -> Expr:
        """Deformation gradient I + grad u (1)."""
        return ufl.variable(ufl.Identity(3) + ufl.grad(self.displacement))

    @property
    def static(self) -> bool:
        """Whether the motion has no rates."""
        return self.velocity is None

    def loaded(self, expression: Expr) -> Expr:
        """Scale a load (gravity, active stress) by the load factor where there is one."""
        return expression if self.load is None else self.load * expression

    def power(self, first_piola: Expr, test: Expr) -> ufl.Form:
        """Virtual stress power, integral of P : grad w over the reference body, W (26)."""
        return ufl.inner(first_piola, ufl.grad(test)) * self.dx

    def by_F(self, density: Expr) -> Expr | None:
        """dW/dF of an energy density; None where it does not depend on `F`.

        Raises
        ------
        BadScene : the density holds a deformation gradient of its own, which hides its stress.
        """
        parts = list(_nodes(density, self.F))
        if any(isinstance(part, Grad) for part in parts):
            raise BadScene(
                "an energy density takes the gradient of the displacement by itself, so that its "
                "stress dW/dF is not known; state it with kin.F"
            )
        return ufl.diff(density, self.F) if self.F in parts else None

    def through_F(self, density: Expr) -> bool:
        """Whether an energy density depends on the state through `F` alone."""
        parts = list(_nodes(density, self.F))
        return self.F in parts and self.state not in parts

    def derivative(self, form: ufl.Form, test: Expr) -> ufl.Form:
        """Take the derivative of a form along a velocity w, with all other unknowns kept."""
        others = self.state.ufl_shape[0] - 3
        along = ufl.as_vector([*(test[i] for i in range(3)), *([0] * others)])
        return ufl.derivative(form, self.state, along)


class Kinematics(Deformation):
    """Kinematics of the tissue.

    F = I + grad u (1), C = F^T F, J = det F. ``C_iso`` = J^(-2/3) C is the isochoric part (Flory
    1961) and ``E_iso`` = (C_iso - I)/2: the derivative of an energy of E_iso is deviatoric by
    construction. At J = 1 it equals the deviator (36) of dW/dE; where a cell keeps its volume only
    in the mean, it still derives from an energy, which the projected stress does not.
    """

    @cached_property
    def J(self) -> Expr:
        """Volume ratio det F."""
        return ufl.det(self.F)

    @cached_property
    def C(self) -> Expr:
        """Right Cauchy-Green tensor F^T F."""
        return self.F.T * self.F

    @cached_property
    def C_iso(self) -> Expr:
        """Isochoric part J^(-2/3) C."""
        return self.J ** (-2.0 / 3.0) * self.C

    @cached_property
    def E_iso(self) -> Expr:
        """Green strain of the isochoric part, (C_iso - I)/2."""
        return (self.C_iso - ufl.Identity(3)) / 2

    @property
    def E_rate(self) -> Expr:
        """Rate of the Green strain, sym(F^T grad v), 1/s (4)."""
        return ufl.sym(self.F.T * ufl.grad(self.velocity))

    @property
    def D(self) -> Expr:
        """Rate of deformation, the symmetric spatial velocity gradient, 1/s (4)."""
        return ufl.sym(ufl.grad(self.velocity) * ufl.inv(self.F))

    def stretch(self, fibre: Expr) -> Expr:
        """Fibre stretch sqrt(N.C N) of a unit vector N of the reference body (30)."""
        return ufl.sqrt(ufl.inner(fibre, self.C * fibre))

    def stretch_rate(self, fibre: Expr) -> Expr:
        """Rate of the fibre stretch, N.E_rate N / stretch, 1/s, positive in lengthening (30)."""
        return ufl.inner(fibre, self.E_rate * fibre) / self.stretch(fibre)


class SurfaceKinematics(Deformation):
    """Kinematics of a surface of the tissue, on a mesh of its faces.

    F is I + the surface gradient of u: it maps tangents of the surface as the tissue does, and the
    normal N to itself. What needs the tissue below it (J, C_iso, D, a fibre stretch) is not known.
    """

    @cached_property
    def normal(self) -> Expr:
        """Outward unit normal N of the reference surface."""
        jacobian = ufl.Jacobian(self.dx.ufl_domain())
        tangents = [ufl.as_vector([jacobian[i, k] for i in range(3)]) for k in range(2)]
        normal = ufl.cross(*tangents)
        return normal / ufl.sqrt(ufl.inner(normal, normal))

    @cached_property
    def area_ratio(self) -> Expr:
        """Deformed over reference area of the surface, |J F^-T N| (2); cofactors need no 1/J."""
        image = self.area_vector
        return ufl.sqrt(ufl.inner(image, image))

    @cached_property
    def area_vector(self) -> Expr:
        """J F^-T N: the deformed normal times the area ratio (2)."""
        return ufl.cofac(self.F) * self.normal

    @cached_property
    def surface_C_trace(self) -> Expr:
        """Trace of the surface's right Cauchy-Green tensor, a^ab A_ab = tr C - N.C N (7), (8)."""
        image = self.F * self.normal
        return ufl.inner(self.F, self.F) - ufl.inner(image, image)

    def __getattr__(self, name: str) -> Any:
        """Refuse, by name, what only the tissue has."""
        if hasattr(Kinematics, name):
            raise BadScene(
                f"a surface does not know {name} of the tissue below it; a term on a surface may "
                "use displacement, velocity, F (tangential), normal, area_ratio, area_vector and "
                "surface_C_trace"
            )
        raise AttributeError(name)


def _nodes(expression: Expr, leaf: Expr) -> Iterator[Expr]:
    """All parts of an expression but those inside of a variable."""
    stack, seen = [expression], set()
    while stack:
        node = stack.pop()
        if node not in seen:
            seen.add(node)
            yield node
            if not (isinstance(node, Variable) and node == leaf):
                stack.extend(node.ufl_operands)
