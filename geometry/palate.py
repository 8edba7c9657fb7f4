"""A parametric palate over the report's tongue: hard palate, alveolar ridge, teeth and velum.

Frame as in `preliminary`: x from front to back, y to the sides, z up, metres. The palate is a vault
over a plan: half an ellipse in front (the dental arch), a strip of constant width behind it. Across
the plan, from the midline or the top of the vault outward, it is a quarter of an ellipse down to
the gums, then a wall straight down, the inside of the upper teeth. It goes on outward along their
edges, so that a tongue between the teeth meets these and not the rim of a sheet. Behind the
incisors the alveolar ridge stands out of the vault. Backwards the roof sinks to the edge of the
velum, and the teeth end. gmsh meshes the plan rolled out to its true width; a formula lifts the
nodes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import gmsh
import numpy as np
from scipy.special import ellipe

from dolfin_tongue.base.arrays import BoolArray, FloatArray, IntArray
from dolfin_tongue.base.errors import (
    BadScene,
    OutOfRange,
    is_number,
    require_not_negative,
    require_positive,
)
from dolfin_tongue.base.units import LARGEST_SIZE, mm
from dolfin_tongue.geometry.block import gmsh_model
from dolfin_tongue.surfaces.triangles import area_vectors
from dolfin_tongue.surfaces.triangulated import Triangulated

#: How the roof sinks behind its top: the power of the share of the way to the velum's edge.
SINKING = 2.5

#: Height of the velum's arch at its edge, over that of the vault.
FLATTENING = 0.2

#: Height of the wall beside the velum's edge, over that of the teeth.
FOLD = 0.3

#: Length over which the teeth end, m.
TEETH_FADE = 8 * mm

#: Where the alveolar ridge is highest, and how far it extends to both sides: parts of the way from
#: the top of the vault to the gum line.
RIDGE_PLACE, RIDGE_EXTENT = 0.65, 0.35


#: Most edges across the half width: more take minutes and gigabytes.
FINEST = 300


@dataclass(frozen=True)
class Palate:
    """Measures of a palate; the defaults fit the report's tongue at rest.

    Parameters
    ----------
    front : x of the gum line behind the incisors, m.
    top : x and z of the highest point of the vault, m.
    height : of the vault over the gum line, m, > 0.
    half_width : from the midplane to the gum line beside the molars, m, > 0.
    teeth : height of the inside of the upper teeth below the gum line, m, > 0.
    edge : how far the surface goes on outward from the edge of the teeth, m, > 0.
    teeth_end : x behind the last molar, m.
    ridge : how far the alveolar ridge stands out, m, >= 0.
    velum : x and z of the edge of the velum, m.

    Raises
    ------
    OutOfRange : a number that is not finite, out of its range or in millimetres; x not in the
        order front, top, teeth_end, velum; a velum above the top; a ridge of more than a
        quarter of the height.
    """

    front: float = 54.0 * mm
    top: tuple[float, float] = (90.0 * mm, 115.5 * mm)
    height: float = 11.0 * mm
    half_width: float = 23.0 * mm
    teeth: float = 5.0 * mm
    edge: float = 8.0 * mm
    teeth_end: float = 110.0 * mm
    ridge: float = 2.0 * mm
    velum: tuple[float, float] = (133.0 * mm, 99.0 * mm)

    def __post_init__(self) -> None:
        names = ("height", "half_width", "teeth", "edge")
        lengths = {name: getattr(self, name) for name in names}
        require_positive(self, "m", **lengths)
        require_not_negative(self, "m", ridge=self.ridge)
        for name in ("top", "velum"):
            place = getattr(self, name)
            pair = isinstance(place, tuple | list) and len(place) == 2
            if not (pair and all(map(is_number, place))):
                raise OutOfRange(f"Palate.{name}", place, "two finite numbers, x and z")
        order = (self.front, self.top[0], self.teeth_end, self.velum[0])
        if not (all(map(is_number, order)) and (np.diff(order) > 0).all()):
            goal = "increasing: x of front, top, teeth_end and velum (x runs from front to back)"
            raise OutOfRange("Palate", order, goal)
        size = max(*lengths.values(), order[-1] - order[0])
        if size > LARGEST_SIZE:
            goal = f"at most {LARGEST_SIZE:g} m long (multiply by 1e-3 if yours are millimetres)"
            raise OutOfRange("Palate: largest measure", size, goal, "m")
        if self.velum[1] > self.top[1]:
            raise OutOfRange("Palate.velum", self.velum, "not above the top (x and z)")
        if self.ridge > self.height / 4:
            raise OutOfRange("Palate.ridge", self.ridge, "at most a quarter of the height", "m")

    def surface(self, along: FloatArray, out: FloatArray) -> FloatArray:
        """Points of the palate.

        Parameters
        ----------
        along : ndarray, shape (k,) -- on the plan from its front, -1, over the top of the vault, 0,
            to the edge of the velum, 1.
        out : ndarray, shape (k,) -- on the plan from the midplane, 0, to the edge of the teeth, 1,
            and beyond; in front of the top the teeth end at along^2 + out^2 = 1.

        Returns
        -------
        ndarray, shape (k, 3), m.
        """
        front = np.minimum(along, 0.0)
        way = np.hypot(front, out)
        vault = np.minimum(way / self._gum_way, 1.0)
        wall = np.clip((way - self._gum_way) / (1 - self._gum_way), 0.0, 1.0)
        beyond = np.maximum(way - 1, 0.0) * self._side
        direction = np.stack([front, out]) / np.maximum(way, 1e-300)
        angle = vault * np.pi / 2
        x = self.top[0] + np.maximum(along, 0.0) * (self.velum[0] - self.top[0])
        x += ((self.top[0] - self.front) * np.sin(angle) + beyond) * direction[0]
        y = (self.half_width * np.sin(angle) + beyond) * direction[1]
        roof, arch = self._section(x)
        z = roof - arch * (1 - np.cos(angle)) - self._teeth(x) * wall
        return np.stack([x, y, z], axis=1) - self._ridge(vault, direction)

    def _section(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return z of the midline and the height of the arch; before the top, those of the top."""
        share = np.maximum(x - self.top[0], 0.0) / (self.velum[0] - self.top[0])
        sunk = share**SINKING
        roof = self.top[1] - (self.top[1] - self.velum[1]) * sunk
        return roof, self.height * (1 - (1 - FLATTENING) * sunk)

    def _teeth(self, x: FloatArray) -> FloatArray:
        """Height of the wall below the gum line."""
        share = np.clip((x - self.teeth_end) / TEETH_FADE, 0.0, 1.0)
        return self.teeth * (1 - (1 - FOLD) * share**2 * (3 - 2 * share))

    def _ridge(self, vault: FloatArray, direction: FloatArray) -> FloatArray:
        """How far the alveolar ridge stands out of the vault, along its outer normal, (k, 3)."""
        offset = np.clip((vault - RIDGE_PLACE) / RIDGE_EXTENT, -1.0, 1.0)
        height = self.ridge * np.cos(offset * np.pi / 2) ** 4 * direction[0] ** 2
        length, angle = self.top[0] - self.front, vault * np.pi / 2
        outward = np.stack([np.sin(angle) / length, np.cos(angle) / self.height])
        outward /= np.linalg.norm(outward, axis=0)
        normal = [outward[0] * direction[0], outward[0] * direction[1], outward[1]]
        return height[:, None] * np.stack(normal, axis=1)

    @property
    def _arcs(self) -> tuple[float, float]:
        """Lengths of the vault from its top to the gum line, to the front and to the side, m."""
        first, second = (self.top[0] - self.front, self.half_width)
        return quarter_ellipse(first, self.height), quarter_ellipse(second, self.height)

    @property
    def _gum_way(self) -> float:
        """Part of the way from top to edge of the teeth at which the gum line lies."""
        return self._arcs[1] / self._side

    @property
    def _side(self) -> float:
        """Length from the top of the vault to the edge of the teeth beside it, m."""
        return self._arcs[1] + self.teeth

    def triangles(self, mesh_size: float = 1.5 * mm) -> tuple[FloatArray, IntArray]:
        """Mesh the palate by gmsh, mirror-symmetric about y = 0.

        Parameters
        ----------
        mesh_size : length of the edges, m, between a 300th and a quarter of the half width.

        Returns
        -------
        points : ndarray, shape (n, 3), m.
        triangles : ndarray, shape (t, 3) -- their normals point to the tongue.

        Raises
        ------
        OutOfRange : a mesh size out of its range.
        """
        least, largest = self.half_width / FINEST, self.half_width / 4
        if not (is_number(mesh_size) and least <= mesh_size <= largest):
            goal = f"> 0, at least {least:.3g} and at most {largest:.3g}"
            raise OutOfRange("mesh_size", mesh_size, goal, "m")
        front, side = (arc + self.teeth for arc in self._arcs)
        wide = 1 + self.edge / side
        back = float(np.hypot(self.velum[0] - self.top[0], self.top[1] - self.velum[1]))
        plan, half = _half_plan(wide * front, wide * side, back, mesh_size)
        along = np.where(plan[:, 0] < 0, plan[:, 0] / front, plan[:, 0] / back)
        points = self.surface(along, plan[:, 1] / side)
        return _mirrored(points, half, middle=plan[:, 1] < 1e-9 * side)


