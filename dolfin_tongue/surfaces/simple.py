"""Plane, sphere, cylinder: surfaces whose signed distance is a formula."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass

import numpy as np

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.base.errors import OutOfRange, require_flags, require_positive, require_vector
from dolfin_tongue.surfaces.base import Surface

Vector = tuple[float, float, float]


def unit(owner: object, name: str, value: Vector) -> FloatArray:
    """Return a direction as a unit vector; OutOfRange if it has no length."""
    require_vector(owner, name, value)
    vector = np.asarray(value, dtype=float)
    length = float(np.linalg.norm(vector))
    if length == 0:
        raise OutOfRange(f"{type(owner).__name__}.{name}", value, "a vector of some length")
    return vector / length


@dataclass(frozen=True)
class Plane(Surface):
    """A plane.

    Parameters
    ----------
    point : a point of it, m.
    normal : towards the free side, of any length.
    """

    point: Vector = (0.0, 0.0, 0.0)
    normal: Vector = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        require_vector(self, "point", self.point)
        unit(self, "normal", self.normal)

    def value(self, points: FloatArray) -> FloatArray:
        """Signed distance, m."""
        return (points - np.asarray(self.point)) @ unit(self, "normal", self.normal)

    def gradient(self, points: FloatArray) -> FloatArray:
        """Return the unit normal at every point."""
        return np.tile(unit(self, "normal", self.normal), (len(points), 1))

    def hessian(self, points: FloatArray) -> FloatArray:
        """Zero."""
        return np.zeros((len(points), 3, 3))


class Round(Surface):
    """Base of sphere and cylinder: a given radius from a centre or an axis."""

    radius: float
    inside: bool

    @property
    @abstractmethod
    def _middle(self) -> tuple[FloatArray, FloatArray]:
        """A point of the middle, and the projector across the axis (for a sphere: I)."""

    def _radial(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Distance from the middle and unit vector away from it."""
        point, across = self._middle
        arm = (points - point) @ across
        distance = np.maximum(np.linalg.norm(arm, axis=1), 1e-300)
        return distance, arm / distance[:, None]

    @property
    def _sign(self) -> float:
        return -1.0 if self.inside else 1.0

    def value(self, points: FloatArray) -> FloatArray:
        """Signed distance, m."""
        return self._sign * (self._radial(points)[0] - self.radius)

    def gradient(self, points: FloatArray) -> FloatArray:
        """Return unit vectors away from the middle, or to it."""
        return self._sign * self._radial(points)[1]

    def hessian(self, points: FloatArray) -> FloatArray:
        """Curvature 1/distance around the middle."""
        distance, away = self._radial(points)
        around = self._middle[1] - away[:, :, None] * away[:, None, :]
        return self._sign * around / distance[:, None, None]


@dataclass(frozen=True)
class Cylinder(Round):
    """An infinite circular cylinder.

    Parameters
    ----------
    point : a point of the axis, m.
    axis : direction of the axis, of any length.
    radius : m, > 0.
    inside : whether the inside is the free side (a pipe) and not the outside (a rod).
    """

    point: Vector
    axis: Vector
    radius: float
    inside: bool = False

    def __post_init__(self) -> None:
        require_vector(self, "point", self.point)
        unit(self, "axis", self.axis)
        require_positive(self, "m", radius=self.radius)
        require_flags(self, inside=self.inside)

    @property
    def _middle(self) -> tuple[FloatArray, FloatArray]:
        axis = unit(self, "axis", self.axis)
        return np.asarray(self.point, dtype=float), np.eye(3) - np.outer(axis, axis)


@dataclass(frozen=True)
class Sphere(Round):
    """A sphere.

    Parameters
    ----------
    centre : m.
    radius : m, > 0.
    inside : whether the inside is the free side (a bowl) and not the outside (a ball).
    """

    centre: Vector
    radius: float
    inside: bool = False

    def __post_init__(self) -> None:
        require_vector(self, "centre", self.centre)
        require_positive(self, "m", radius=self.radius)
        require_flags(self, inside=self.inside)

    @property
    def _middle(self) -> tuple[FloatArray, FloatArray]:
        return np.asarray(self.centre, dtype=float), np.eye(3)
