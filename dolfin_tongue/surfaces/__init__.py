"""Rigid surfaces to slide on or to touch."""

from dolfin_tongue.surfaces.base import Gap, Surface
from dolfin_tongue.surfaces.simple import Cylinder, Plane, Sphere

__all__ = ["Cylinder", "Gap", "Plane", "Sphere", "Surface"]
