"""Forces on rigid bodies as functions of state and time: F and N of (61), (62).

Each states a size (of a given force, a moment, a tension) and its derivatives; `loads.Loads` turns
them into forces and moments on the coordinates.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from dolfin_tongue.base.arrays import BoolArray, FloatArray
from dolfin_tongue.base.errors import (
    BadScene,
    OutOfRange,
    is_number,
    require_finite,
    require_not_negative,
    require_positive,
    require_vector,
)
from dolfin_tongue.control import Control, Instant, RememberingControl, Timed
from dolfin_tongue.control.sources import require_activation
from dolfin_tongue.rigid import plane
from dolfin_tongue.terms.mobilisation import StressMobilisation

Vector = tuple[float, float, float]

#: Name of what does not move, for the far end of a spring or muscle.
SKULL = "skull"


class RigidForce(Timed):
    """A force on one rigid body (`OwnForce`), or between two (`Line`)."""

    @property
    def resists(self) -> BoolArray:
        """Which motions of its body (x, z, angle) it may resist by its size, shape (3,)."""
        return np.zeros(3, dtype=bool)


@dataclass(frozen=True)
class _Controlled(RigidForce):
    """Base of forces whose size may follow a control."""

    control: Control | None = field(default=None, kw_only=True)

    def _level(self, now: Instant) -> float:
        return 1.0 if self.control is None else self.control.at(now.of("control"))

    def _check_control(self) -> None:
        control = self.control
        if control is not None and not isinstance(control, Control):
            raise BadScene(
                f"{type(self).__name__}.control must be a control, e.g. Ramp(1.0), not {control!r}"
            )

    @property
    def parts(self) -> Mapping[str, Timed]:
        """The control."""
        return {} if self.control is None else {"control": self.control}


class OwnForce(RigidForce, ABC):
    """A force that depends on the coordinates of its body alone."""

    @abstractmethod
    def generalised(
        self, now: Instant, q: FloatArray, v: FloatArray, reference: FloatArray
    ) -> FloatArray:
        """Force on (x, z, angle), N and N m, shape (3,).

        Parameters
        ----------
        now : time and memory.
        q, v : coordinates of the body and their rates, shape (3,).
        reference : place of its reference point at rest, m.
        """

    @abstractmethod
    def tangents(
        self, now: Instant, q: FloatArray, v: FloatArray, reference: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the derivatives of `generalised` by q and by v, (3, 3) each."""


