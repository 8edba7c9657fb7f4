"""Motion in time: order, volumes, balance, break points, failures, resuming."""

from dataclasses import replace

import numpy as np
import pytest

from dolfin_tongue.base.errors import BadScene, NotConverged, OutOfRange, TongueError
from dolfin_tongue.body.shape import volume_changes
from dolfin_tongue.boundary import Attached, Gravity
from dolfin_tongue.constitutive import ActiveMuscles, ReportTissue, Viscosity
from dolfin_tongue.control import Control, Ramp, SmoothRamp, Step
from dolfin_tongue.fenicsx import GeneralisedAlpha, Statics, System, Tolerances
from dolfin_tongue.fenicsx.compile import cache_folder
from dolfin_tongue.geometry.simple import block_body
from dolfin_tongue.record.fingerprint import fingerprint
from dolfin_tongue.record.observe import EnergyAudit
from dolfin_tongue.record.recorder import Recorder
from dolfin_tongue.record.run import simulate
from dolfin_tongue.scene.scene import Scene

TIGHT = Tolerances(1e-12, 1e-12)
BODY = block_body((0.04, 0.02, 0.02), (3, 2, 2), muscles={"along": (1.0, 0.0, 0.3)})


def muscle_scene(control, *more, eta=40.0):
    muscles = ActiveMuscles({"along": control}, 15e3)
    return Scene(BODY, (ReportTissue(), Viscosity(eta), muscles, *more), (Attached("x0"),))


def history(scene, steps, end):
    states = list(steps.solver(scene).march(end))
    times = np.array([state.time for state in states])
    return times, {
        name: np.array([getattr(state, name) for state in states])
        for name in ("displacement", "velocity", "pressure")
    }


def test_order_two_in_displacement_and_velocity():
    """A smooth load: half the step divides errors by 4, here at least by 3.6, 3.4, 2.6 (pressure)."""
    scene = muscle_scene(SmoothRamp(0.5, 0.0, 0.08))
    end, fine = 0.08, 1.25e-4
    _, reference = history(scene, GeneralisedAlpha(fine, newton=TIGHT), end)
    errors = {name: [] for name in reference}
    for ratio in (32, 16, 8):
        _, coarse = history(scene, GeneralisedAlpha(ratio * fine, newton=TIGHT), end)
        for name, values in coarse.items():
            difference = np.abs(values - reference[name][::ratio]).reshape(len(values), -1)
            errors[name].append(difference.max() / np.abs(reference[name]).max())
    for name, least in (("displacement", 3.6), ("velocity", 3.4), ("pressure", 2.6)):
        ratios = np.array(errors[name][:-1]) / np.array(errors[name][1:])
        assert (ratios >= least).all(), (name, errors[name])
    assert errors["displacement"][-1] < 1e-3


def test_backward_euler_is_of_order_one():
    scene = muscle_scene(SmoothRamp(0.5, 0.0, 0.08))
    end = 0.08
    _, reference = history(scene, GeneralisedAlpha(2.5e-4, newton=TIGHT), end)
    errors = []
    for ratio in (16, 8, 4):
        steps = GeneralisedAlpha(ratio * 2.5e-4, method="backward_euler", newton=TIGHT)
        _, coarse = history(scene, steps, end)
        errors.append(np.abs(coarse["displacement"] - reference["displacement"][::ratio]).max())
    ratios = np.array(errors[:-1]) / np.array(errors[1:])
    assert ((ratios > 1.7) & (ratios < 2.3)).all()


def test_energy_balance_closes_with_order_two():
    """Balance error over exchanged energy: at most 1e-3 at 1.25 ms, below a third at half the step."""
    scene = muscle_scene(SmoothRamp(0.5, 0.01, 0.08), Gravity())
    errors = []
    for dt in (5e-3, 2.5e-3, 1.25e-3):
        dynamics = GeneralisedAlpha(dt).solver(scene)
        audit = EnergyAudit(dynamics, scene)
        records = [audit.update(state) for state in dynamics.march(0.15)]
        errors.append(max(abs(r["balance_J"]) for r in records) / records[-1]["exchanged_J"])
    assert errors[-1] <= 1e-3
    assert errors[0] / errors[1] > 3 and errors[1] / errors[2] > 3


def test_free_fall_is_exact_and_keeps_momentum():
    """Nothing holds the body: it falls as a point does, without strain or pressure."""
    scene = Scene(BODY, (ReportTissue(), Gravity((0.0, 3.0, -9.81))))
    dynamics = GeneralisedAlpha(0.01, newton=TIGHT).solver(scene)
    *_, last = dynamics.march(0.1)
    expected = np.array([0.0, 3.0, -9.81]) * 0.1**2 / 2
    assert last.displacement == pytest.approx(np.tile(expected, (len(BODY.points), 1)), abs=1e-9)
    assert np.abs(last.pressure).max() < 1e-3


