"""Sizes of steps, and the smooth stretches of time between break points: once, for all methods."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

import numpy as np

from dolfin_tongue.base.times import SAME_TIME
from dolfin_tongue.control import Timed


@dataclass(frozen=True)
class StepControl:
    """How steps are chosen, cut and allowed to grow.

    Parameters
    ----------
    dt : nominal step, s; with `tolerance` the first one.
    tolerance : largest error of a nodal displacement per step, m; None keeps dt fixed.
    smallest : step below which a run that loses convergence is given up, s.
    largest : largest step where the step adapts, s.
    cut : factor after a failure.
    growth : largest factor by which steps return to dt after a cut.
    worthwhile : where the step adapts, least factor of growth that is taken after an accepted
        step; above 1 such a step does not shrink either, since another step costs some methods a
        new factorisation.
    """

    dt: float
    tolerance: float | None = None
    smallest: float = 0.0
    largest: float = inf
    cut: float = 0.25
    growth: float = 1.5
    worthwhile: float = 1.0

    def too_large(self, error: float | None, dt: float) -> bool:
        """Whether an error is not acceptable; at the smallest step any error is taken."""
        if self.tolerance is None or error is None:
            return False
        return not error <= self.tolerance and dt > self.smallest

    def shorter(self, dt: float, error: float | None) -> float:
        """Step to try after a failure (no error), or after too large an error."""
        if self.tolerance is None or error is None:
            return self.cut * dt
        return max(dt * float(np.clip(self._factor(error), 0.2, 0.9)), self.smallest)

    def following(self, taken: float, error: float | None) -> float:
        """Step to propose after one that was taken."""
        if self.tolerance is None or error is None:
            return min(self.dt, self.growth * taken)
        factor = float(np.clip(self._factor(error), 0.2, 2.0))
        kept = self.worthwhile > 1.0 and factor <= self.worthwhile
        return float(np.clip(taken if kept else taken * factor, self.smallest, self.largest))

    def _factor(self, error: float) -> float:
        assert self.tolerance is not None
        return 0.9 * (self.tolerance / max(error, 1e-300)) ** (1 / 3)


def fitting(remaining: float, proposal: float) -> float:
    """Step not longer than proposed of which a whole number fits into what remains, s."""
    return remaining / max(1, int(np.ceil(remaining / proposal - 1e-6)))


def stretches(timed: Timed, start: float, end: float) -> list[tuple[float, bool]]:
    """List the ends of the smooth stretches between two times.

    Returns
    -------
    list of (time, whether something jumps there); the last one is `end`.
    """
    jumps = timed.jumps
    inner = [t for t in timed.breakpoints if start + SAME_TIME < t < end - SAME_TIME]
    return [(time, time in jumps) for time in inner] + [(end, False)]


def before(time: float, end: float) -> float:
    """Time at which controls are read in a stretch: a jump at its end is not yet seen."""
    return min(time, float(np.nextafter(end, -np.inf)))