def report_palate(
    mesh_size: float = 1.5 * mm, palate: Palate | None = None, **options: Any
) -> Triangulated:
    """Build a palate over the report's tongue, as a sheet to touch.

    With the default measures no point of the surface of `preliminary_tongue` at rest is nearer to
    it than 1.8 mm; over the dorsum (x from 80 to 120 mm) the gap is 2.2 to 3.9 mm, behind the
    incisors it is 2.5 mm or more. The tip at rest is lower than the edge of the teeth.

    Parameters
    ----------
    mesh_size : length of the edges, m.
    palate : other measures.
    options : of `Triangulated`: ``spacing``, ``band`` and others.

    Raises
    ------
    OutOfRange : a mesh size out of its range.
    """
    if palate is not None and not isinstance(palate, Palate):
        raise BadScene(f"report_palate takes measures, e.g. Palate(height=0.012), not {palate!r}")
    points, triangles = (palate or Palate()).triangles(mesh_size)
    return Triangulated(points, triangles, sheet=True, **options)


def quarter_ellipse(first: float, second: float) -> float:
    """Length of a quarter of an ellipse with these semi-axes."""
    longer, shorter = max(first, second), min(first, second)
    return float(longer * ellipe(1 - (shorter / longer) ** 2))


def _half_plan(
    front: float, side: float, back: float, mesh_size: float
) -> tuple[FloatArray, IntArray]:
    """Mesh one half of the rolled-out plan: a quarter of an ellipse and a rectangle behind it."""
    with gmsh_model("palate"):
        geo = gmsh.model.geo
        places = [(0, 0), (-front, 0), (0, side), (back, side), (back, 0)]
        centre, tip, cheek, corner, edge = (geo.addPoint(x, y, 0, mesh_size) for x, y in places)
        major = tip if front >= side else cheek
        lines = [
            geo.addLine(edge, tip),
            geo.addEllipseArc(tip, centre, major, cheek),
            geo.addLine(cheek, corner),
            geo.addLine(corner, edge),
        ]
        geo.addPlaneSurface([geo.addCurveLoop(lines)])
        geo.synchronize()
        gmsh.model.mesh.generate(2)
        tags, coordinates, _ = gmsh.model.mesh.getNodes()
        _, nodes = gmsh.model.mesh.getElementsByType(2)
    used, triangles = np.unique(nodes.astype(np.int64), return_inverse=True)
    order = np.argsort(tags)
    rows = order[np.searchsorted(tags[order].astype(np.int64), used)]
    return coordinates.reshape(-1, 3)[rows, :2], triangles.reshape(-1, 3)


def _mirrored(
    points: FloatArray, triangles: IntArray, middle: BoolArray
) -> tuple[FloatArray, IntArray]:
    """Join a half (y >= 0) and its mirror image along the points in the middle."""
    points = points * np.where(middle[:, None], [1.0, 0.0, 1.0], 1.0)
    twin = np.arange(len(points))
    twin[~middle] = len(points) + np.arange(int((~middle).sum()))
    both = np.concatenate([points, points[~middle] * [1.0, -1.0, 1.0]])
    faces = np.concatenate([triangles, twin[triangles][:, ::-1]])
    down = area_vectors(both, faces)[:, 2].sum() < 0
    return both, faces if down else faces[:, ::-1]
