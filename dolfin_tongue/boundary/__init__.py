"""Boundary terms and body forces."""

from dolfin_tongue.boundary.attached import Attached
from dolfin_tongue.boundary.gravity import STANDARD_GRAVITY, Gravity

__all__ = ["STANDARD_GRAVITY", "Attached", "Gravity"]