@dataclass(frozen=True)
class PointForce(_Controlled, OwnForce):
    """A given force on a point of the body; it keeps its direction in space.

    Parameters
    ----------
    point : reference position of a point of the body, m.
    force : N; the lateral component y does nothing.
    control : factor over time; None: constant.
    """

    point: Vector
    force: Vector

    def __post_init__(self) -> None:
        require_vector(self, "point", self.point)
        require_vector(self, "force", self.force)
        self._check_control()

    @property
    def resists(self) -> BoolArray:
        """A turn."""
        return np.array([False, False, True])

    def _arm(self, reference: FloatArray) -> FloatArray:
        return (np.asarray(self.point, dtype=float) - reference)[None]

    def generalised(
        self, now: Instant, q: FloatArray, v: FloatArray, reference: FloatArray
    ) -> FloatArray:
        """Return the force, and its moment about the reference point."""
        push = self._level(now) * np.asarray(self.force, dtype=float)
        r = plane.turned(self._arm(reference), q[2])[0]
        return np.array([push[0], push[2], r[2] * push[0] - r[0] * push[2]])

    def tangents(
        self, now: Instant, q: FloatArray, v: FloatArray, reference: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the turning of its arm."""
        by_q, by_v = np.zeros((2, 3, 3))
        bent = plane.bend(self._arm(reference), q)[0]
        by_q[2, 2] = self._level(now) * float(bent @ np.asarray(self.force, dtype=float))
        return by_q, by_v


@dataclass(frozen=True)
class Moment(_Controlled, OwnForce):
    """A given moment about y.

    Parameters
    ----------
    moment : N m, positive lifts what lies in front.
    control : factor over time; None: constant.
    """

    moment: float

    def __post_init__(self) -> None:
        require_finite(self, moment=self.moment)
        self._check_control()

    def generalised(
        self, now: Instant, q: FloatArray, v: FloatArray, reference: FloatArray
    ) -> FloatArray:
        """Return the moment."""
        return np.array([0.0, 0.0, self._level(now) * self.moment])

    def tangents(
        self, now: Instant, q: FloatArray, v: FloatArray, reference: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return zeros."""
        return np.zeros((3, 3)), np.zeros((3, 3))


@dataclass(frozen=True)
class AngularSpring(OwnForce):
    """Torsion spring and damper about the reference point: -k (angle - rest) - c angle'.

    Parameters
    ----------
    stiffness : k, N m/rad, >= 0.
    damping : c, N m s/rad, >= 0.
    rest : rad.
    """

    stiffness: float
    damping: float = 0.0
    rest: float = 0.0

    def __post_init__(self) -> None:
        require_not_negative(self, "N m/rad", stiffness=self.stiffness)
        require_not_negative(self, "N m s/rad", damping=self.damping)
        require_finite(self, rest=self.rest)

    @property
    def resists(self) -> BoolArray:
        """A turn."""
        return np.array([False, False, True])

    def generalised(
        self, now: Instant, q: FloatArray, v: FloatArray, reference: FloatArray
    ) -> FloatArray:
        """Return the moment."""
        moment = -self.stiffness * (q[2] - self.rest) - self.damping * v[2]
        return np.array([0.0, 0.0, moment])

    def tangents(
        self, now: Instant, q: FloatArray, v: FloatArray, reference: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return minus stiffness and damping."""
        by_q, by_v = np.zeros((2, 3, 3))
        by_q[2, 2], by_v[2, 2] = -self.stiffness, -self.damping
        return by_q, by_v


@dataclass(frozen=True)
class StateForce(OwnForce):
    """Any force on (x, z, angle) as a function of time and state.

    Parameters
    ----------
    function : (t, q, v) -> three numbers (N, N, N m), with q = (x, z, angle) and its rate v. Its
        derivatives are taken by central differences, so that it must be smooth.
    """

    function: Callable[[float, FloatArray, FloatArray], FloatArray]

    def __post_init__(self) -> None:
        if not callable(self.function):
            raise BadScene(f"StateForce takes a function of (t, q, v), not {self.function!r}")
        try:
            value = np.asarray(self.function(0.0, np.zeros(3), np.zeros(3)), dtype=float)
        except Exception as error:  # whatever a user's function does
            raise BadScene(
                "StateForce.function must give three finite numbers (N, N, N m); at rest it raises "
                f"{error!r}"
            ) from error
        if value.shape != (3,) or not np.isfinite(value).all():
            raise BadScene("StateForce.function must give three finite numbers (N, N, N m)")

    @property
    def resists(self) -> BoolArray:
        """All, for what is known of a function."""
        return np.ones(3, dtype=bool)

    def generalised(
        self, now: Instant, q: FloatArray, v: FloatArray, reference: FloatArray
    ) -> FloatArray:
        """Return the values of the function."""
        return np.asarray(self.function(now.time, q, v), dtype=float)

    def tangents(
        self, now: Instant, q: FloatArray, v: FloatArray, reference: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return central differences."""

        def force(q: FloatArray, v: FloatArray) -> FloatArray:
            return np.asarray(self.function(now.time, q, v), dtype=float)

        step = 1e-6 * np.eye(3)
        by_q = np.array([force(q + s, v) - force(q - s, v) for s in step]).T / 2e-6
        by_v = np.array([force(q, v + s) - force(q, v - s) for s in step]).T / 2e-6
        return by_q, by_v


@dataclass(frozen=True)
class Line(RigidForce, ABC):
    """Base of what pulls along the straight line between two points.

    Parameters
    ----------
    point : reference position of a point of the body, m.
    anchor : reference position of the far end, m.
    to : the body of the far end; default the skull.
    """

    point: Vector
    anchor: Vector
    to: str = field(default=SKULL, kw_only=True)

    def __post_init__(self) -> None:
        require_vector(self, "point", self.point)
        require_vector(self, "anchor", self.anchor)
        if self.length == 0:
            raise OutOfRange(f"{type(self).__name__}.anchor", self.anchor, "apart from the point")
        if not isinstance(self.to, str):
            raise BadScene(
                f"{type(self).__name__}.to must be the name of a rigid body or {SKULL!r}, not "
                f"{self.to!r}"
            )

    @property
    def length(self) -> float:
        """Length in the reference configuration, m."""
        return float(np.linalg.norm(np.subtract(self.anchor, self.point)))

    @property
    def stiff(self) -> bool:
        """Whether it may resist a change of its length."""
        return True

    @abstractmethod
    def tension(self, now: Instant, length: float, rate: float) -> tuple[float, float, float]:
        """Tension, N, with its derivatives by length, N/m, and by its rate, N s/m."""


@dataclass(frozen=True)
class Spring(Line):
    """A spring and damper in parallel.

    Parameters
    ----------
    point, anchor, to : see `Line`.
    stiffness : N/m, >= 0.
    damping : N s/m, >= 0.
    rest : length without force, m; default the length in the reference configuration.
    """

    stiffness: float = 0.0
    damping: float = 0.0
    rest: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        require_not_negative(self, "N/m", stiffness=self.stiffness)
        require_not_negative(self, "N s/m", damping=self.damping)
        if self.rest is not None:
            require_not_negative(self, "m", rest=self.rest)

    @property
    def stiff(self) -> bool:
        """Whether it is more than a damper."""
        return self.stiffness > 0

    def tension(self, now: Instant, length: float, rate: float) -> tuple[float, float, float]:
        """Tension and its derivatives."""
        rest = self.length if self.rest is None else self.rest
        value = self.stiffness * (length - rest) + self.damping * rate
        return value, self.stiffness, self.damping


@dataclass(frozen=True)
class LineMuscle(Line):
    """A muscle as a line, with the dependence on stretch and rate of the tissue's muscles (73).

    Parameters
    ----------
    point, anchor, to : see `Line`.
    max_force : at full activation, N, > 0.
    activation : control, in [0, 1].
    law : dependence on stretch and stretch rate (74)-(78).
    """

    max_force: float = 1.0
    activation: Control | None = None
    law: StressMobilisation = field(default_factory=StressMobilisation)

    def __post_init__(self) -> None:
        super().__post_init__()
        require_positive(self, "N", max_force=self.max_force)
        if not isinstance(self.activation, Control):
            raise BadScene(
                f"LineMuscle.activation must be a control, e.g. Ramp(0.5), not {self.activation!r}"
            )
        if not isinstance(self.activation, RememberingControl):
            for time in (0.0, *self.activation.breakpoints):
                require_activation(self.activation(time), f"activation at t = {time:g} s")
        law = self.law
        if not (isinstance(law, StressMobilisation) and all(map(is_number, law.numbers.values()))):
            raise BadScene(f"LineMuscle.law must be StressMobilisation of numbers, not {law!r}")

    def level(self, now: Instant) -> float:
        """Activation at an instant, in [0, 1]."""
        assert self.activation is not None
        level = self.activation.at(now.of("activation"))
        require_activation(level, f"activation at t = {now.time:g} s")
        return level

    def tension(self, now: Instant, length: float, rate: float) -> tuple[float, float, float]:
        """Tension and its derivatives, by central differences of the two factors."""
        level = self.level(now)
        l0, law, step = self.length, self.law, 1e-6

        def slope(function: Callable[[float], float], x: float) -> float:
            return (function(x + step) - function(x - step)) / (2 * step)

        stretch, speed = length / l0, rate / l0
        f, g = law.length_factor(stretch), law.rate_factor(speed)
        force = level * self.max_force
        by_length = force * slope(law.length_factor, stretch) * g / l0
        return force * f * g, by_length, force * f * slope(law.rate_factor, speed) / l0

    @property
    def parts(self) -> Mapping[str, Timed]:
        """The activation."""
        return {} if self.activation is None else {"activation": self.activation}
