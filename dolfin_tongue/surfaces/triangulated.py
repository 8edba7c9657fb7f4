"""A smooth signed distance to a triangulated surface.

The distance to the triangles is sampled once on a regular grid, and the samples are interpolated by
tricubic B-splines. Gap, normal and curvature are the value and the derivatives of that one C2
function, so that contact forces derive from an energy and have a symmetric stiffness. They are
those of the smooth surface where the function is zero, which is off the triangles by
`Triangulated.smoothing_error`. The normal is the gradient as it is: its length is 1 to within that
error over the spacing.

Cost, for the palate of `geometry.palate` on one core, compiled code being there: with 1e3, 1e4 and
1e5 triangles the samples take 0.5, 2 and 5 s (3 to 9 MB), gap, normal and curvature always 0.1 us
per point. Accuracy, on a sphere of radius R = 30 mm with edges of 2.2 mm and default options: gap
to 0.024 mm (its triangles are as far from it), normal to 0.002, curvature to 0.04 / R at worst and
0.002 / R typically; without smoothing the last two are 0.016 and 0.6 / R, and finer triangles do
not lower the 0.6.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from dolfin_tongue.base.arrays import FloatArray, IntArray, real_numbers, whole_numbers
from dolfin_tongue.base.errors import (
    OutOfRange,
    is_number,
    require_flags,
    require_not_negative,
    require_positive,
)
from dolfin_tongue.surfaces.base import Gap, Surface, require_places
from dolfin_tongue.surfaces.retraction import Retraction, retraction_for
from dolfin_tongue.surfaces.triangles import check_triangles, typical_edge

if TYPE_CHECKING:  # compiled code is loaded when it is needed
    from dolfin_tongue.surfaces.nearest import Tree
    from dolfin_tongue.surfaces.samples import Samples
    from dolfin_tongue.surfaces.spline import Spline

#: Default spacing and smoothing, in median edges: on a sphere this leaves a tenth of the error of
#: the curvature and a fifth of that of the normal, and costs half of what 0.5 edges do.
EDGES = 0.7

#: Most spacings of the default smoothing: larger triangles are meant to be flat.
MOST_SMOOTHING = 2.5

#: Limits of the default spacing, as parts of the extent.
FINEST, COARSEST = 1 / 120, 1 / 60

#: Default band, as part of the surface's size.
BAND = 1 / 10

#: Least radius of a dent, in spacings; most rounds of dents.
LEAST_RADIUS, ROUNDS = 4.0, 8

#: Least band, in spacings: fewer samples do not make a distance.
LEAST_BAND = 2.0


@dataclass(frozen=True, eq=False)
class Triangulated(Surface):
    """A triangulated surface, closed or an open sheet.

    The distance is inf, with normal and curvature zero, further from the surface than `band` on
    either side, and where the nearest point of a sheet lies on its rim: there is no contact
    there. So a body that passes the rim, or gets deeper than the band, is free, and one that comes
    up behind the rim is all at once deep in the wall: choose a sheet wider than the body's way, and
    a band deeper than any overlap. Parts of a sheet nearer to each other than twice the band get a
    rounded kink half way between them, and so does a thin wall. That no triangles intersect is not
    checked.

    Parameters
    ----------
    points : ndarray, shape (n, 3), m.
    triangles : ndarray, shape (t, 3) -- numbers of points, counter-clockwise seen from outside; of
        a sheet: seen from its free side.
    sheet : whether the surface is open. The normals of a sheet point to its free side.
    inside : whether the inside of a closed surface is the free side; of a sheet: whether the side
        away from the normals is.
    spacing : of the samples, m, > 0. Default: 0.7 median edges of the triangles, but at least a
        120th and at most a 60th of the surface's extent (longest side of its bounding box).
    band : how far from the surface the distance is known, m, >= 2 spacings. Default: a tenth of
        the extent, or 2 spacings if that is more.
    smoothing : length over which the kinks between triangles are smoothed, m, >= 0, at most half
        the band. Default: 0.7 median edges, but at most 2.5 spacings. Sharp edges are
        rounded by as much; 0 keeps them, and the kinks.
    offset : thickness laid on the surface, m: the gap is the distance less this. A negative one
        moves the whole wall back.
    retraction : local dents of the wall; see `with_clearance`.

    Raises
    ------
    BadMesh : points and triangles that are no such surface: see `check_triangles`.
    OutOfRange : spacing, band or offset that is no such number, or a spacing that needs too many
        samples (when the distance is first asked for).
    """

    points: FloatArray
    triangles: IntArray
    sheet: bool = False
    inside: bool = False
    spacing: float | None = None
    band: float | None = None
    smoothing: float | None = None
    offset: float = 0.0
    retraction: Retraction | None = None

    @property
    def has_rim(self) -> bool:
        """Whether it is an open sheet."""
        return self.sheet

    def __post_init__(self) -> None:
        name = type(self).__name__
        require_flags(self, sheet=self.sheet, inside=self.inside)
        if not (self.retraction is None or isinstance(self.retraction, Retraction)):
            raise OutOfRange(
                f"{name}.retraction", self.retraction, "None, or made by with_clearance()"
            )
        object.__setattr__(self, "points", real_numbers(f"{name}: points", self.points))
        triangles = whole_numbers(f"{name}: triangles", self.triangles)
        object.__setattr__(self, "triangles", triangles)
        remedy = "reverse them: triangles[:, ::-1] (if the inside is free, also pass inside=True)"
        check_triangles(name, self.points, triangles, sheet=self.sheet, inside_out=remedy)
        self._choose_lengths()
        self._check_lengths()

    def _choose_lengths(self) -> None:
        """Set the defaults that follow from the triangles."""
        length = EDGES * typical_edge(self.points, self.triangles)
        limits = FINEST * self.extent, COARSEST * self.extent
        if self.spacing is None:
            object.__setattr__(self, "spacing", float(np.clip(length, *limits)))
        require_positive(self, "m", spacing=self.spacing)
        spacing = cast(float, self.spacing)
        if self.band is None:
            object.__setattr__(self, "band", max(BAND * self.extent, LEAST_BAND * spacing))
        require_positive(self, "m", band=self.band)
        if self.smoothing is None:
            width = min(length, MOST_SMOOTHING * spacing, cast(float, self.band) / 2)
            object.__setattr__(self, "smoothing", width)

    def _check_lengths(self) -> None:
        """Refuse lengths that do not fit together."""
        name, least = type(self).__name__, LEAST_BAND * cast(float, self.spacing)
        require_not_negative(self, "m", smoothing=self.smoothing)
        band, smoothing = cast(float, self.band), cast(float, self.smoothing)
        if band < least:
            allowed = f">= {LEAST_BAND:g} spacings = {least:.3g}"
            raise OutOfRange(f"{name}.band", band, allowed, "m")
        if smoothing > band / 2:
            allowed = f"at most half the band, {band / 2:.3g}"
            raise OutOfRange(f"{name}.smoothing", smoothing, allowed, "m")
        if not (is_number(self.offset) and abs(self.offset) < band):
            allowed = f"smaller than the band, {band:.3g}"
            raise OutOfRange(f"{name}.offset", self.offset, allowed, "m")

    @property
    def extent(self) -> float:
        """Longest side of the bounding box, m."""
        return float(np.ptp(self.points[self.triangles].reshape(-1, 3), axis=0).max())

    @cached_property
    def _tree(self) -> Tree:
        from dolfin_tongue.surfaces.nearest import tree_of

        return tree_of(self.points[self.triangles])

    @cached_property
    def _samples(self) -> Samples:
        from dolfin_tongue.surfaces.samples import sample

        spacing, band = cast(float, self.spacing), cast(float, self.band)
        smoothing = cast(float, self.smoothing)
        return sample(
            self.points, self.triangles, self._tree,
            spacing=spacing, band=band, smoothing=smoothing,
        )  # fmt: skip

    @cached_property
    def _spline(self) -> Spline:
        from dolfin_tongue.surfaces.spline import spline_through

        samples = self._samples
        distance = (-1.0 if self.inside else 1.0) * samples.distance - self.offset
        if self.retraction is not None:
            distance += self.retraction.at(samples.places).reshape(distance.shape)
        return spline_through(samples.origin, samples.spacing, distance, samples.known)

    def gap(self, points: FloatArray) -> Gap:
        """Smooth signed distance with its derivatives; inf, 0, 0 where there is no contact."""
        return Gap(*self._spline.evaluate(np.asarray(points, dtype=float)))

    def value(self, points: FloatArray) -> FloatArray:
        """Smooth signed distance, m."""
        return self.gap(points).distance

    def gradient(self, points: FloatArray) -> FloatArray:
        """First derivatives of the smooth distance, nearly a unit vector."""
        return self.gap(points).normal

    def hessian(self, points: FloatArray) -> FloatArray:
        """Second derivatives of the smooth distance, 1/m."""
        return self.gap(points).curvature

    def project(self, points: FloatArray) -> FloatArray:
        """Points of the smooth surface near given ones, shape (k, 3), m.

        Where there is no smooth surface (beyond a rim) they are those of the triangles.
        """
        found = self._tree.nearest(np.asarray(points, dtype=float))[2]
        for _ in range(50):
            gap = self.gap(found)
            there = np.isfinite(gap.distance)
            normal = gap.normal[there]
            move = (gap.distance[there] / (normal**2).sum(axis=1))[:, None] * normal
            found[there] -= move
            if np.abs(move).max(initial=0.0) < 1e-14:
                break
        return found

    @cached_property
    def smoothing_error(self) -> float:
        """Largest distance of corners and centres of the triangles from the smooth surface, m.

        Sharp edges are rounded by about half of `smoothing`. Offset and retraction do not count.
        """
        bare = self._like(offset=0.0, retraction=None)
        centres = self.points[self.triangles].mean(axis=1)
        distance = bare.value(np.concatenate([self.points[np.unique(self.triangles)], centres]))
        return float(np.abs(distance[np.isfinite(distance)]).max(initial=0.0))

    def reversed(self) -> Triangulated:
        """Return the same surface with the other side free."""
        return self._like(inside=not self.inside)

    def with_clearance(
        self, points: FloatArray, clearance: float = 0.0, radius: float | None = None
    ) -> Triangulated:
        """Return a surface that yields where points, e.g. of a body at rest, are too near.

        The wall gets shallow dents, one after the other under the point that lacks most, until
        every point has the clearance. Points that have it leave the wall as it is.

        Parameters
        ----------
        points : ndarray, shape (k, 3), m.
        clearance : least gap of the points, m.
        radius : of a dent, m. Default: an eighth of the extent. It is enlarged to 4 spacings, so
            that samples resolve it, and to 12 times the largest lack, so that the wall stays flat.

        Returns
        -------
        Triangulated
            With the dents in `retraction`; `largest_retraction` tells the deepest.

        Raises
        ------
        OutOfRange : clearance not a number within the band, radius <= 0.
        BadMesh : points of another shape, or not finite.
        """
        points = require_places("points", points)
        if not (is_number(clearance) and abs(clearance) < cast(float, self.band)):
            allowed = f"a number smaller than the band, {self.band:.3g}"
            raise OutOfRange("clearance", clearance, allowed, "m")
        size = self.extent / 8 if radius is None else radius
        if not (is_number(size) and size > 0):
            raise OutOfRange("radius", radius, "a finite number > 0", "m")
        size = max(float(size), LEAST_RADIUS * cast(float, self.spacing))
        surface = self
        for _ in range(ROUNDS):  # splines meet the dents at the samples, not between them
            lacks = clearance - surface.value(points)
            if lacks.max(initial=0.0) <= 0:
                break
            dents = retraction_for(points, lacks, size)
            surface = surface._like(retraction=dents.joined(surface.retraction))
        return surface

    @property
    def largest_retraction(self) -> float:
        """How far the wall yields at most, m; 0 where there are no dents."""
        if self.retraction is None:
            return 0.0
        places = np.concatenate([self.retraction.centres, self.points])
        return float(self.retraction.at(places).max())

    def _like(self, **changes: Any) -> Triangulated:
        """Return a copy that differs in how the distance is used, not in the triangles."""
        other = replace(self, **changes)
        other.__dict__.update(_tree=self._tree, _samples=self._samples)
        return other
