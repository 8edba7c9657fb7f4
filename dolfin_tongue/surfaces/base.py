"""What a rigid surface is: g(y) = 0, positive on its free side (49), (58)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

import numpy as np

from dolfin_tongue.base.arrays import FloatArray, real_numbers
from dolfin_tongue.base.errors import BadMesh, BadScene


@dataclass(frozen=True, eq=False)
class Gap:
    """Signed distance of points to a surface, with its first and second derivatives.

    Parameters
    ----------
    distance : ndarray, shape (k,), m -- positive on the free side; inf where the surface does not
        reach (beyond the rim of a sheet).
    normal : ndarray, shape (k, 3) -- gradient of the distance; a unit vector, away from the wall.
    curvature : ndarray, shape (k, 3, 3), 1/m -- second derivatives of the distance.
    """

    distance: FloatArray
    normal: FloatArray
    curvature: FloatArray


def require_surface(what: str, value: Any) -> None:
    """Raise BadScene unless the value is a surface (and not its class)."""
    if not isinstance(value, Surface):
        raise BadScene(f"{what} must be a surface, e.g. Plane(), not {value!r}")


def require_places(what: str, value: Any) -> FloatArray:
    """Array of places, shape (k, 3), m; BadMesh for other shapes and what is not finite."""
    places = real_numbers(what, value)
    if places.ndim != 2 or places.shape[1] != 3 or not np.isfinite(places).all():
        raise BadMesh(f"{what} must be finite and of shape (k, 3), not {places.shape}")
    return places


class Surface(ABC):
    """A fixed rigid surface, given by an implicit function g that grows towards its free side."""

    @property
    def has_rim(self) -> bool:
        """Whether a body can get behind it round a rim without passing it."""
        return False

    @abstractmethod
    def value(self, points: FloatArray) -> FloatArray:
        """Return g at points of shape (k, 3), m; shape (k,), zero on the surface (49)."""

    @abstractmethod
    def gradient(self, points: FloatArray) -> FloatArray:
        """First derivatives of g, shape (k, 3); never zero near the surface."""

    @abstractmethod
    def hessian(self, points: FloatArray) -> FloatArray:
        """Second derivatives of g (52), shape (k, 3, 3)."""

    def gap(self, points: FloatArray) -> Gap:
        """Signed distance (58) with its derivatives; here for a g that is that distance itself."""
        return Gap(self.value(points), self.gradient(points), self.hessian(points))

    def project(self, points: FloatArray) -> FloatArray:
        """Points of the surface near given ones, shape (k, 3), m; Newton along the gradient."""
        found = np.array(points, dtype=float)
        for _ in range(50):
            value, gradient = self.value(found), self.gradient(found)
            move = (value / (gradient**2).sum(axis=1))[:, None] * gradient
            found -= move
            if not move.size or np.abs(move).max() < 1e-14:
                break
        return found
