"""What the semi-discrete equations depend on, and the weights of their derivatives."""

from __future__ import annotations

from dataclasses import dataclass

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.control import Instant


@dataclass(frozen=True, eq=False)
class Arguments:
    """Arguments of a residual G; vectors over all unknowns.

    Parameters
    ----------
    now : time of the stage, s, and the memory of the state in which the step begins.
    time_end : end of the step, s.
    state, rate, acceleration : y, y', y'' at the stage; rates are zero in statics.
    end : y at the end of the step.
    load : factor on all loads, 1 in dynamics.
    """

    now: Instant
    time_end: float
    state: FloatArray
    rate: FloatArray
    acceleration: FloatArray
    end: FloatArray
    load: float = 1.0

    @property
    def end_instant(self) -> Instant:
        """The end of the step."""
        return Instant(self.time_end, self.now.memory)


@dataclass(frozen=True)
class Shifts:
    """Weights of the derivatives in a Jacobian: dG/dy + rate dG/dy' + acceleration dG/dy'' + ..."""

    rate: float
    acceleration: float
    end: float


#: Those of a static problem, where the end of the step is the state itself.
STATIC = Shifts(0.0, 0.0, 1.0)
