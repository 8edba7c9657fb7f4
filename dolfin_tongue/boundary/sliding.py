"""Nodes that slide on a fixed surface without friction (49)-(52)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.base.errors import BadScene, listing
from dolfin_tongue.body.body import Body
from dolfin_tongue.surfaces.base import Surface
from dolfin_tongue.terms.support import Support

#: Largest distance from the surface at which a reference node counts as on it, m.
ON_SURFACE = 1e-9


@dataclass(frozen=True)
class Sliding(Support):
    """The nodes of the named regions stay on a surface, g(y) = 0 (49), without friction.

    Each node has a Lagrange multiplier; the surface acts on it with lambda dg/dy (50). Both
    directions are kept: the surface pulls as well as it pushes. For one that only pushes take
    `Contact`.

    Parameters
    ----------
    surface : a fixed surface, e.g. ``Sphere((0, 0, 0.1), 0.1, inside=True)``.
    regions : one or more node regions of the body.

    Raises
    ------
    UnknownName : a region that the body does not have.
    BadScene : reference nodes that are not on the surface; see `moved_onto`.
    """

    surface: Surface
    regions: tuple[str, ...]

    def __init__(self, surface: Surface, *regions: str):
        if not isinstance(surface, Surface):
            raise BadScene(f"Sliding takes a surface first, e.g. Plane(), not {surface!r}")
        if not regions or not all(isinstance(region, str) for region in regions):
            raise BadScene(f'Sliding takes names, e.g. Sliding(Plane(), "base"), not {regions}')
        object.__setattr__(self, "surface", surface)
        object.__setattr__(self, "regions", regions)

    @property
    def label(self) -> str:
        """What messages call it."""
        return f"Sliding({', '.join(self.regions)})"

    def nodes(self, body: Body) -> IntArray:
        """Nodes of all regions, each once."""
        return np.unique(np.concatenate([body.nodes(region) for region in self.regions]))

    def check(self, body: Body) -> None:
        """Refuse nodes that do not start on the surface."""
        nodes = self.nodes(body)
        distance = off_surface(self.surface, body.points[nodes])
        off = np.flatnonzero(~(np.abs(distance) <= ON_SURFACE))
        if off.size:
            raise BadScene(
                f"{self.label}: {off.size} of {len(nodes)} node(s) are not on the surface, the "
                f"worst by {np.abs(distance).max():.3g} m: {listing(nodes[off])}. Move them with "
                "moved_onto(body, surface, *regions), or correct the surface"
            )


def off_surface(surface: Surface, points: FloatArray) -> FloatArray:
    """Distance of points from a surface to first order, g / |dg/dy|, shape (k,), m."""
    with np.errstate(all="ignore"):  # no gradient on an axis or at a centre
        return surface.value(points) / np.linalg.norm(surface.gradient(points), axis=1)


def moved_onto(body: Body, surface: Surface, *regions: str) -> Body:
    """Body whose nodes in the regions are projected onto a surface.

    Raises
    ------
    BadMesh : the projection inverts a cell.
    BadScene : nodes that have no place on the surface.
    """
    nodes = Sliding(surface, *regions).nodes(body)
    points = body.points.copy()
    with np.errstate(all="ignore"):  # those without a place are named below
        points[nodes] = surface.project(points[nodes])
    lost = nodes[~np.isfinite(points[nodes]).all(axis=1)]
    if lost.size:
        raise BadScene(
            f"no place on the surface is found for node(s) {listing(lost)}: it has none, or they "
            "lie on its axis or centre"
        )
    return replace(body, points=points)
