"""A rigid body that carries tissue: mandible, hyoid (61), (62)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from dolfin_tongue.base.arrays import BoolArray, FloatArray, IntArray
from dolfin_tongue.base.errors import BadScene, require_positive, require_vector
from dolfin_tongue.base.units import LARGEST_SIZE
from dolfin_tongue.body.body import Body
from dolfin_tongue.control import Timed
from dolfin_tongue.control.motion import Motion, check_motion
from dolfin_tongue.rigid.forces import SKULL, Line, OwnForce, RigidForce
from dolfin_tongue.terms.labels import numbered
from dolfin_tongue.terms.support import Support

Vector = tuple[float, float, float]

#: The coordinates: displacement of the reference point along x and z, m, rotation about y, rad.
COORDINATES = ("x", "z", "angle")


@dataclass(frozen=True)
class RigidBody(Support):
    """A rigid body in the midsagittal plane, joined to the tissue at the nodes of its regions.

    The nodes move with the body; the body feels their summed force and moment. Gravity of the
    scene pulls on it too. Coordinates and signs: `rigid.plane`.

    Parameters
    ----------
    name : e.g. ``"mandible"``.
    regions : node regions of the tissue that are attached to it; may be empty.
    mass : kg, > 0.
    inertia : moment of inertia about the lateral axis through the centre of mass, kg m2, > 0.
    centre : reference position of the centre of mass, m.
    forces : springs, dampers, muscles, given forces.
    motion : prescribed coordinates, by name ("x", "z", "angle"): e.g. ``{"angle":
        SmoothMove(-0.17)}``; ``Still()`` holds one. The others follow from the forces.
    pivot : reference point of the coordinates, about which the body turns; default the centre.

    Raises
    ------
    OutOfRange : mass or inertia not > 0.
    BadScene : unknown coordinates, something that is no force or motion, a motion that does not
        start at zero, places in millimetres.
    UnknownName : a region that the body does not have.
    """

    name: str
    regions: tuple[str, ...]
    mass: float
    inertia: float
    centre: Vector
    forces: tuple[RigidForce, ...] = ()
    motion: Mapping[str, Motion] = field(default_factory=dict)
    pivot: Vector | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name or self.name == SKULL:
            raise BadScene(f"a rigid body needs a name of its own, not {self.name!r}")
        if not (
            isinstance(self.regions, tuple | list) and all(isinstance(r, str) for r in self.regions)
        ):
            raise BadScene(
                f'{self.name}: regions must be a tuple of names, e.g. ("jaw",), not '
                f"{self.regions!r}"
            )
        require_positive(self, "kg", mass=self.mass)
        require_positive(self, "kg m2", inertia=self.inertia)
        require_vector(self, "centre", self.centre)
        if self.pivot is not None:
            require_vector(self, "pivot", self.pivot)
        if not (
            isinstance(self.forces, tuple | list)
            and all(isinstance(force, OwnForce | Line) for force in self.forces)
        ):
            raise BadScene(
                f"{self.name}: forces must be a tuple of them, e.g. (Moment(0.1),); for a law of "
                f"your own take StateForce. Not {self.forces!r}"
            )
        if not isinstance(self.motion, Mapping):
            raise BadScene(
                f'{self.name}: motion must map coordinates to motions, e.g. {{"x": Still()}}, not '
                f"{self.motion!r}"
            )
        for coordinate, motion in self.motion.items():
            if coordinate not in COORDINATES:
                raise BadScene(
                    f"{self.name}: no coordinate {coordinate!r}; there are {', '.join(COORDINATES)}"
                )
            check_motion(f"{self.name}: the motion of {coordinate!r}", motion)

    @property
    def label(self) -> str:
        """What messages call it."""
        return self.name

    def check(self, body: Body) -> None:
        """Refuse a motion that does not start at zero (tissue would be torn), and millimetres."""
        for coordinate, motion in self.motion.items():
            if abs(motion.at(0.0)[0]) > 1e-12:
                raise BadScene(
                    f"{self.name}: the motion of {coordinate!r} must be 0 at t = 0, where the "
                    f"tissue is undeformed, not {motion.at(0.0)[0]:g}"
                )
        places = {"centre": self.centre, "pivot": self.reference}
        for force in self.forces:
            for name in ("point", "anchor"):
                if hasattr(force, name):
                    places[f"{name} of a {type(force).__name__}"] = getattr(force, name)
        middle = body.points.mean(axis=0)
        for name, place in places.items():
            away = float(np.linalg.norm(place - middle))
            if away > LARGEST_SIZE:
                raise BadScene(
                    f"{self.name}: the {name} {place} is {away:.3g} m from the tissue; coordinates "
                    "are metres: multiply by 1e-3 if yours are millimetres"
                )

    def nodes(self, body: Body) -> IntArray:
        """Attached nodes, each once."""
        found = [body.nodes(region) for region in self.regions]
        return np.unique(np.concatenate([*found, []]).astype(np.int64))

    @property
    def reference(self) -> FloatArray:
        """Reference position of the reference point, shape (3,), m."""
        return np.asarray(self.centre if self.pivot is None else self.pivot, dtype=float)

    def arms(self, points: FloatArray) -> FloatArray:
        """Return reference arms of points from the reference point, shape (k, 3), m."""
        return np.atleast_2d(points) - self.reference

    @property
    def given(self) -> BoolArray:
        """Mask of the prescribed coordinates, shape (3,)."""
        return np.array([name in self.motion for name in COORDINATES])

    def prescribed(self, time: float) -> FloatArray:
        """Value, rate and acceleration of each coordinate, shape (3, 3): order, coordinate.

        Zero for those that are free.
        """
        result = np.zeros((3, 3))
        for place, name in enumerate(COORDINATES):
            if name in self.motion:
                result[:, place] = self.motion[name].at(time)
        return result

    @property
    def named_forces(self) -> list[tuple[str, RigidForce]]:
        """Its forces, each with a name of its own."""
        names = numbered([type(force).__name__ for force in self.forces])
        return list(zip(names, self.forces, strict=True))

    @property
    def parts(self) -> Mapping[str, Timed]:
        """Its motion and forces."""
        return {**self.motion, **dict(self.named_forces)}
