"""Extreme scenes: every run finishes with volumes kept, or stops at a named time for a named cause.

The benchmark `stability` runs them all; here are the fast ones, and what its judge must notice.
"""

import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks.extremes import charts, contacts, peers, scenes
from benchmarks.extremes.outcome import FILES, KEPT, attempt, attempt_march, short_cause
from dolfin_tongue.anatomy.scenes import published_scene
from dolfin_tongue.app import demo
from dolfin_tongue.body.state import State
from dolfin_tongue.control import Ramp, Step
from dolfin_tongue.direct import RungeKutta4, TrBdf2
from dolfin_tongue.fenicsx import GeneralisedAlpha, Statics
from dolfin_tongue.geometry.preliminary import preliminary_tongue
from dolfin_tongue.geometry.published import published_tongue
from dolfin_tongue.march.solver import Solver

BOTH = (GeneralisedAlpha(5e-3), TrBdf2(5e-3))
IDS = ("alpha2", "TR-BDF2")


def assert_finished(outcome, end):
    assert outcome.kind == "finished", outcome
    assert outcome.time == end and outcome.volume <= KEPT


@pytest.mark.parametrize("method", BOTH, ids=IDS)
@pytest.mark.parametrize(
    "change",
    [{"factor": 1e3}, {"factor": 1e-3}, {"viscosity": 6e4}, {"control": Step(1.0, 0.1)}],
    ids=["stiff", "soft", "viscous", "sudden"],
)
def test_the_tongue_survives_extreme_numbers(change, method, tmp_path):
    scene = scenes.tongue(preliminary_tongue(), **({"control": scenes.half_active()} | change))
    assert_finished(attempt(scene, 0.2, tmp_path, method), 0.2)


@pytest.mark.parametrize("dt", [20e-3, 50e-3])
@pytest.mark.parametrize("method", [GeneralisedAlpha, TrBdf2])
def test_the_tongue_survives_large_steps(dt, method, tmp_path):
    scene = scenes.tongue(preliminary_tongue(), scenes.half_active())
    assert_finished(attempt(scene, 0.3, tmp_path, method(dt)), 0.3)


@pytest.mark.parametrize("method", BOTH, ids=IDS)
def test_cells_of_poor_shape_are_no_obstacle(method, tmp_path):
    body = scenes.bad_block(0.05)
    assert body.scaled_jacobians.min() == pytest.approx(0.05, abs=1e-6)
    assert_finished(attempt(scenes.muscle_block(body=body), 0.1, tmp_path, method), 0.1)


@pytest.mark.parametrize("method", BOTH, ids=IDS)
@pytest.mark.parametrize(
    "scene",
    [scenes.driven_block(0.33, 3.0), scenes.driven_block(0.33, 1e-4), scenes.driven_block(-0.035)],
    ids=["stretched", "torn", "inverted"],
)
def test_what_cannot_go_on_stops_with_a_cause(scene, method, tmp_path):
    outcome = attempt(scene, 3.0, tmp_path, method)
    assert outcome.kind == "stopped", outcome
    assert f"t = {outcome.time:.6g}" in outcome.cause and "det F" in outcome.cause
    assert outcome.volume <= KEPT
    assert outcome.reason in outcome.short and "det F" in outcome.reason
    for name in FILES:
        assert (tmp_path / name).stat().st_size > 0
    summary = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert summary["status"] == f"stopped: {outcome.cause}"


@pytest.mark.parametrize(("tau", "dt"), [(1e-4, 1e-3), (1e-5, 1e-4)])
def test_a_short_time_constant_is_the_named_limit(tau, dt):
    outcome, states = attempt_march(scenes.muscle_block(), 0.06, RungeKutta4(dt, tau))
    assert outcome.kind == "refused" and not states
    assert short_cause(outcome.cause).startswith(f"the constraint time constant tau = {tau:g} s")


@pytest.mark.parametrize("method", BOTH, ids=IDS)
def test_rest_stays_rest(method):
    scene = scenes.tongue(preliminary_tongue())
    rest = Statics(scene).solve()
    start = State(0.0, rest.displacement, rest.velocity, rest.pressure)
    outcome, states = attempt_march(scene, 1.0, method, start=start)
    assert_finished(outcome, 1.0)
    moved = max(np.abs(s.displacement - rest.displacement).max() for s in states)
    assert moved < 1e-8


@pytest.mark.parametrize("cells", [(4, 2, 2), (8, 4, 4)])
def test_the_block_swings_at_a_step_that_resolves_nothing_without_gaining_energy(cells):
    """Energy after 0.5 s (undamped) over the largest kinetic energy: TR-BDF2 loses some."""
    scene = scenes.febio_dynamic(cells, active=False)
    outcome, _ = attempt_march(scene, 0.5, TrBdf2(5e-3))
    assert_finished(outcome, 0.5)
    weight = scene.body.mass * 9.81 * abs(peers.SAG[cells])
    assert outcome.energies.max() <= 1e-6 * weight


