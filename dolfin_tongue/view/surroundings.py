"""What surrounds the tissue in pictures: walls that it touches or slides on, and bones.

Walls are cut out around the places where the body comes by. A wall stands before the body or
behind it, as the viewer sees it: where it turns its free side to the viewer the body is in front of
it; where it turns it away it would hide the body, and is drawn as a faint veil.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image

from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.body.body import Body
from dolfin_tongue.boundary.contact import Contact
from dolfin_tongue.march.state import State
from dolfin_tongue.surfaces.base import Surface
from dolfin_tongue.surfaces.triangulated import Triangulated
from dolfin_tongue.view.bones import INKS, Skeleton
from dolfin_tongue.view.camera import Camera

if TYPE_CHECKING:
    from dolfin_tongue.scene.scene import Scene
    from dolfin_tongue.view.scene3d import Colour

#: Bone under its thin skin, and what the tissue only slides on.
IVORY, SLATE = (238, 220, 176), (176, 196, 210)

#: Brightness of the line of a wall in the midsagittal plane over that of the wall.
SECTION = 0.5

#: How far walls are drawn beyond the body, over its longest side.
MARGIN = 0.25

#: Cells of the grid along the longest side of the box in which g = 0 is looked for.
CELLS = 48


@dataclass(frozen=True, eq=False)
class Sheet:
    """The part of a wall near the body, in the wall's own frame, as triangles.

    Parameters
    ----------
    points : ndarray, shape (n, 3), m.
    triangles : ndarray, shape (t, 3) -- numbers of points.
    normals : ndarray, shape (n, 3) -- unit vectors to the free side.
    middle : y of the midsagittal plane, in which the wall has a line, m.
    colour : 0-255.
    """

    points: FloatArray
    triangles: IntArray
    normals: FloatArray
    middle: float = 0.0
    colour: Colour = IVORY

    @property
    def ink(self) -> Colour:
        """Colour of the line in the midsagittal plane."""
        red, green, blue = (round(SECTION * value) for value in self.colour)
        return red, green, blue

    @property
    def section(self) -> FloatArray:
        """The midsagittal section as line segments, shape (k, 2, 3), m."""
        corners = self.points[self.triangles]
        height = corners[:, :, 1] - self.middle
        crossed = (height >= 0).any(axis=1) & (height < 0).any(axis=1)
        first, h = corners[crossed], height[crossed]
        second, k = np.roll(first, -1, axis=1), np.roll(h, -1, axis=1)
        cuts = (h >= 0) != (k >= 0)  # two of the three edges
        share = np.where(cuts, h / np.where(cuts, h - k, 1.0), 0.0)[..., None]
        return (first + share * (second - first))[cuts].reshape(-1, 2, 3)


def _still(time: float) -> tuple[FloatArray, FloatArray]:
    return np.zeros(3), np.zeros(3)


@dataclass(frozen=True)
class Wall:
    """A rigid surface that may move.

    Parameters
    ----------
    surface : the surface at rest.
    shift : its translation at a time (s), m, and velocity, m/s, each of shape (3,).
    colour : 0-255.
    """

    surface: Surface
    shift: Callable[[float], tuple[FloatArray, FloatArray]] = _still
    colour: Colour = IVORY

    def sheet(self, low: FloatArray, high: FloatArray, middle: float = 0.0) -> Sheet | None:
        """Cut out the part in a box with these corners, m; None if there is none.

        `middle` is y of the midsagittal plane, m.
        """
        import pyvista

        surface = self.surface
        if isinstance(surface, Triangulated):
            faces = np.insert(surface.triangles, 0, 3, axis=1)
            mesh: Any = pyvista.PolyData(surface.points, faces)
        else:
            mesh = _zero_set(surface, low, high)
        for corner, sign in ((low, -1.0), (high, 1.0)):
            for away in sign * np.eye(3):
                if mesh.n_cells:
                    mesh = mesh.clip(normal=away, origin=corner)
        if not mesh.n_cells:
            return None
        triangles = mesh.triangulate().faces.reshape(-1, 4)[:, 1:]
        points = np.asarray(mesh.points, dtype=float)
        normals = _normals(surface, points, triangles)
        return Sheet(points, triangles, normals, middle, self.colour)


def _zero_set(surface: Surface, low: FloatArray, high: FloatArray) -> Any:
    """Triangles of g = 0 in a box, from values on a grid."""
    import pyvista

    spacing = float((high - low).max()) / CELLS
    shape = np.ceil((high - low) / spacing).astype(int) + 1
    grid: Any = pyvista.ImageData(dimensions=shape, spacing=(spacing,) * 3, origin=low)
    with np.errstate(all="ignore"):  # not every place need be one where g is defined
        values = np.nan_to_num(surface.value(np.asarray(grid.points, dtype=float)))
    if not values.min() < 0 < values.max():
        return pyvista.PolyData()
    grid.point_data["g"] = values
    return grid.contour([0.0], scalars="g")


def _normals(surface: Surface, points: FloatArray, triangles: IntArray) -> FloatArray:
    """Return unit normals at the points, to the free side."""
    if isinstance(surface, Triangulated):
        corners = points[triangles]
        areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals = np.zeros_like(points)
        for corner in triangles.T:
            np.add.at(normals, corner, areas * (-1.0 if surface.inside else 1.0))
    else:
        normals = surface.gradient(points)
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)


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
        times = [state.time for state in states]
        moved = [body.points + state.displacement for state in states]
        corners = np.array([[x.min(axis=0), x.max(axis=0)] for x in moved])
        margin = MARGIN * (corners[:, 1] - corners[:, 0]).max()
        middle = float(body.points[:, 1].min() + body.points[:, 1].max()) / 2
        placed = []
        for wall in self.walls:
            shifts = np.array([wall.shift(time)[0] for time in times])
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

    def shifts(self, time: float) -> FloatArray:
        """Return the translation of each sheet at a time (s), shape (s, 3), m."""
        return np.array([wall.shift(time)[0] for wall in self._walls]).reshape(-1, 3)

    @property
    def inks(self) -> list[Colour]:
        """Colours of thin lines."""
        inks = list(dict.fromkeys(sheet.ink for sheet in self.sheets))
        return inks + (INKS if self.skeleton is not None else [])

    def clouds(self, states: Sequence[State]) -> list[FloatArray]:
        """Points that a camera has to see, each of shape (k, 3), m."""
        clouds = []
        if self.sheets:
            for shifts in np.unique([self.shifts(state.time) for state in states], axis=0):
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
