"""Rigid surfaces to slide on or to touch."""

from dolfin_tongue.surfaces.base import Gap, Surface
from dolfin_tongue.surfaces.faces_towards import faces_towards
from dolfin_tongue.surfaces.files import read_surface
from dolfin_tongue.surfaces.implicit import Ellipsoid, Implicit
from dolfin_tongue.surfaces.overlap import overlap
from dolfin_tongue.surfaces.simple import Cylinder, Plane, Sphere
from dolfin_tongue.surfaces.triangulated import Triangulated

__all__ = [
    "Cylinder",
    "Ellipsoid",
    "Gap",
    "Implicit",
    "Plane",
    "Sphere",
    "Surface",
    "Triangulated",
    "faces_towards",
    "overlap",
    "read_surface",
]
