"""Activations as functions of time: constant, step, ramp, table."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from dolfin_tongue.base.errors import BadScene, OutOfRange, is_number
from dolfin_tongue.body.body import Body
from dolfin_tongue.body.state import State
from dolfin_tongue.control.timed import Instant, Memory, Timed


class Control(Timed, ABC):
    """A number over time."""

    @abstractmethod
    def __call__(self, time: float) -> float:
        """Value at a time (s); at a jump the value after it."""

    def at(self, now: Instant) -> float:
        """Value at an instant."""
        return self(now.time)


class RememberingControl(Control):
    """A number that depends on the motion so far: a filter of another control, a reflex.

    A subclass states `begin`, `advance` and `at`; see `control.timed`.
    """

    @abstractmethod
    def begin(self, body: Body, state: State) -> Memory:
        """Memory at the beginning of a motion."""

    @abstractmethod
    def advance(self, memory: Memory, body: Body, first: State, last: State) -> Memory:
        """Memory after a step that has been accepted; a new one."""

    @abstractmethod
    def at(self, now: Instant) -> float:
        """Value at an instant, from its memory; smooth in time until the next step."""

    def __call__(self, time: float) -> float:
        """Refuse: a time alone does not say."""
        raise BadScene(f"{type(self).__name__} depends on the motion so far, not on time alone")


def require_activation(value: float, what: str = "activation") -> None:
    """Raise OutOfRange unless the value lies in [0, 1] (NaN does not)."""
    if not (is_number(value) and 0.0 <= value <= 1.0):
        raise OutOfRange(what, value, "in [0, 1]")


def require_time(value: float, what: str) -> None:
    """Raise OutOfRange unless the time is finite."""
    if not is_number(value):
        raise OutOfRange(what, value, "finite", "s")


@dataclass(frozen=True)
class Constant(Control):
    """The same activation at all times.

    Parameters
    ----------
    level : in [0, 1].
    """

    level: float

    def __post_init__(self) -> None:
        require_activation(self.level)

    def __call__(self, time: float) -> float:
        """Activation at any time."""
        return self.level


@dataclass(frozen=True)
class Step(Control):
    """Activation that jumps from 0 to a level.

    Parameters
    ----------
    level : in [0, 1].
    start : time of the jump, s.
    """

    level: float
    start: float = 0.0

    def __post_init__(self) -> None:
        require_activation(self.level)
        require_time(self.start, "start")

    def __call__(self, time: float) -> float:
        """Activation at a time (s)."""
        return self.level if time >= self.start else 0.0

    @property
    def breakpoints(self) -> tuple[float, ...]:
        """The jump, s."""
        return (self.start,)

    @property
    def jumps(self) -> tuple[float, ...]:
        """The jump, s."""
        return (self.start,)


@dataclass(frozen=True)
class Ramp(Control):
    """Activation that rises linearly from 0 to a level and stays there.

    Parameters
    ----------
    level : in [0, 1].
    start : begin of the rise, s.
    duration : of the rise, s, > 0.
    """

    level: float
    start: float = 0.0
    duration: float = 0.05

    def __post_init__(self) -> None:
        require_activation(self.level)
        require_time(self.start, "start")
        if not (is_number(self.duration) and self.duration > 0):
            raise OutOfRange("duration", self.duration, "> 0 (use Step for a jump)", "s")

    def __call__(self, time: float) -> float:
        """Activation at a time (s)."""
        return self.level * min(1.0, max(0.0, (time - self.start) / self.duration))

    @property
    def breakpoints(self) -> tuple[float, ...]:
        """Begin and end of the rise, s."""
        return (self.start, self.start + self.duration)


@dataclass(frozen=True)
class SmoothRamp(Ramp):
    """Activation that rises as 3 s^2 - 2 s^3, without a kink in its slope.

    Parameters
    ----------
    level : in [0, 1].
    start : begin of the rise, s.
    duration : of the rise, s, > 0.
    """

    def __call__(self, time: float) -> float:
        """Activation at a time (s)."""
        s = min(1.0, max(0.0, (time - self.start) / self.duration))
        return self.level * s * s * (3 - 2 * s)


@dataclass(frozen=True)
class Table(Control):
    """Activation interpolated linearly between knots, constant outside.

    Parameters
    ----------
    times : s, strictly increasing.
    values : as many, in [0, 1].

    Raises
    ------
    BadScene : different lengths, no knots, or times that do not increase.
    OutOfRange : a value outside [0, 1] or NaN.
    """

    times: tuple[float, ...]
    values: tuple[float, ...]

    def __post_init__(self) -> None:
        if len(self.times) != len(self.values) or not len(self.times):
            raise BadScene(
                f"a table needs as many times as values and at least one, not {len(self.times)} "
                f"times and {len(self.values)} values"
            )
        for i, value in enumerate(self.values):
            require_activation(value, f"activation in row {i} of the table")
        for time in self.times:
            require_time(time, "time in a table")
        for i, (before, after) in enumerate(zip(self.times, self.times[1:], strict=False)):
            if not after > before:
                raise BadScene(
                    f"the times of a table must increase: row {i + 1} has {after} s after "
                    f"{before} s"
                )

    def __call__(self, time: float) -> float:
        """Activation at a time (s)."""
        return float(np.interp(time, self.times, self.values))

    @property
    def breakpoints(self) -> tuple[float, ...]:
        """Knots at which the slope changes, s."""
        slopes = np.diff(self.values) / np.diff(self.times)
        slopes = np.concatenate([[0.0], slopes, [0.0]])
        kinks = ~np.isclose(slopes[1:], slopes[:-1], rtol=1e-9, atol=1e-9)
        return tuple(float(t) for t in np.asarray(self.times)[kinks])
