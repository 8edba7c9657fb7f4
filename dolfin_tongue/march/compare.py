"""Comparing motions: states at given times, differences, orders, repeated timings."""

from __future__ import annotations

import resource
import time as clock
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.base.errors import BadScene
from dolfin_tongue.body.state import State
from dolfin_tongue.march.solver import Solver


def at_times(states: Iterable[State], times: Sequence[float]) -> list[State]:
    """Pick the states at given times out of a motion.

    Raises
    ------
    BadScene : the motion has no state at one of the times (to a millionth of a millisecond).
    """
    wanted = list(times)
    found: list[State] = []
    for state in states:
        if len(found) < len(wanted) and abs(state.time - wanted[len(found)]) <= 1e-9:
            found.append(state)
    if len(found) < len(wanted):
        raise BadScene(f"the motion has no state at t = {wanted[len(found)]:.6g} s")
    return found


def visiting(solver: Solver, times: Sequence[float]) -> list[State]:
    """March from rest so that steps end at each of the times (for adaptive one-step methods)."""
    state, states = None, []
    for time in times:
        *_, state = solver.march(time, state)
        states.append(state)
    return states


def interpolated(states: Sequence[State], times: Sequence[float]) -> list[State]:
    """Motion at given times on the cubic path of each step (displacement only changes).

    Where a step ends at a time, that is its state; methods that choose their own steps, or had to
    cut one, are read in between, with an error of order 4.
    """
    t = [state.time for state in states]
    u, v = (np.array([getattr(s, name) for s in states]) for name in ("displacement", "velocity"))
    path = CubicHermiteSpline(t, u, v)(times)
    return [replace(states[-1], time=x, displacement=d) for x, d in zip(times, path, strict=True)]


@dataclass(frozen=True)
class Difference:
    """Largest differences of two motions over times and nodes (cells), relative to the second.

    Parameters
    ----------
    displacement, velocity, pressure : dimensionless.
    """

    displacement: float
    velocity: float
    pressure: float


def difference(states: Sequence[State], reference: Sequence[State]) -> Difference:
    """Compare two motions at the same times."""

    def largest(name: str) -> float:
        a, b = (np.array([getattr(x, name) for x in motion]) for motion in (states, reference))
        return float(np.abs(a - b).max() / np.abs(b).max())

    return Difference(*(largest(name) for name in ("displacement", "velocity", "pressure")))


def landmark_path(states: Sequence[State], nodes: Sequence[int]) -> FloatArray:
    """Displacement of nodes over time, shape (times, nodes, 3), m."""
    return np.array([state.displacement[list(nodes)] for state in states])


def orders(steps: Sequence[float], errors: Sequence[float]) -> list[float]:
    """Observed orders between neighbours: log(error ratio) / log(step ratio)."""
    ratio = np.diff(np.log(np.asarray(errors))) / np.diff(np.log(np.asarray(steps)))
    return [float(x) for x in ratio]


@dataclass(frozen=True)
class Timing:
    """Wall times of repeated runs, s.

    Parameters
    ----------
    median, least, largest : s.
    """

    median: float
    least: float
    largest: float


def timed(make: Callable[[], Solver], end: float, repeats: int) -> tuple[Timing, list[State]]:
    """Run a solver several times; the set-up (`make`) is not timed.

    Parameters
    ----------
    make : builds a new solver.
    end : s.
    repeats : number of runs, >= 1.

    Returns
    -------
    (timing, states of the last run)
    """
    walls = []
    for _ in range(repeats):
        solver = make()
        begin = clock.perf_counter()
        states = list(solver.march(end))
        walls.append(clock.perf_counter() - begin)
    return Timing(float(np.median(walls)), min(walls), max(walls)), states


def peak_memory() -> float:
    """Largest memory this process has held so far, bytes."""
    return 1024.0 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
