"""Activation sources."""

from dolfin_tongue.control.sources import Constant, Control, Ramp, SmoothRamp, Step, Table

__all__ = ["Constant", "Control", "Ramp", "SmoothRamp", "Step", "Table"]
