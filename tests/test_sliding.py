"""Sliding nodes in the FEniCSx solver (49)-(52): exact motions, constraint, energy, tangent."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.extremes.proofs import (
    AMPLITUDE,
    BOWL,
    STIFF,
    block_in_bowl,
    exact_period,
    period_of,
    swing_angles,
)
from dolfin_tongue.base.errors import BadMesh, BadScene, UnknownName
from dolfin_tongue.boundary import Attached, Gravity, Sliding, moved_onto
from dolfin_tongue.boundary.sliding import off_surface
from dolfin_tongue.constitutive import MooneyRivlin, Viscosity
from dolfin_tongue.geometry.simple import block_body
from dolfin_tongue.scene.scene import Scene
from dolfin_tongue.surfaces import Plane, Sphere

pytest.importorskip("dolfinx")


@pytest.fixture(scope="module")
def swing():
    """Angles of the centre of mass over a period, at two steps, with audits."""
    from dolfin_tongue.fenicsx import GeneralisedAlpha
    from dolfin_tongue.record.observe import EnergyAudit

    scene = block_in_bowl()
    period, nodes = exact_period(scene), scene.body.nodes("z0")
    runs = {}
    for dt in (0.008, 0.004):
        solver = GeneralisedAlpha(dt, spectral_radius=0.95).solver(scene)
        audit = EnergyAudit(solver, scene)
        states = list(solver.march(1.02 * period))
        places = [(scene.body.points + state.displacement)[nodes] for state in states]
        records = [audit.update(state) for state in states]
        runs[dt] = {
            "angles": swing_angles(scene, states),
            "off": max(float(np.abs(off_surface(BOWL, place)).max()) for place in places),
            "balance": max(abs(r["balance_J"]) for r in records)
            / max(r["kinetic_J"] for r in records),
        }
    return period, runs


def test_period_of_a_block_in_a_bowl_is_that_of_the_pendulum(swing):
    period, runs = swing
    errors = {dt: abs(period_of(run["angles"]) / period - 1) for dt, run in runs.items()}
    assert errors[0.004] < 2e-3
    assert errors[0.004] < 0.4 * errors[0.008]  # order 2: a quarter
    widest = max(run["angles"][:, 1].max() for run in runs.values())
    assert widest == pytest.approx(2 * AMPLITUDE, rel=1e-3)


def test_nodes_stay_on_the_bowl(swing):
    _, runs = swing
    assert max(run["off"] for run in runs.values()) <= 1e-9


def test_energy_is_kept_but_for_the_damping_of_time_stepping(swing):
    _, runs = swing
    assert runs[0.004]["balance"] < 1e-3
    assert runs[0.004]["balance"] < 0.4 * runs[0.008]["balance"]


def test_no_tangential_force():
    """A viscous block on a tilted plane falls along it as if it were free."""
    from dolfin_tongue.fenicsx import GeneralisedAlpha

    body = block_body((0.02, 0.02, 0.02), (2, 2, 2))
    plane = Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    terms = (STIFF, Viscosity(3e3), Gravity((3.0, 0.0, -9.81)))  # viscous, so that it stops ringing
    scene = Scene(body, terms, (Sliding(plane, "z0"),))
    solver = GeneralisedAlpha(2e-3).solver(scene)
    for state in solver.march(0.05):
        last = state
    # Without friction the block falls freely along the plane: x = g_x t^2 / 2 for every node, as
    # exactly as Newton's method is solved over 25 steps (1e-8 m each).
    nodes = body.nodes("z0")
    assert np.abs(last.displacement[nodes, 0] - 1.5 * last.time**2).max() < 25 * 1e-8
    assert np.abs(last.displacement[nodes, 2]).max() <= 1e-9
    # The multipliers carry the weight.
    assert last.sliding.sum() == pytest.approx(9.81 * body.mass, rel=1e-3)


def test_static_block_hangs_from_a_sliding_support():
    """A block that is held on one side and slides on a plane below: multipliers are reactions."""
    from dolfin_tongue.fenicsx import Statics

    body = block_body((0.02, 0.02, 0.02), (2, 2, 2))
    sets = {**body.node_sets, "foot": np.setdiff1d(body.nodes("z0"), body.nodes("x0"))}
    body = replace(body, node_sets=sets)
    scene = Scene(body, (MooneyRivlin(), Gravity()), (Attached("x0"), Sliding(Plane(), "foot")))
    statics = Statics(scene)
    state = statics.solve()
    assert np.abs(state.displacement[body.nodes("foot"), 2]).max() <= 1e-9
    system = statics.system
    reactions = system.displacement(system.reactions(system.at_state(state)))
    carried = state.sliding.sum() + reactions[body.nodes("x0"), 2].sum()
    assert carried == pytest.approx(9.81 * body.mass, rel=1e-9)


def test_start_off_the_surface_is_refused_and_projected():
    body = block_body((0.02, 0.02, 0.02), (2, 2, 2))
    bowl = Sphere((0.01, 0.01, 0.1), 0.1, inside=True)
    with pytest.raises(BadScene, match=r"8 of 9 node\(s\) are not on the surface.*moved_onto"):
        Scene(body, (STIFF,), (Sliding(bowl, "z0"),))
    moved = moved_onto(body, bowl, "z0")
    assert np.abs(off_surface(bowl, moved.points[body.nodes("z0")])).max() < 1e-15
    Scene(moved, (STIFF,), (Sliding(bowl, "z0"),))
    with pytest.raises(BadMesh, match="inverted"):
        moved_onto(body, Plane((0.0, 0.0, 0.03)), "z0")


def test_bad_input_is_refused():
    body = block_body((0.02, 0.02, 0.02), (2, 2, 2))
    with pytest.raises(BadScene, match="takes a surface first"):
        Sliding("z0", "z0")  # type: ignore[arg-type]
    with pytest.raises(BadScene, match="takes names"):
        Sliding(Plane())
    with pytest.raises(UnknownName, match="known region names"):
        Scene(body, (STIFF,), (Sliding(Plane(), "floor"),))
    with pytest.raises(BadScene, match=r"both Attached\(x0\) and Sliding\(z0\)"):
        Scene(body, (STIFF,), (Attached("x0"), Sliding(Plane(), "z0")))
