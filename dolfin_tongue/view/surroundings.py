"""What surrounds the tissue in pictures: walls that it touches or slides on, and bones.

Walls are cut out around the places where the body comes by. A wall stands before the body or
behind it, as the viewer sees it: where it turns its free side to the viewer the body is in front of
it; where it turns it away it would hide the body, and is drawn as a faint veil.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from PIL import Image

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.body.body import Body
from dolfin_tongue.body.state import State
from dolfin_tongue.boundary.contact import Contact
from dolfin_tongue.scene.scene import Scene
from dolfin_tongue.view.bones import Skeleton
from dolfin_tongue.view.camera import Camera
from dolfin_tongue.view.palette import BONE_INKS, SLATE, Colour
from dolfin_tongue.view.walls import Sheet, Wall

#: How far walls are drawn beyond the body, over its longest side.
MARGIN = 0.25


@dataclass(frozen=True)
class Surroundings:
    """Walls and bones; false if there are none.

    Parameters
    ----------
    walls : rigid surfaces.
    skeleton : rigid bodies with their springs and muscles; None where there are none.
    """

    walls: tuple[Wall, ...] = ()
    skeleton: Skeleton | None = None

    @classmethod
    def of(cls, scene: Scene) -> Surroundings:
        """Those of a scene: obstacles of `Contact`, surfaces of `Sliding`, rigid bodies."""
        contacts: list[Contact] = []
        for term in scene.terms:
            # Two laws on one obstacle are two terms; the obstacle is one.
            if isinstance(term, Contact) and not any(
                term.obstacle is other.obstacle and term.motion == other.motion
                for other in contacts
            ):
                contacts.append(term)
        walls = [Wall(term.obstacle, term.shift) for term in contacts]
        walls += [Wall(part.surface, colour=SLATE) for part in scene.sliding]
        bones = scene.rigid_bodies
        return cls(tuple(walls), Skeleton(scene.body, bones) if bones else None)

    def __bool__(self) -> bool:
        """Whether there is anything to draw."""
        return bool(self.walls) or self.skeleton is not None

    def near(self, body: Body, states: Sequence[State]) -> Neighbourhood:
        """Cut out what is near a body in all of some states."""
        moved = [body.points + state.displacement for state in states]
        corners = np.array([[x.min(axis=0), x.max(axis=0)] for x in moved])
        margin = MARGIN * (corners[:, 1] - corners[:, 0]).max()
        middle = float(body.points[:, 1].min() + body.points[:, 1].max()) / 2
        placed = []
        for wall in self.walls:
            shifts = np.array([_shift(wall, state) for state in states])
            low = (corners[:, 0] - shifts).min(axis=0) - margin
            high = (corners[:, 1] - shifts).max(axis=0) + margin
            sheet = wall.sheet(low, high, middle)
            if sheet is not None:
                placed.append((wall, sheet))
        return Neighbourhood(placed, self.skeleton)


class Neighbourhood:
    """Surroundings as far as they are drawn.

    Parameters
    ----------
    placed : walls and what is drawn of them.
    skeleton : bones, or None.
    """

    def __init__(self, placed: Sequence[tuple[Wall, Sheet]] = (), skeleton: Skeleton | None = None):
        self.sheets = [sheet for _, sheet in placed]
        self.skeleton = skeleton
        self._walls = [wall for wall, _ in placed]

    def shifts(self, state: State) -> FloatArray:
        """Return the translation of each sheet in a state, shape (s, 3), m."""
        return np.array([_shift(wall, state) for wall in self._walls]).reshape(-1, 3)

    @property
    def inks(self) -> list[Colour]:
        """Colours of thin lines."""
        inks = list(dict.fromkeys(sheet.ink for sheet in self.sheets))
        return inks + (BONE_INKS if self.skeleton is not None else [])

    def clouds(self, states: Sequence[State]) -> list[FloatArray]:
        """Points that a camera has to see, each of shape (k, 3), m."""
        clouds = []
        if self.sheets:
            for shifts in np.unique([self.shifts(state) for state in states], axis=0):
                pairs = zip(self.sheets, shifts, strict=True)
                clouds += [sheet.points + shift for sheet, shift in pairs]
        if self.skeleton is not None:
            clouds += [self.skeleton.cloud(state) for state in states]
        return clouds

    def draw(self, image: Image.Image, camera: Camera, state: State) -> Image.Image:
        """Draw the bones over a rendered frame; return the picture."""
        if self.skeleton is None:
            return image
        return self.skeleton.draw(image, camera, state)


def _shift(wall: Wall, state: State) -> FloatArray:
    """Return the shift of a wall in a state, m; in statics it grows with the load."""
    return state.load * wall.shift(state.time)[0]
