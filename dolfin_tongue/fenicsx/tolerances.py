"""When Newton's method is done."""

from __future__ import annotations

from dataclasses import dataclass

from dolfin_tongue.base.errors import OutOfRange, is_number, require_positive


@dataclass(frozen=True)
class Tolerances:
    """When a Newton iteration is done, in the units of the fields.

    Parameters
    ----------
    displacement : largest nodal update, m, > 0.
    volume : largest relative volume change of any cell, > 0.
    iterations : at most, per solve.
    renew_above : the factorisation is renewed when an update is larger than this times the one
        before; 0 renews it in every iteration (full Newton).
    """

    displacement: float = 1e-8
    volume: float = 1e-9
    iterations: int = 40
    renew_above: float = 0.25

    def __post_init__(self) -> None:
        require_positive(self, "m", displacement=self.displacement)
        require_positive(self, "", volume=self.volume, iterations=self.iterations)
        if not (is_number(self.renew_above) and 0 <= self.renew_above < 1):
            raise OutOfRange("Tolerances.renew_above", self.renew_above, "in [0, 1)")


#: Full Newton for statics: from one load step to the next the tangent changes too much to keep it.
STATIC_TOLERANCES = Tolerances(iterations=25, renew_above=0.0)