def test_volumes_are_kept_at_every_accepted_state():
    scene = muscle_scene(Step(0.6, 0.02), Gravity())
    for radius in (0.0, 0.5, 0.8, 1.0):
        steps = GeneralisedAlpha(5e-3, spectral_radius=radius)
        for state in steps.solver(scene).march(0.1):
            assert np.abs(volume_changes(BODY, state.displacement)).max() <= 1e-8


def test_hydrostatic_pressure_of_a_filled_cup():
    """Tissue held by bottom and walls of a cup hardly moves: p = rho g (h - z), positive."""
    cup = block_body((0.02, 0.02, 0.04), (4, 4, 8))
    distance = np.abs(cup.points[:, :2] - 0.01).max(axis=1)
    wall = np.flatnonzero((distance > 0.0099) | (cup.points[:, 2] < 1e-9))
    scene = Scene(replace(cup, node_sets={"cup": wall}), (ReportTissue(a0=5e4), Gravity()),
                  (Attached("cup"),))  # fmt: skip
    state = Statics(scene).solve()
    layers = state.pressure.reshape(8, 16).mean(axis=1)  # numbering: x fastest, z slowest
    depth = 0.04 - cup.points[cup.cells].mean(axis=1)[:, 2].reshape(8, 16).mean(axis=1)
    assert (np.diff(depth) < 0).all()
    # met to round-off: nothing moves, since these pressures balance the weights of even layers
    assert layers == pytest.approx(cup.density * 9.81 * depth, rel=0.03)


def test_cells_that_are_held_altogether_are_refused():
    scene = Scene(BODY, (ReportTissue(),), (Attached("x0", "y0", "y1", "x1"),))
    assert GeneralisedAlpha().solver(scene)  # two cells wide: no cell is held altogether
    slab = block_body((0.04, 0.02, 0.01), (3, 1, 1))
    with pytest.raises(BadScene, match=r"all nodes of cell\(s\) 0, 1, 2"):
        GeneralisedAlpha().solver(Scene(slab, (ReportTissue(),), (Attached("y0", "y1"),)))


def test_motion_comes_to_rest_at_the_static_equilibrium():
    scene = muscle_scene(SmoothRamp(0.3, 0.0, 0.05), Gravity(), eta=150.0)
    *_, last = GeneralisedAlpha(0.01, newton=TIGHT).solver(scene).march(3.0)
    rest = Statics(scene, replace(TIGHT, renew_above=0.0)).solve()
    scale = np.abs(rest.displacement).max()
    assert np.abs(last.velocity).max() < 1e-7
    assert np.abs(last.displacement - rest.displacement).max() < 1e-7 * scale
    assert np.abs(last.pressure - rest.pressure).max() < 1e-5 * np.abs(rest.pressure).max()


def test_steps_end_at_break_points_and_at_the_end():
    scene = muscle_scene(Ramp(0.3, 0.0123, 0.02))
    times = [state.time for state in GeneralisedAlpha(5e-3).solver(scene).march(0.05)]
    assert 0.0123 in times and times[-1] == 0.05
    assert min(abs(t - 0.0323) for t in times) < 1e-15
    assert (np.diff(times) <= 5e-3 * (1 + 1e-12)).all() and (np.diff(times) > 1e-4).all()


def test_break_points_that_differ_by_round_off_are_one():
    """0.05 + 0.1 is not 0.15 in floating point; a step of 3e-17 s would end the run."""
    body = block_body((0.04, 0.02, 0.02), (3, 2, 2), muscles={"a": (1, 0, 0), "b": (0, 1, 0)})
    controls = {"a": Ramp(0.3, 0.05, 0.1), "b": Ramp(0.2, 0.15, 0.1)}
    assert 0.05 + 0.1 != 0.15
    scene = Scene(body, (ReportTissue(), ActiveMuscles(controls, 1e4)), (Attached("x0"),))
    assert len(scene.breakpoints) == 3
    times = [state.time for state in GeneralisedAlpha(0.01).solver(scene).march(0.2)]
    assert len(times) == 21


def test_lagged_and_full_newton_agree():
    scene = muscle_scene(Step(0.6, 0.01), Gravity())
    runs = []
    for renew in (0.25, 0.0):
        dynamics = GeneralisedAlpha(5e-3, newton=Tolerances(1e-11, renew_above=renew)).solver(scene)
        *_, last = dynamics.march(0.06)
        runs.append((last.displacement, dynamics.counts()["factorisations"]))
    (lagged, few), (full, many) = runs
    assert np.abs(lagged - full).max() < 1e-9
    assert few < many / 2


