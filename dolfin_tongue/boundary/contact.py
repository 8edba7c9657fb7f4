"""Contact of a surface of the body with a rigid obstacle: the palate (58)-(60)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from dolfin_tongue.base.arrays import BoolArray, FloatArray
from dolfin_tongue.base.errors import BadScene, OutOfRange, is_number, listing, require_positive
from dolfin_tongue.body.body import Body
from dolfin_tongue.body.faces import BOUNDARY, corners_of
from dolfin_tongue.control import Timed
from dolfin_tongue.control.motion import Motion, check_motion
from dolfin_tongue.surfaces.base import Gap, Surface
from dolfin_tongue.terms.term import Term


class ContactLaw(ABC):
    """Traction along the normal of the obstacle, per reference area, positive in compression."""

    #: Gap at and beyond which the traction vanishes, m.
    range: float
    #: Whether the traction depends on the rate of the gap. One that does not derives from `energy`,
    #: and is stated at the end of a step.
    rate_dependent: ClassVar[bool] = False

    @abstractmethod
    def traction(
        self, gap: FloatArray, rate: FloatArray | None
    ) -> tuple[FloatArray, FloatArray, FloatArray | float]:
        """Traction t, Pa, dt/dgap, Pa/m, and dt/drate, Pa s/m; each of shape (k,).

        Parameters
        ----------
        gap : ndarray, shape (k,), m.
        rate : ndarray, shape (k,), m/s -- (59); None for a law that is not `rate_dependent`.
        """

    def energy(self, gap: FloatArray) -> FloatArray:
        """Energy per reference area, J/m2, with t = -d(energy)/d(gap); zero for a law of rates."""
        return np.zeros_like(gap)


@dataclass(frozen=True)
class Barrier(ContactLaw):
    """A traction without bound as the gap closes, p (r/h - 1)^2 for h < r: nothing comes through.

    Below h = r / `steep` it goes on as its tangent, so that an iterate of Newton's method that
    overshoots finds its way back; the traction there, p (steep - 1)^2, is beyond any that muscles
    can make, and no step that ends with h <= 0 is accepted.

    Parameters
    ----------
    range : r, m, > 0; the resting distance of touching surfaces is of this size.
    pressure : p, Pa, > 0: the traction at half the range.
    steep : see above, > 2.
    """

    range: float = 2e-4
    pressure: float = 1e3
    steep: float = 50.0

    def __post_init__(self) -> None:
        require_positive(self, "m", range=self.range)
        require_positive(self, "Pa", pressure=self.pressure)
        if not (is_number(self.steep) and self.steep > 2):
            raise OutOfRange("Barrier.steep", self.steep, "> 2")

    def traction(
        self, gap: FloatArray, rate: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray, float]:
        """Traction, Pa, its slope, Pa/m, and 0."""
        r, p = self.range, self.pressure
        kept = np.clip(gap, r / self.steep, r)
        slope = -2 * p * (r / kept - 1) * r / kept**2
        value = p * (r / kept - 1) ** 2 + slope * np.minimum(gap - kept, 0.0)
        return value, slope, 0.0

    def energy(self, gap: FloatArray) -> FloatArray:
        """Energy per reference area, J/m2."""
        r, p = self.range, self.pressure
        kept = np.clip(gap, r / self.steep, r)
        value, slope, _ = self.traction(kept)
        beyond = np.minimum(gap - kept, 0.0)
        whole = p * (r * r / kept - kept - 2 * r * np.log(r / kept))
        return whole - value * beyond - 0.5 * slope * beyond**2


@dataclass(frozen=True)
class ReportContact(ContactLaw):
    """The report's inelastic law (60): t = 2 a1 |h - h_eps|^a2 |h'|^a3 while the gap closes.

    Zero while the gap opens or rests: a steady push creeps through. List a `Contact` with a
    `Barrier` beside it to stop that.

    Parameters
    ----------
    a1 : Pa / (m^a2 (m/s)^a3), > 0.
    a2, a3 : >= 1.
    range : h_eps, m, > 0.
    """

    rate_dependent: ClassVar[bool] = True
    a1: float = 1e8
    a2: float = 1.0
    a3: float = 1.0
    range: float = 1e-3

    def __post_init__(self) -> None:
        require_positive(self, "", a1=self.a1)
        require_positive(self, "m", range=self.range)
        for name in ("a2", "a3"):
            value = getattr(self, name)
            if not (is_number(value) and value >= 1):
                raise OutOfRange(f"ReportContact.{name}", value, ">= 1")

    def traction(
        self, gap: FloatArray, rate: FloatArray | None
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Traction, Pa, and its slopes by gap, Pa/m, and rate, Pa s/m."""
        assert rate is not None
        depth, closing = np.maximum(self.range - gap, 0.0), np.maximum(-rate, 0.0)
        near, speed = 2 * self.a1 * depth**self.a2, closing**self.a3
        by_gap = -2 * self.a1 * self.a2 * depth ** (self.a2 - 1) * (depth > 0) * speed
        by_rate = -near * self.a3 * closing ** (self.a3 - 1) * (closing > 0)
        return near * speed, by_gap, by_rate


