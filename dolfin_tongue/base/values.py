"""Values: what a number of a law may be.

A number; a mapping by region or muscle, whose key "elsewhere" stands for all that is not named; an
array over cells, shape (m,), or over cells and quadrature points, shape (m, q); or a `Parameter`,
which can be changed by its name without building anything anew.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any, TypeAlias

import numpy as np

from dolfin_tongue.base.arrays import FloatArray, real_numbers
from dolfin_tongue.base.errors import BadScene, OutOfRange, is_number

#: The key of a mapping for all that it does not name.
ELSEWHERE = "elsewhere"


@dataclass(frozen=True)
class Parameter:
    """A named number. All parameters of one name in a scene are one, and need the same value.

    Parameters
    ----------
    name : e.g. ``"stiffness of the gland"``.
    value : a finite number.
    """

    name: str
    value: float

    def __post_init__(self) -> None:
        if not (isinstance(self.name, str) and self.name):
            raise BadScene(f"a parameter needs a name, not {self.name!r}")
        if not is_number(self.value):
            raise OutOfRange(f"parameter {self.name!r}", self.value, "a finite number")


Number: TypeAlias = float | Parameter
Value: TypeAlias = Number | Mapping[str, Number] | FloatArray


def parameters_of(value: Any) -> Iterator[Parameter]:
    """Parameters in a value, a term or a law, however deep."""
    if isinstance(value, Parameter):
        yield value
    elif isinstance(value, Mapping):
        for part in value.values():
            yield from parameters_of(part)
    elif is_dataclass(value) and not isinstance(value, type):
        for field in fields(value):
            yield from parameters_of(getattr(value, field.name))


def with_parameters(value: Any, numbers: Mapping[str, float]) -> Any:
    """Return a value, term or law with other numbers for some of its parameters."""
    if isinstance(value, Parameter):
        return Parameter(value.name, numbers.get(value.name, value.value))
    if not any(parameter.name in numbers for parameter in parameters_of(value)):
        return value
    if isinstance(value, Mapping):
        return {name: with_parameters(part, numbers) for name, part in value.items()}
    changed = {f.name: with_parameters(getattr(value, f.name), numbers) for f in fields(value)}
    return replace(value, **changed)


def at_least_one(value: Any) -> bool:
    """Whether some number in a value is not 0: a term may then be left out of a form."""
    if isinstance(value, Mapping | Parameter):
        return True
    return bool(np.any(value))


def as_value(what: str, value: Any, unit: str, allowed: str, fits: Callable[[Any], Any]) -> Value:
    """Check a value and return it, sequences as arrays of their own.

    Parameters
    ----------
    what : for messages, e.g. ``"ReportTissue.a0"``.
    value : what was given.
    unit : SI unit, empty if dimensionless.
    allowed : the condition in words, e.g. ``"> 0"``.
    fits : the condition, of numbers and of arrays.

    Raises
    ------
    OutOfRange : a number that is not finite or does not fit; the message says which.
    BadScene : an empty mapping, or keys that are no names.
    """
    if isinstance(value, Mapping):
        if not value or not all(isinstance(name, str) for name in value):
            raise BadScene(
                f"{what} must map names of regions or muscles to numbers, e.g. "
                f'{{"gland": 2000.0, "{ELSEWHERE}": 500.0}}, not {value!r}'
            )
        for name, part in value.items():
            _check_number(f"{what} of {name!r}", part, unit, allowed, fits)
        return dict(value)
    if isinstance(value, np.ndarray | list | tuple):
        array = real_numbers(what, value)
        wrong = np.argwhere(~(np.isfinite(array) & fits(array)))
        if array.ndim not in (1, 2) or not array.size:
            raise BadScene(
                f"{what} must be a number, or an array over cells, shape (m,), or over cells and "
                f"quadrature points, shape (m, q), not of shape {array.shape}"
            )
        if len(wrong):
            place, number = tuple(int(i) for i in wrong[0]), array[tuple(wrong[0])]
            where = f"{what} in cell {place[0]}"
            raise OutOfRange(where, number, f"a finite number {allowed}", unit)
        array = array.copy()
        array.setflags(write=False)
        return array
    _check_number(what, value, unit, allowed, fits)
    return value


def _check_number(
    what: str, value: Any, unit: str, allowed: str, fits: Callable[[Any], Any]
) -> None:
    number = value.value if isinstance(value, Parameter) else value
    if not (is_number(number) and fits(number)):
        raise OutOfRange(what, value, f"a finite number {allowed}", unit)


def require_positive_values(owner: object, unit: str, **values: Any) -> None:
    """Raise OutOfRange unless every number of every value is finite and > 0; arrays are kept."""
    for name, value in values.items():
        what = f"{type(owner).__name__}.{name}"
        object.__setattr__(owner, name, as_value(what, value, unit, "> 0", lambda x: x > 0))


def require_not_negative_values(owner: object, unit: str, **values: Any) -> None:
    """Raise OutOfRange unless every number of every value is finite and >= 0; arrays are kept."""
    for name, value in values.items():
        what = f"{type(owner).__name__}.{name}"
        object.__setattr__(owner, name, as_value(what, value, unit, ">= 0", lambda x: x >= 0))