def test_adaptive_steps_keep_their_tolerance_and_save_steps():
    scene = muscle_scene(SmoothRamp(0.5, 0.05, 0.05), eta=100.0)
    *_, reference = GeneralisedAlpha(5e-4, newton=TIGHT).solver(scene).march(0.5)
    states = list(GeneralisedAlpha(1e-3, tolerance=1e-6, largest=0.05).solver(scene).march(0.5))
    assert np.abs(states[-1].displacement - reference.displacement).max() < 5e-5
    assert len(states) < 150
    assert max(s.step for s in states) > 4 * min(s.step for s in states[1:])


def test_convergence_lost_in_a_large_step_is_recovered_by_cutting():
    """A full step of strong active stress needs smaller steps than the nominal one at first."""
    muscles = ActiveMuscles({"along": Step(1.0, 0.0)}, 400e3)
    scene = Scene(BODY, (ReportTissue(), Viscosity(20.0), muscles), (Attached("x0"),))
    states = list(GeneralisedAlpha(20e-3).solver(scene).march(0.04))
    assert states[-1].time == 0.04
    assert max(np.abs(volume_changes(BODY, s.displacement)).max() for s in states) <= 1e-8


def test_lost_convergence_says_when_where_and_why_and_keeps_the_states():
    """Rest is met exactly, so that the steps before the muscle starts are taken, and none after."""
    scene = muscle_scene(Step(1.0, 0.01))
    strict = Tolerances(1e-16, 1e-16, iterations=3)  # cannot be met in floating point
    seen = []
    expected = r"no convergence beyond t = .*DIVERGED.*cells.*det F"
    with pytest.raises(NotConverged, match=expected) as raised:
        for state in GeneralisedAlpha(5e-3, newton=strict).solver(scene).march(0.1):
            seen.append(state)
    assert [state.time for state in seen] == [0.0, 0.005, 0.01]
    assert raised.value.time == seen[-1].time
    assert "DIVERGED_MAX_IT" in raised.value.reason
    found = raised.value.diagnosis
    assert len(found.cells) == 5 and found.smallest_ratio == found.largest_stretch == 1.0


def test_run_that_loses_convergence_leaves_its_files(tmp_path):
    muscles = ActiveMuscles({"along": Step(1.0, 0.02)}, 15e3)
    scene = Scene(BODY, (ReportTissue(), muscles), (Attached("x0"),))
    tolerances = Tolerances(1e-9, 1e-10, iterations=3)
    steps = GeneralisedAlpha(0.01, smallest=9e-3, newton=tolerances)
    with pytest.raises(NotConverged):
        simulate(scene, 0.1, tmp_path, steps, frame_interval=0.01)
    assert '"stopped: no convergence' in (tmp_path / "summary.json").read_text()
    rows = (tmp_path / "steps.csv").read_text().splitlines()
    assert len(rows) >= 3  # header, start and what was accepted
    assert (tmp_path / "checkpoint.npz").exists() and (tmp_path / "fields.xdmf").exists()


def test_resumed_run_gives_the_same_motion(tmp_path):
    scene = muscle_scene(Ramp(0.4, 0.03, 0.03), Gravity())
    steps = GeneralisedAlpha(2.5e-3, newton=Tolerances(1e-11, 1e-11))
    whole = simulate(scene, 0.1, tmp_path / "whole", steps, frame_interval=0.01)
    simulate(scene, 0.05, tmp_path / "parts", steps, frame_interval=0.01)
    parts = simulate(scene, 0.1, tmp_path / "parts", steps, frame_interval=0.01, resume=True)
    # the acceleration is estimated anew at the seam: an error of the order of the method
    scale = np.abs(whole.last.displacement).max()
    assert np.abs(whole.last.displacement - parts.last.displacement).max() < 2e-4 * scale
    for name in ("steps.csv", "trajectories.csv"):
        a, b = (np.loadtxt(tmp_path / run / name, delimiter=",", skiprows=1)
                for run in ("whole", "parts"))  # fmt: skip
        assert a[:, 0] == pytest.approx(b[:, 0], abs=1e-12)
    assert [f.time for f in parts.frames] == pytest.approx([f.time for f in whole.frames])
    other = muscle_scene(Ramp(0.5, 0.03, 0.03), Gravity())
    with pytest.raises(BadScene, match="another scene"):
        simulate(other, 0.1, tmp_path / "parts", steps, resume=True)


@pytest.mark.parametrize("bad", [{"dt": 0.0}, {"dt": -1e-3}, {"dt": np.nan}, {"dt": np.inf}])
def test_bad_steps_are_refused(bad):
    with pytest.raises(OutOfRange, match="dt"):
        GeneralisedAlpha(**bad)
    with pytest.raises(OutOfRange, match="spectral_radius"):
        GeneralisedAlpha(spectral_radius=1.1)
    with pytest.raises(OutOfRange, match="one of generalised_alpha, backward_euler"):
        GeneralisedAlpha(method="leapfrog")
    with pytest.raises(OutOfRange, match="tolerance"):
        GeneralisedAlpha(tolerance=-1.0)


