"""Activations and prescribed motions over time."""

from dolfin_tongue.control.motion import Motion, Recorded, SmoothMove, Still, Swing
from dolfin_tongue.control.sources import (
    Constant,
    Control,
    Ramp,
    RememberingControl,
    SmoothRamp,
    Step,
    Table,
    require_activation,
)
from dolfin_tongue.control.timed import Instant, Memory, Timed

__all__ = [
    "Constant",
    "Control",
    "Instant",
    "Memory",
    "Motion",
    "Ramp",
    "Recorded",
    "RememberingControl",
    "SmoothMove",
    "SmoothRamp",
    "Step",
    "Still",
    "Swing",
    "Table",
    "Timed",
    "require_activation",
]
