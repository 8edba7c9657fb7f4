"""The report's tongue: both solvers, and the speed of the implicit method."""

from __future__ import annotations

import time

import numpy as np
import pytest

from dolfin_tongue.body.state import State
from dolfin_tongue.boundary import Attached, Gravity
from dolfin_tongue.constitutive import ActiveMuscles, ReportTissue, Viscosity
from dolfin_tongue.control import SmoothRamp
from dolfin_tongue.direct import TrBdf2
from dolfin_tongue.scene.scene import Scene

END = 0.4


@pytest.fixture(scope="module")
def tongue() -> Scene:
    """42 bricks under gravity; two muscles, one after the other."""
    pytest.importorskip("gmsh")
    from dolfin_tongue.geometry.preliminary import preliminary_tongue

    activation = {
        "genioglossus_anterior": SmoothRamp(0.3, 0.05, 0.1),
        "styloglossus": SmoothRamp(0.2, 0.16, 0.1),
    }
    terms = (ReportTissue(), Viscosity(50.0), ActiveMuscles(activation), Gravity())
    held = Attached("base", "genioglossus_origin", "styloglossus_insertion")
    return Scene(preliminary_tongue(), terms, (held,))


def trajectory(states: list[State]) -> tuple[np.ndarray, np.ndarray]:
    """Times and displacements, shape (steps, 3 n)."""
    return (
        np.array([state.time for state in states]),
        np.array([state.displacement.ravel() for state in states]),
    )


def worst(states: list[State], reference: list[State]) -> float:
    """Largest error of a displacement over the largest displacement, at the common times."""
    times, path = trajectory(reference)
    mine_times, mine = trajectory(states)
    common, here, there = np.intersect1d(
        np.round(mine_times, 9), np.round(times, 9), return_indices=True
    )
    assert len(common) > 20
    return float(np.abs(mine[here] - path[there]).max() / np.abs(path).max())


@pytest.fixture(scope="module")
def reference(tongue) -> list[State]:
    """Direct solution with steps of 0.25 ms."""
    return list(TrBdf2(2.5e-4, newton=1e-10).solver(tongue).march(END))


def test_tongue_moves_within_one_per_cent_at_10_ms(tongue, reference):
    solver = TrBdf2(1e-2, newton=1e-6).solver(tongue)
    states = list(solver.march(END))
    assert worst(states, reference) <= 0.01
    change, _ = solver.model.constraints.evaluate(states[-1].displacement)
    assert np.abs(change / solver.model.body.volumes).max() <= 1e-10
    # The factors are kept: far fewer factorisations than steps.
    assert solver.counts()["factorisations"] <= len(states) / 3


def test_both_solvers_move_the_tongue_alike(tongue, reference):
    pytest.importorskip("dolfinx")
    from dolfin_tongue.fenicsx import GeneralisedAlpha

    errors = [
        worst(list(GeneralisedAlpha(dt=dt).solver(tongue).march(END)), reference)
        for dt in (5e-3, 2.5e-3)
    ]
    assert errors[1] <= 2e-3
    assert 3.0 <= errors[0] / errors[1] <= 5.0


@pytest.mark.slow
def test_speed(tongue, reference):
    """Print simulated seconds per second of processor time, at the error that belongs to it."""
    for dt, newton in ((5e-3, 1e-6), (1e-2, 1e-6), (1e-2, 1e-5), (1.5e-2, 1e-5)):
        speeds = []
        for _ in range(11):
            solver = TrBdf2(dt, newton=newton).solver(tongue)
            begin = time.process_time()
            states = list(solver.march(END))
            speeds.append(END / (time.process_time() - begin))
        low, median, high = np.percentile(speeds, [10, 50, 90])
        error = 100 * worst(states, reference) if dt != 1.5e-2 else np.nan
        print(
            f"dt {1e3 * dt:g} ms, newton {newton:g} m: error {error:.2f} %, "
            f"{median:.1f} s/s ({low:.1f} to {high:.1f})"
        )
        assert median > 2.0