def test_end_before_start_is_refused():
    with pytest.raises(OutOfRange, match="end"):
        next(GeneralisedAlpha().solver(muscle_scene(Ramp(0.1))).march(0.0))


class Broken(Control):
    """A control of a user that fails at a time."""

    def __init__(self, error, time=0.011):
        self.error, self.time = error, time

    def __call__(self, time):
        if time > self.time:
            if isinstance(self.error, float):
                return self.error
            raise self.error
        return 0.1


@pytest.mark.parametrize("error", [ZeroDivisionError("mine"), KeyboardInterrupt()])
def test_what_a_user_raises_comes_through_and_what_was_computed_stays(tmp_path, error):
    scene = muscle_scene(Broken(error))
    with pytest.raises(type(error)):
        simulate(scene, 0.1, tmp_path, GeneralisedAlpha(5e-3))
    assert '"stopped' in (tmp_path / "summary.json").read_text()
    rows = (tmp_path / "steps.csv").read_text().splitlines()
    assert len(rows) == 4  # header, start, 5 ms, 10 ms
    with np.load(tmp_path / "checkpoint.npz") as saved:
        assert saved["time"] == pytest.approx(0.01)


@pytest.mark.parametrize("value", [2.0, -0.5, float("nan")])
def test_an_activation_that_leaves_the_unit_interval_during_a_run_is_refused(value):
    with pytest.raises(OutOfRange, match=r"activation of 'along' at t = 0\.01"):
        list(GeneralisedAlpha(5e-3).solver(muscle_scene(Broken(value))).march(0.1))


def test_refused_calls_leave_an_earlier_run_alone(tmp_path):
    scene, steps = muscle_scene(Ramp(0.2)), GeneralisedAlpha(5e-3)
    simulate(scene, 0.02, tmp_path, steps)
    names = [p for p in tmp_path.rglob("*") if p.is_file() and p.name != ".lock"]
    before = {p: p.read_bytes() for p in names}
    other = Scene(block_body((0.05, 0.02, 0.02), (4, 2, 2)), (ReportTissue(),), (Attached("x0"),))
    for bad in (
        lambda: simulate(scene, np.nan, tmp_path, steps),
        lambda: simulate(scene, 0.0, tmp_path, steps),
        lambda: simulate(scene, 0.04, tmp_path, steps, frame_interval=0.0),
        lambda: simulate(other, 0.04, tmp_path, steps, resume=True),
        lambda: simulate(scene, 0.04, tmp_path, GeneralisedAlpha(4e-3), resume=True),
        lambda: simulate(scene, 0.01, tmp_path, steps, resume=True),
    ):
        with pytest.raises((OutOfRange, BadScene)):
            bad()
    done = simulate(scene, 0.02, tmp_path, steps, resume=True)  # nothing left to do
    assert done.summary["status"] == "finished"
    assert {p: p.read_bytes() for p in before} == before


@pytest.mark.parametrize("name", ["checkpoint.npz", "steps.csv", "trajectories.csv"])
def test_damaged_files_are_named_when_a_run_is_resumed(tmp_path, name):
    scene, steps = muscle_scene(Ramp(0.2)), GeneralisedAlpha(5e-3)
    simulate(scene, 0.02, tmp_path, steps)
    (tmp_path / name).write_bytes(b"\x00garbage")
    with pytest.raises(BadScene, match="damaged"):
        simulate(scene, 0.04, tmp_path, steps, resume=True)


def test_two_runs_cannot_share_a_folder(tmp_path):
    scene = muscle_scene(Ramp(0.2))
    first = Recorder(tmp_path, scene, 0.01)
    with pytest.raises(TongueError, match="another run"):
        Recorder(tmp_path, scene, 0.01)
    first.close()
    Recorder(tmp_path, scene, 0.01).close()


def test_looking_at_a_body_does_not_change_its_fingerprint():
    first, second = muscle_scene(Ramp(0.2)), muscle_scene(Ramp(0.2))
    assert second.body.mass > 0 and second.body.scaled_jacobians.min() > 0
    assert fingerprint(first) == fingerprint(second) != fingerprint(muscle_scene(Ramp(0.3)))


def test_a_killed_compilation_does_not_block_the_next(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    folder = cache_folder()
    folder.mkdir(parents=True)
    orphan = folder / "libffcx_forms_0.c"
    orphan.write_text("half")
    System(Scene(BODY, (Gravity(),)), True)
    assert not orphan.exists()


def test_step_limits_must_make_sense():
    for bad in ({"smallest": np.nan}, {"smallest": -1.0}, {"largest": 1e-4}, {"newton": None}):
        with pytest.raises(OutOfRange):
            GeneralisedAlpha(5e-3, **bad)