def in_front(gap: Gap, behind: BoolArray) -> Gap:
    """Gap without the points that were behind a sheet before and still are; inf for them.

    A point that comes up behind a rim is all at once deep in the wall by its signed distance.
    """
    gone = behind & (gap.distance <= 0)
    if not gone.any():
        return gap
    return Gap(
        np.where(gone, np.inf, gap.distance), np.where(gone[:, None], 0.0, gap.normal),
        np.where(gone[:, None, None], 0.0, gap.curvature),
    )  # fmt: skip


@dataclass(frozen=True)
class Contact(Term):
    """A surface of the body that cannot pass a rigid obstacle; frictionless.

    The traction t of the law acts along the normal n of the obstacle at each quadrature point of
    the reference surface; virtual power -int t(h, h') n.w dA.

    Parameters
    ----------
    obstacle : its free side is where the body is.
    surface : name of a surface of the body; the whole boundary if not named.
    law : `Barrier` or `ReportContact`.
    motion : prescribed translation of the obstacle along x, y, z, m; None: it stands still.

    Raises
    ------
    UnknownName : a surface that the body does not have.
    BadScene : no obstacle, law or motion; surface points behind the obstacle at rest, or where it
        has no distance.
    """

    obstacle: Surface
    surface: str = BOUNDARY
    law: ContactLaw = Barrier()
    motion: tuple[Motion, Motion, Motion] | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.obstacle, Surface):
            raise BadScene(f"Contact takes a surface first, e.g. Plane(), not {self.obstacle!r}")
        if not isinstance(self.surface, str):
            raise BadScene(f"Contact.surface must be the name of one, not {self.surface!r}")
        if not isinstance(self.law, ContactLaw):
            raise BadScene(f"Contact.law must be a law such as Barrier(), not {self.law!r}")
        if not (is_number(getattr(self.law, "range", None)) and self.law.range > 0):
            raise BadScene(
                f"{type(self.law).__name__}.range must be the gap (m, > 0) beyond which there is "
                "no traction"
            )
        if self.motion is not None and not (
            isinstance(self.motion, tuple) and len(self.motion) == 3
        ):
            raise BadScene(
                "Contact.motion must be three motions for x, y, z, e.g. "
                "(Still(), Still(), SmoothMove(-0.005))"
            )
        for axis, part in zip("xyz", self.motion or (), strict=False):
            check_motion(f"Contact.motion along {axis}", part)

    def check(self, body: Body) -> None:
        """Refuse an unknown surface, and points of it that start behind the obstacle."""
        corners = body.points[corners_of(body.surface(self.surface))]
        edges = (corners + np.roll(corners, 1, axis=1)) / 2
        points = np.concatenate([*corners, *edges, corners.mean(axis=1)])
        points = np.unique(points, axis=0)
        distance = self.obstacle.gap(points - self.shift(0.0)[0]).distance
        if np.isnan(distance).any():
            raise BadScene(
                f"the obstacle, {type(self.obstacle).__name__}, has no distance (NaN) at points of "
                f"the surface {self.surface!r}: {listing(points[np.isnan(distance)], 3)}; it must "
                "be defined there"
            )
        behind = np.count_nonzero(~(distance > 0))
        if behind:
            raise BadScene(
                f"{behind} of {len(points)} points (nodes, middles of edges and faces) of the "
                f"surface {self.surface!r} start on or behind the obstacle, the deepest by "
                f"{abs(distance.min()):.3g} m. Move body or obstacle, or turn the obstacle round "
                "if its free side is the other one"
            )

    def shift(self, time: float) -> tuple[FloatArray, FloatArray]:
        """Return the translation of the obstacle, m, and its velocity, m/s, each of shape (3,)."""
        if self.motion is None:
            return np.zeros(3), np.zeros(3)
        parts = np.array([part.at(time) for part in self.motion])
        return parts[:, 0], parts[:, 1]

    @property
    def parts(self) -> Mapping[str, Timed]:
        """The obstacle's motion."""
        return dict(zip("xyz", self.motion or (), strict=False))
