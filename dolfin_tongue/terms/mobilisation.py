"""Stress mobilisation: how active stress depends on fibre stretch and its rate (74) to (78)."""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from dolfin_tongue.base.elementary import exp, log
from dolfin_tongue.base.errors import OutOfRange
from dolfin_tongue.base.values import as_value, require_positive_values

#: Numbers that are the same for all muscles and known as they are.
_NUMERIC = (float, int, np.ndarray, np.generic)


@dataclass(frozen=True)
class StressMobilisation:
    """Dependence of the active stress on fibre stretch (74), (75) and stretch rate (76)-(78).

    Parameters
    ----------
    a, b : shape of f(stretch), dimensionless; a > 0, b > 1. The maximum of f is 1 at stretch 1.
    y0 : g at rest, in (0, 1).
    y1 : g at the stretch rate -rate1, in (0, y0).
    rate1 : 1/s, > 0.

    Each may be any `base.values.Value`: a number by muscle, an array over cells, a parameter.

    Notes
    -----
    (78) is printed with the opposite sign; here the coefficient is positive, so that shortening
    weakens the muscle: g(-rate1) = y1 < y0 = g(0).

    A law of your own overrides `length_factor` and `rate_factor`; with `elementary.exp` they take
    numbers, arrays and UFL expressions alike. The FEniCSx solver computes it, the direct one, which
    has the derivatives by hand, refuses it.
    """

    #: What follows from the numbers; computed before a form is made where they are known.
    derived: ClassVar[tuple[str, ...]] = ("shift", "scale", "rate_offset", "rate_slope")

    a: Any = 3.0
    b: Any = 5.0
    y0: Any = 0.7
    y1: Any = 0.2
    rate1: Any = 25.0

    def __post_init__(self) -> None:
        require_positive_values(self, "", a=self.a)
        require_positive_values(self, "1/s", rate1=self.rate1)
        for name, allowed, fits in (
            ("b", "> 1", lambda x: x > 1),
            ("y0", "in (0, 1)", lambda x: (x > 0) & (x < 1)),
            ("y1", "in (0, 1)", lambda x: (x > 0) & (x < 1)),
        ):
            value = as_value(
                f"{type(self).__name__}.{name}", getattr(self, name), "", allowed, fits
            )
            object.__setattr__(self, name, value)
        self.require_order(self.y0, self.y1)

    def require_order(self, y0: Any, y1: Any) -> None:
        """Raise OutOfRange unless y1 < y0 everywhere; mappings and parameters are passed."""
        known = isinstance(y0, _NUMERIC) and isinstance(y1, _NUMERIC)
        if known and not np.all(np.less(y1, y0)):
            raise OutOfRange("(y1, y0)", (y1, y0), "such that 0 < y1 < y0 < 1")

    @cached_property
    def shift(self) -> Any:
        """Shift s of (75), which puts the maximum of f at stretch 1."""
        return log(self.b - 1) / (self.a * self.b)

    @cached_property
    def scale(self) -> Any:
        """Factor c of (75), which makes the maximum of f equal 1."""
        return self.b * (self.b - 1) ** (1 / self.b - 1)

    @cached_property
    def rate_offset(self) -> Any:
        """Coefficient b of (77)."""
        return log(self.y0 / (1 - self.y0))

    @cached_property
    def rate_slope(self) -> Any:
        """Coefficient a of (78) with the sign corrected, s."""
        return log(self.y0 * (1 - self.y1) / (self.y1 * (1 - self.y0))) / self.rate1

    def length_factor(self, stretch: Any) -> Any:
        """f(stretch, 1) of (74), dimensionless; of numbers, arrays or UFL."""
        shifted = self.a * (stretch - 1 + self.shift)
        # (74) multiplied through by exp(b shifted): both exponents fall for a short fibre, so that
        # neither overflows at small stretch.
        return self.scale * exp((self.b - 1) * shifted) / (exp(self.b * shifted) + 1)

    def rate_factor(self, stretch_rate: Any) -> Any:
        """g(stretch_rate) of (76): a sigmoid from 0 (shortening) to 1 (lengthening)."""
        return 1 / (1 + exp(-self.rate_offset - self.rate_slope * stretch_rate))

    @property
    def numbers(self) -> dict[str, Any]:
        """Its fields by name."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    @property
    def all_numbers(self) -> dict[str, Any]:
        """Its fields, and what follows from them, by name; for numbers and arrays."""
        return self.numbers | {name: getattr(self, name) for name in self.derived}

    def bound(self, numbers: Mapping[str, Any]) -> StressMobilisation:
        """Return the same law with other numbers: arrays, or UFL expressions.

        Parameters
        ----------
        numbers : fields, and what follows from them where it shall not be computed anew.
        """
        law = copy(self)
        for name in self.derived:
            law.__dict__.pop(name, None)
        law.__dict__.update(numbers)
        return law
