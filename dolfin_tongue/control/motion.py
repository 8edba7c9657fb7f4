"""Prescribed motions: one coordinate over time with its first two derivatives."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from math import cos, pi, sin
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from dolfin_tongue.base.errors import BadScene, require_finite, require_positive
from dolfin_tongue.control.timed import Timed


class Motion(Timed, ABC):
    """A coordinate (m or rad) over time, with continuous velocity.

    Break points are times at which the acceleration is not smooth, jumps those at which it jumps.
    """

    @abstractmethod
    def at(self, time: float) -> tuple[float, float, float]:
        """Value, rate and acceleration at a time (s)."""


def check_motion(what: str, motion: Any) -> None:
    """Raise BadScene unless something is a motion and gives finite numbers at t = 0."""
    if isinstance(motion, type):
        raise BadScene(f"{what} is the class {motion.__name__}; make one, e.g. SmoothMove(0.01)")
    if not isinstance(motion, Motion):
        raise BadScene(
            f"{what} must be a motion, e.g. Still(), SmoothMove(0.01) or a class of your own that "
            f"derives from Motion, not {motion!r}"
        )
    try:
        found = np.asarray(motion.at(0.0), dtype=float)
        times = np.asarray(motion.breakpoints, dtype=float)
    except Exception as error:  # whatever a user's own motion does
        raise BadScene(f"{what}, {motion!r}, raises {error!r} at t = 0") from error
    if found.shape != (3,) or not np.isfinite(found).all():
        raise BadScene(
            f"{what}: at(0.0) must give three finite numbers, value, rate and acceleration, not "
            f"{found}"
        )
    if times.ndim != 1 or not np.isfinite(times).all():
        raise BadScene(f"{what}: breakpoints must be a tuple of times, s, not {times}")


@dataclass(frozen=True)
class Still(Motion):
    """No motion.

    Parameters
    ----------
    value : m or rad.
    """

    value: float = 0.0

    def __post_init__(self) -> None:
        require_finite(self, value=self.value)

    def at(self, time: float) -> tuple[float, float, float]:
        """Value, rate, acceleration."""
        return self.value, 0.0, 0.0


@dataclass(frozen=True)
class SmoothMove(Motion):
    """A move of minimum jerk (Flash and Hogan 1985): 10 s^3 - 15 s^4 + 6 s^5.

    Parameters
    ----------
    distance : from 0, m or rad.
    start : begin, s.
    duration : s, > 0.
    """

    distance: float
    start: float = 0.0
    duration: float = 0.2

    def __post_init__(self) -> None:
        require_finite(self, distance=self.distance, start=self.start)
        require_positive(self, "s", duration=self.duration)

    def at(self, time: float) -> tuple[float, float, float]:
        """Value, rate, acceleration."""
        T = self.duration
        s = min(1.0, max(0.0, (time - self.start) / T))
        value = s**3 * (10 - 15 * s + 6 * s * s)
        rate = 30 * s * s * (1 - s) ** 2 / T
        acceleration = 60 * s * (1 - s) * (1 - 2 * s) / T**2
        return self.distance * value, self.distance * rate, self.distance * acceleration

    @property
    def breakpoints(self) -> tuple[float, ...]:
        """Begin and end, s."""
        return (self.start, self.start + self.duration)


@dataclass(frozen=True)
class Swing(Motion):
    """Harmonic motion A (1 - cos(2 pi f t)) / 2, which starts from rest.

    Parameters
    ----------
    amplitude : between the ends, m or rad.
    frequency : Hz, > 0.
    """

    amplitude: float
    frequency: float

    def __post_init__(self) -> None:
        require_finite(self, amplitude=self.amplitude)
        require_positive(self, "Hz", frequency=self.frequency)

    def at(self, time: float) -> tuple[float, float, float]:
        """Value, rate, acceleration."""
        omega, half = 2 * pi * self.frequency, self.amplitude / 2
        phase = omega * time
        return half * (1 - cos(phase)), half * omega * sin(phase), half * omega**2 * cos(phase)


@dataclass(frozen=True)
class Recorded(Motion):
    """Recorded positions, interpolated by a cubic spline that rests at both ends.

    Parameters
    ----------
    times : s, strictly increasing, at least two.
    values : as many, m or rad; kept before and after.

    Raises
    ------
    BadScene : no numbers, different lengths, fewer than two, not finite, or times that do not
        increase.
    """

    times: tuple[float, ...]
    values: tuple[float, ...]

    def __post_init__(self) -> None:
        for name in ("times", "values"):
            try:
                numbers = tuple(float(x) for x in getattr(self, name))
            except (TypeError, ValueError) as error:
                raise BadScene(f"{name} of a recorded motion must be numbers: {error}") from error
            object.__setattr__(self, name, numbers)
        if len(self.times) != len(self.values) or len(self.times) < 2:
            raise BadScene(
                f"a recorded motion needs as many times as values and at least two, not "
                f"{len(self.times)} times and {len(self.values)} values"
            )
        if not (np.isfinite(self.times).all() and np.isfinite(self.values).all()):
            raise BadScene("times and values of a recorded motion must be finite")
        if not (np.diff(self.times) > 0).all():
            raise BadScene("the times of a recorded motion must increase")

    @cached_property
    def _spline(self) -> CubicSpline:
        return CubicSpline(self.times, self.values, bc_type="clamped")

    def at(self, time: float) -> tuple[float, float, float]:
        """Value, rate, acceleration."""
        if not self.times[0] <= time <= self.times[-1]:
            return (self.values[0] if time < self.times[0] else self.values[-1]), 0.0, 0.0
        value, rate, acceleration = (float(self._spline(time, order)) for order in range(3))
        return value, rate, acceleration

    @property
    def breakpoints(self) -> tuple[float, ...]:
        """First and last time, s."""
        return (self.times[0], self.times[-1])
