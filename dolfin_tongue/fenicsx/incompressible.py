"""Incompressibility: the pairing of displacement and pressure, its sign fixed here once.

The pressure p is positive in compression. It enters the first Piola-Kirchhoff stress as
-p J F^-T, and its test function q weighs the relative volume change J - 1. Both derive from the
potential -int p (J - 1): the pair below is symmetric. With q constant per cell the condition is the
report's: every element keeps its volume (53), (91). In (55), where lambda times the gradient of the
volume is a force on the nodes, the Lagrange multiplier lambda is +p.
"""

from __future__ import annotations

import ufl

from dolfin_tongue.terms.kinematics import Expr, Kinematics


def pressure_power(kin: Kinematics, pressure: Expr, test: Expr) -> ufl.Form:
    """Integral of -p J F^-T : grad w, W."""
    return kin.power(-pressure * kin.J * ufl.inv(kin.F).T, test)


def volume_condition(kin: Kinematics, test_pressure: Expr) -> ufl.Form:
    """Integral of -(J - 1) q, m3 per unit q: minus the volume change of each cell (91)."""
    return -(kin.J - 1) * test_pressure * kin.dx
