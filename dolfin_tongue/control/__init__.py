"""Activation sources."""

from dolfin_tongue.control.motion import Motion, Recorded, SmoothMove, Still, Swing
from dolfin_tongue.control.sources import (
    Constant,
    Control,
    Ramp,
    SmoothRamp,
    Step,
    Table,
    require_activation,
)

__all__ = [
    "Constant",
    "Control",
    "Motion",
    "Ramp",
    "Recorded",
    "SmoothMove",
    "SmoothRamp",
    "Step",
    "Still",
    "Swing",
    "Table",
    "require_activation",
]