@pytest.mark.parametrize("ms", [5, 2])
@pytest.mark.parametrize("method", [GeneralisedAlpha, TrBdf2])
def test_a_contraction_across_the_block_is_survived(ms, method, tmp_path):
    """FEBio 4.11 dies of it at 0.345 and 0.234 s."""
    scene = scenes.febio_dynamic((4, 2, 2), active=True)
    assert_finished(attempt(scene, 0.35, tmp_path, method(1e-3 * ms)), 0.35)


@pytest.mark.parametrize(("case", "expected"), peers.STATIC.items())
def test_static_contractions_agree_with_febio(case, expected):
    """Its bulk modulus is 400 to 1250 times the shear modulus, ours has no end: 0.1 %."""
    scene = scenes.febio_static(*case)
    end = Statics(scene).solve().displacement[scene.body.nodes("x1")].mean(axis=0)
    assert 1e3 * end[:2] == pytest.approx(expected, abs=1e-3 * np.linalg.norm(expected))


@pytest.mark.parametrize(("cells", "expected"), peers.SAG.items())
def test_static_sag_agrees_with_febio(cells, expected):
    scene = scenes.febio_dynamic(cells, active=False)
    sag = Statics(scene).solve().displacement[scene.body.nodes("x1"), 0].mean()
    assert sag == pytest.approx(expected, rel=2e-3)


def test_the_judge_sees_nan_missing_files_and_lost_volumes(tmp_path, monkeypatch):
    scene = scenes.muscle_block()
    march = Solver.march

    def spoiled(self, end, start=None):
        for state in march(self, end, start):
            state.pressure[0] = np.nan if state.time > 0.02 else 0.0
            yield state

    monkeypatch.setattr(Solver, "march", spoiled)
    assert attempt_march(scene, 0.03, GeneralisedAlpha(5e-3))[0].kind == "fault"
    monkeypatch.setattr(Solver, "march", march)
    monkeypatch.setattr("benchmarks.extremes.outcome.KEPT", 1e-20)
    assert attempt_march(scene, 0.03, GeneralisedAlpha(5e-3))[0].kind == "drifted"
    monkeypatch.setattr("benchmarks.extremes.outcome.FILES", ("steps.csv", "absent"))
    outcome = attempt(scene, 0.01, tmp_path, GeneralisedAlpha(5e-3))
    assert outcome.kind == "fault" and "no absent on disk" in outcome.cause


def test_the_map_is_drawn(tmp_path):
    points = [
        charts.Point("m", "factor", 1.0, dt, kind, "limit, which tau = 1 s sets", 0.5, 1, 0.1, 0.0)
        for dt, kind in zip(charts.MAP_STEPS, charts.LOOK, strict=True)
    ]
    picture = charts.draw_map(points, ["m"], tmp_path / "map.png")
    assert picture.stat().st_size > 10_000
    assert [p.letter for p in points if p.kind == "refused"] == ["t"]
    assert charts.counted(points) == ", ".join(f"1 {kind}" for kind in charts.LOOK)


@pytest.mark.slow
def test_every_muscle_of_the_published_tongue_may_contract_fully(published_folder, tmp_path):
    body = published_tongue(published_folder)
    for muscle in body.fibres.names:
        scene = published_scene(published_folder, {muscle: Ramp(1.0, 0.0, 0.05)}, body)
        for method in BOTH:
            assert_finished(attempt(scene, 0.15, tmp_path / muscle, method), 0.15)


@pytest.mark.slow
def test_the_benchmark_finds_no_fault(tmp_path):
    table = demo.load("stability", "benchmark")(demo.Options(Path(tmp_path)))
    assert "0 faults" in table["faults"]["note"]
    for name in ("extremes.csv", "extremes.json", "map.csv", "stability.png", "table.md"):
        assert (tmp_path / name).stat().st_size > 0


@pytest.mark.parametrize("method", BOTH, ids=IDS)
@pytest.mark.parametrize(
    "scene",
    [
        contacts.closing_palate(0.006, 0.02),
        contacts.squeezed_tongue(0.5, 0.05),
        contacts.weighed_mandible(1e-3),
        contacts.weighed_mandible(10.0),
        contacts.sliding_block(0.03, 50.0),
        scenes.film_on_a_corner(0.073),
    ],
    ids=["closing", "squeezed", "light", "heavy", "sliding", "film"],
)
def test_boundaries_survive_extremes(scene, method, tmp_path):
    assert_finished(attempt(scene, 0.12, tmp_path, method), 0.12)
