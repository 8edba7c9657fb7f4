"""The body at rest: points, cells, named regions, fibres. Plain arrays, no solver."""

from dolfin_tongue.body.body import TISSUE_DENSITY, Body
from dolfin_tongue.body.fibres import Fibres, MuscleFibres
from dolfin_tongue.body.state import State

__all__ = ["TISSUE_DENSITY", "Body", "Fibres", "MuscleFibres", "State"]
