"""Activation sources."""

from dolfin_tongue.control.sources import (
    Constant,
    Control,
    Ramp,
    SmoothRamp,
    Step,
    Table,
    require_activation,
)

__all__ = ["Constant", "Control", "Ramp", "SmoothRamp", "Step", "Table", "require_activation"]
