"""The few errors of the package; each also derives from the built-in error that fits it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import isfinite
from numbers import Real
from typing import Any

import numpy as np


class TongueError(Exception):
    """Base of all errors that dolfin_tongue raises on purpose."""


class UnknownName(TongueError, KeyError):
    """A region, muscle or point name that the body does not have.

    Parameters
    ----------
    kind : what sort of name, e.g. ``"muscle"``.
    name : the name that was asked for.
    available : the names that exist.
    """

    def __init__(self, kind: str, name: str, available: Iterable[str]):
        known = ", ".join(sorted(available)) or "(none)"
        self.message = f"unknown {kind} {name!r}; known {kind} names: {known}"
        super().__init__(self.message)

    def __str__(self) -> str:  # KeyError would print the repr
        return self.message


class OutOfRange(TongueError, ValueError):
    """A number outside the interval in which it makes sense.

    Parameters
    ----------
    name : the quantity.
    value : the number that was given.
    allowed : the interval in words, e.g. ``"[0, 1]"`` or ``"> 0"``.
    unit : SI unit, empty if dimensionless.
    """

    def __init__(self, name: str, value: Any, allowed: str, unit: str = ""):
        unit = f" {unit}" if unit else ""
        goal = f"{allowed}{unit if allowed[-1:].isdigit() else ''}"
        super().__init__(f"{name} = {value}{unit} is not allowed: it must be {goal}")


class BadMesh(TongueError, ValueError):
    """A mesh or fibre field that cannot be simulated; the message lists the offenders."""


class BadScene(TongueError, ValueError):
    """Terms, controls or supports that contradict each other or leave a scene undetermined."""


class NoDirectForce(TongueError, NotImplementedError):
    """A term, or a law of one, that the direct solver does not implement.

    Parameters
    ----------
    term : the term or law that was refused.
    """

    def __init__(self, term: object):
        super().__init__(
            f"the direct solver has no force for {type(term).__name__}, whatever it derives from; "
            "remove it from the scene or use the FEniCSx solver"
        )


@dataclass(frozen=True)
class Diagnosis:
    """Where a solver lost convergence.

    Parameters
    ----------
    text : where, and what to try.
    cells : the most distorted ones at the last accepted state.
    smallest_ratio : smallest det F there.
    largest_stretch : largest principal stretch there.
    """

    text: str
    cells: tuple[int, ...] = ()
    smallest_ratio: float = 1.0
    largest_stretch: float = 1.0


class NotConverged(TongueError, RuntimeError):
    """The nonlinear solver lost convergence and could not recover by smaller steps.

    Parameters
    ----------
    reason : PETSc's name of the reason, or the solver's own words.
    time : time reached, s (load factor in statics).
    diagnosis : where, and what to try.
    """

    def __init__(self, reason: str, time: float, diagnosis: Diagnosis | str):
        found = Diagnosis(diagnosis) if isinstance(diagnosis, str) else diagnosis
        self.reason, self.time, self.diagnosis = reason, time, found
        super().__init__(f"no convergence beyond t = {time:.6g}: {reason}. {found.text}")


def listing(items: Iterable[Any], limit: int = 20) -> str:
    """Join items for a message, cut after `limit` of them with the number left out."""
    items = list(items)
    text = ", ".join(str(item) for item in items[:limit])
    return text + (f", ... ({len(items) - limit} more)" if len(items) > limit else "")


def is_number(value: Any) -> bool:
    """Whether a value is a finite real number (no text, no truth value, no array)."""
    return isinstance(value, Real) and not isinstance(value, bool) and isfinite(value)


def require_flags(owner: object, **flags: Any) -> None:
    """Raise OutOfRange unless every value is True or False: the text "no" would count as yes."""
    for name, value in flags.items():
        if not isinstance(value, bool | np.bool_):
            raise OutOfRange(f"{type(owner).__name__}.{name}", repr(value), "True or False")


def require_positive(owner: object, unit: str, **numbers: Any) -> None:
    """Raise OutOfRange unless every number is finite and > 0."""
    for name, value in numbers.items():
        if not (is_number(value) and value > 0):
            raise OutOfRange(f"{type(owner).__name__}.{name}", value, "a finite number > 0", unit)


def require_not_negative(owner: object, unit: str, **numbers: Any) -> None:
    """Raise OutOfRange unless every number is finite and >= 0."""
    for name, value in numbers.items():
        if not (is_number(value) and value >= 0):
            raise OutOfRange(f"{type(owner).__name__}.{name}", value, "a finite number >= 0", unit)


def require_vector(owner: object, name: str, value: Any) -> None:
    """Raise OutOfRange unless the value has three finite components."""
    parts = value.tolist() if isinstance(value, np.ndarray) else value
    if not (isinstance(parts, tuple | list) and len(parts) == 3 and all(map(is_number, parts))):
        raise OutOfRange(f"{type(owner).__name__}.{name}", value, "three finite numbers")


def require_finite(owner: object, **numbers: Any) -> None:
    """Raise OutOfRange unless every number is finite."""
    for name, value in numbers.items():
        if not is_number(value):
            raise OutOfRange(f"{type(owner).__name__}.{name}", value, "a finite number")
