"""Boundary terms and body forces."""

from dolfin_tongue.boundary.attached import Attached
from dolfin_tongue.boundary.contact import Barrier, Contact, ReportContact
from dolfin_tongue.boundary.gravity import STANDARD_GRAVITY, Gravity
from dolfin_tongue.boundary.skin import Skin
from dolfin_tongue.boundary.sliding import Sliding, moved_onto
from dolfin_tongue.boundary.surface_tension import SurfaceTension

__all__ = [
    "STANDARD_GRAVITY",
    "Attached",
    "Barrier",
    "Contact",
    "Gravity",
    "ReportContact",
    "Skin",
    "Sliding",
    "SurfaceTension",
    "moved_onto",
]
