"""Active muscle stress: (34) with the stress mobilisation (73)-(78)."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from math import exp, log
from typing import Any

import numpy as np
import ufl

from dolfin_tongue.base.errors import BadScene, OutOfRange, require_positive
from dolfin_tongue.body.body import Body
from dolfin_tongue.body.fibres import SPECIFIC_TENSION
from dolfin_tongue.control import Control
from dolfin_tongue.control.sources import require_activation
from dolfin_tongue.terms.kinematics import Expr, Kinematics
from dolfin_tongue.terms.term import Fields, Term


@dataclass(frozen=True)
class StressMobilisation:
    """Dependence of the active stress on fibre stretch (74), (75) and stretch rate (76)-(78).

    Parameters
    ----------
    a, b : shape of f(stretch), dimensionless; a > 0, b > 1. The maximum of f is 1 at stretch 1.
    y0 : g at rest, in (0, 1).
    y1 : g at the stretch rate -rate1, in (0, y0).
    rate1 : 1/s, > 0.

    Notes
    -----
    (78) is printed with the opposite sign; here the coefficient is positive, so that shortening
    weakens the muscle: g(-rate1) = y1 < y0 = g(0).
    """

    a: float = 3.0
    b: float = 5.0
    y0: float = 0.7
    y1: float = 0.2
    rate1: float = 25.0

    def __post_init__(self) -> None:
        require_positive(self, "", a=self.a)
        require_positive(self, "1/s", rate1=self.rate1)
        if not self.b > 1:
            raise OutOfRange("StressMobilisation.b", self.b, "> 1")
        if not 0 < self.y1 < self.y0 < 1:
            raise OutOfRange("(y1, y0)", (self.y1, self.y0), "such that 0 < y1 < y0 < 1")

    @property
    def shift(self) -> float:
        """Shift s of (75), which puts the maximum of f at stretch 1."""
        return log(self.b - 1) / (self.a * self.b)

    @property
    def scale(self) -> float:
        """Factor c of (75), which makes the maximum of f equal 1."""
        return self.b * (self.b - 1) ** (1 / self.b - 1)

    @property
    def rate_offset(self) -> float:
        """Coefficient b of (77)."""
        return log(self.y0 / (1 - self.y0))

    @property
    def rate_slope(self) -> float:
        """Coefficient a of (78) with the sign corrected, s."""
        return log(self.y0 * (1 - self.y1) / (self.y1 * (1 - self.y0))) / self.rate1

    def length_factor(self, stretch: Any, number: Any = float, exp: Any = np.exp) -> Any:
        """f(stretch, 1) of (74), dimensionless; floats and arrays, or UFL with its `exp`."""
        a, b, s, c = (number(x) for x in (self.a, self.b, self.shift, self.scale))
        shifted = a * (stretch - 1 + s)
        # (74) multiplied through by exp(b shifted): both exponents fall for a short fibre, so that
        # neither overflows at small stretch.
        return c * exp((b - 1) * shifted) / (exp(b * shifted) + 1)

    def rate_factor(self, stretch_rate: Any, number: Any = float, exp: Any = np.exp) -> Any:
        """g(stretch_rate) of (76): a sigmoid from 0 (shortening) to 1 (lengthening)."""
        a, b = number(self.rate_slope), number(self.rate_offset)
        return 1 / (1 + exp(-b - a * stretch_rate))


@dataclass(frozen=True)
class FibreStress(Term):
    """Base of the stresses along muscle fibres under given activations.

    Parameters
    ----------
    activation : activation over time of each muscle that takes part, values in [0, 1]. Muscles of
        the body that are not named take no part and cost nothing.
    max_stress : stress at full activation, Pa; which measure, the subclass says.
    """

    activation: Mapping[str, Control]
    max_stress: float = SPECIFIC_TENSION

    def __post_init__(self) -> None:
        require_positive(self, "Pa", max_stress=self.max_stress)
        if not isinstance(self.activation, Mapping):
            raise BadScene(
                f"{type(self).__name__}: activation must map names of muscles to controls, e.g. "
                '{"styloglossus": Ramp(0.5)}'
            )
        for name, control in self.activation.items():
            if isinstance(control, type) or not isinstance(control, Control):
                raise BadScene(
                    f"the activation of {name!r} is {control!r}, which is no control; use "
                    "Constant(level), Ramp(level), Table(times, values) or an object like them"
                )
        if not self.activation:
            raise BadScene(
                f"{type(self).__name__} without muscles: leave the term out of the scene instead"
            )

    def check(self, body: Body) -> None:
        """Raise UnknownName for a muscle that the body does not have."""
        for name in self.activation:
            body.fibres[name]

    @property
    def names(self) -> tuple[str, ...]:
        """Muscles that take part, in the order of the activation vector."""
        return tuple(self.activation)

    def activations(self, time: float) -> np.ndarray:
        """Activation vector at a time (s), shape (len(names),)."""
        values = {name: control(time) for name, control in self.activation.items()}
        for name, value in values.items():
            require_activation(value, f"activation of {name!r} at t = {time:g} s")
        return np.array(list(values.values()), dtype=float)

    @property
    def breakpoints(self) -> tuple[float, ...]:
        """Times at which an activation is not smooth, s."""
        return tuple(t for control in self.activation.values() for t in control.breakpoints)

    @property
    def jumps(self) -> tuple[float, ...]:
        """Times at which an activation jumps, s."""
        return tuple(t for control in self.activation.values() for t in control.jumps)

    def virtual_power(self, kin: Kinematics, fields: Fields, test: Expr) -> ufl.Form:
        """Integral of P : grad w, with one summand per slot, not per muscle."""
        slots = fields.body.fibres.slots(self.names, len(fields.body.cells))
        fibres = fields.on_cells(slots.directions.reshape(len(slots.directions), -1))
        level = fields.varying_on_cells(lambda t: slots.level(self.activations(t)))
        stress = ufl.zero(3, 3)
        for slot in range(slots.count):
            fibre = ufl.as_vector([fibres[3 * slot + i] for i in range(3)])
            share = level[slot] if slots.count > 1 else level
            tension = kin.loaded(kin.number(self.max_stress) * share)
            stress += self.slot_stress(kin, fibre, tension)
        return kin.power(stress, test)

    @abstractmethod
    def slot_stress(self, kin: Kinematics, fibre: Expr, tension: Expr) -> Expr:
        """First Piola-Kirchhoff stress (Pa) of one slot.

        Parameters
        ----------
        kin : the motion.
        fibre : unit vector N.
        tension : max_stress times density times activation, Pa.
        """


@dataclass(frozen=True)
class ActiveMuscles(FibreStress):
    """Active stress of muscles (31)-(34), (73).

    S = sum_m tau_m J / stretch^2 N x N, made deviatoric by (36), with
    tau = max_stress density activation f(stretch) g(stretch rate). `max_stress` is the Cauchy
    stress at full activation, optimal length and fast lengthening.

    Parameters
    ----------
    law : the two factors f and g.
    """

    law: StressMobilisation = field(default_factory=StressMobilisation)

    def slot_stress(self, kin: Kinematics, fibre: Expr, tension: Expr) -> Expr:
        """First Piola-Kirchhoff stress F S_dev of one slot, Pa (34), (36)."""
        stretch = kin.stretch(fibre)
        tension *= self.law.length_factor(stretch, kin.number, ufl.exp)
        if kin.static:
            tension *= kin.number(exp(self.law.rate_offset) / (1 + exp(self.law.rate_offset)))
        else:
            rate = kin.stretch_rate(fibre)
            tension *= self.law.rate_factor(rate, kin.number, ufl.exp)
        # F (N x N - (N.C N)/3 C^-1) = FN x N - stretch^2/3 F^-T, times J tau / stretch^2.
        along = ufl.outer(kin.F * fibre, fibre) / stretch**2
        return kin.J * tension * (along - ufl.inv(kin.F).T / 3)


@dataclass(frozen=True)
class ConstantFibreStress(FibreStress):
    """Constant second Piola-Kirchhoff stress along the fibres, S = T N x N with its spherical part.

    The active law of other programs (FEBio's prescribed active contraction), for comparisons:
    T = max_stress density activation depends neither on the stretch nor on its rate, and the Cauchy
    stress T stretch^2 n x n grows with the stretch.
    """

    def slot_stress(self, kin: Kinematics, fibre: Expr, tension: Expr) -> Expr:
        """First Piola-Kirchhoff stress T (F N) x N of one slot, Pa."""
        return tension * ufl.outer(kin.F * fibre, fibre)
