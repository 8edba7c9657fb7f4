"""Rigid surfaces in pictures: the part of each that is near the body, as triangles."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.surfaces.base import Surface
from dolfin_tongue.surfaces.triangulated import Triangulated
from dolfin_tongue.view.palette import IVORY, Colour

#: Brightness of the line of a wall in the midsagittal plane over that of the wall.
SECTION = 0.5

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
