"""Impacts in the direct solver: steps that neither pass an obstacle nor gain energy."""

from __future__ import annotations

import numpy as np
import pytest
from cases import EDGE, load_of, raised_block

from dolfin_tongue.base.errors import BadScene, NotConverged
from dolfin_tongue.body.state import State
from dolfin_tongue.boundary import Attached, Barrier, Contact, Gravity, ReportContact
from dolfin_tongue.constitutive import MooneyRivlin, ReportTissue, Viscosity
from dolfin_tongue.control import SmoothMove, Still
from dolfin_tongue.direct import Adaptive, DirectSolver, RungeKutta4, TrBdf2, impacts
from dolfin_tongue.direct.tr_bdf2 import D
from dolfin_tongue.geometry.simple import block_body
from dolfin_tongue.scene.scene import Scene
from dolfin_tongue.surfaces import Plane, Sphere


def falling(solver: DirectSolver, speed: float) -> State:
    state = solver.rest()
    state.velocity[:, 2] = -speed
    return state


class Watched:
    """States of a march with energies, momenta, smallest gaps and resultants."""

    def __init__(self, solver: DirectSolver, end: float, start: State | None = None):
        model, self.solver = solver.model, solver
        self.states = list(solver.march(end, start))
        self.energy = np.array([model.energy(s) for s in self.states])
        first = self.states[0].velocity
        self.kinetic = 0.5 * float(np.sum(first * (model.mass @ first)))
        self.momentum = np.array([(model.mass @ s.velocity).sum(axis=0) for s in self.states])
        self.times = np.array([s.time for s in self.states])
        touches = [list(solver.contacts(s).values()) for s in self.states]
        self.gap = min(touch.gap for row in touches for touch in row)
        self.resultant = np.array([sum(touch.force for touch in row) for row in touches])
        self.touches = touches


@pytest.mark.parametrize("dt", [5e-3, 1e-3])
@pytest.mark.parametrize("corner", [False, True], ids=["flat", "corner"])
@pytest.mark.parametrize("speed", [0.1, 1.0])
def test_a_dropped_block_neither_passes_nor_gains_energy(speed, corner, dt):
    """Momentum changes by what contact and weight gave, to the error Newton's method leaves."""
    terms = (ReportTissue(), Viscosity(1.0), Gravity(), Contact(Plane()))
    solver = TrBdf2(dt, newton=1e-9).solver(Scene(raised_block(corner, 5e-4), terms))
    run = Watched(solver, 0.06, falling(solver, speed))
    assert 0 < run.gap < Barrier().range
    assert run.energy.max() - run.energy[0] <= impacts.GAIN * run.kinetic
    weight, mass = load_of(solver.model).sum(axis=0), solver.model.mass.sum()
    change = run.momentum[-1] - run.momentum[0] - weight * run.times[-1]
    [impulse] = solver.stepper.impacts.impulses
    steps = np.diff(run.times)
    assert impulse[2] > 0.5 * speed * mass
    assert np.abs(change - impulse).max() <= 3 * mass * (1e-9 / (D * steps)).sum()


def test_the_impulse_is_the_resultant_over_time():
    """A soft touch, resolved: the trapezoidal rule errs by dt^2."""
    terms = (ReportTissue(), Viscosity(5.0), Contact(Plane(), law=Barrier(2e-3, 300.0)))
    error = []
    for dt in (1e-3, 5e-4):
        solver = TrBdf2(dt, newton=1e-10).solver(Scene(raised_block(False, 2.2e-3), terms))
        run = Watched(solver, 0.02, falling(solver, 0.1))
        mean = 0.5 * (run.resultant[1:] + run.resultant[:-1])
        impulse = (np.diff(run.times)[:, None] * mean).sum(axis=0)
        change = run.momentum[-1] - run.momentum[0]
        error.append(np.abs(impulse - change).max() / np.abs(change).max())
        assert solver.counts()["euler_steps"] == 0
    assert error[0] <= 1e-2
    assert error[1] <= error[0] / 3


def test_energy_that_tr_bdf2_makes_is_refused(monkeypatch):
    """A stiff block on a soft barrier would rebound with 1.04 of its energy."""
    law = Barrier(range=2e-3, pressure=300.0)
    terms = (ReportTissue(), MooneyRivlin(1e5, 0.0), Contact(Plane(), law=law))

    def rise() -> float:
        solver = TrBdf2(5e-3).solver(Scene(raised_block(False, 4.25e-3), terms))
        run = Watched(solver, 0.06, falling(solver, 0.5))
        assert run.gap < 2e-3
        return float(run.energy.max() / run.energy[0]) - 1.0

    assert rise() <= impacts.GAIN
    monkeypatch.setattr(impacts, "GAIN", 1e9)
    assert rise() > 2 * 1e-2


def test_the_order_stays_where_contact_is_smooth():
    """A plate that presses slowly; against a tight reference."""
    body = block_body((0.03, 0.01, 0.01), (3, 1, 1))
    motion = (Still(), Still(), SmoothMove(1e-3, 0.0, 0.05))
    tilted = Plane((0.03, 0.0, -1.5e-4), (-0.2, 0.0, 1.0))  # away from the nodes that are held
    plate = Contact(tilted, "z0", Barrier(pressure=100.0), motion)
    scene = Scene(body, (ReportTissue(), Viscosity(10.0), plate), (Attached("x0"),))
    *_, exact = Adaptive(1e-10, rtol=1e-8).solver(scene).march(0.04)
    error = []
    for dt in (2.5e-3, 1.25e-3, 6.25e-4):
        solver = TrBdf2(dt, newton=1e-10).solver(scene)
        *_, last = solver.march(0.04)
        error.append(np.abs(last.displacement - exact.displacement).max())
    assert np.log2(error[0] / error[-1]) / 2 >= 1.7


def test_a_block_rests_with_its_weight_on_the_plane():
    """Newton's tolerance times the stiffness of the contact is what the resultant may miss."""
    tolerance = 1e-10
    terms = (ReportTissue(), Viscosity(50.0), Gravity(), Contact(Plane(), "z0"))
    solver = TrBdf2(5e-3, newton=tolerance).solver(Scene(raised_block(False, 2e-4), terms))
    run = Watched(solver, 0.5)
    weight = load_of(solver.model).sum(axis=0)
    [touch] = run.touches[-1]
    _, slope, _ = Barrier().traction(np.array([touch.gap]))
    stiffness = -slope[0] * EDGE**2
    left = np.abs(np.diff(run.momentum, axis=0)[-1]).max() / 5e-3
    assert left <= 1e-4 * np.abs(weight).max()
    assert np.abs(touch.force + weight).max() <= left + 10 * tolerance * stiffness
    assert touch.gap > 0
    assert touch.area == pytest.approx(EDGE**2, rel=1e-12)
    assert touch.traction >= -weight[2] / EDGE**2
    assert run.energy.max() <= run.energy[0] + 1e-12


@pytest.mark.parametrize("speed", [3.0, 20.0])
def test_a_step_through_the_whole_barrier_ends_before_the_plane(speed):
    """In one step the stiff block would be 15 mm or 100 mm behind the plane, not 0.2 mm before."""
    terms = (ReportTissue(), MooneyRivlin(1e5, 0.0), Contact(Plane()))
    solver = TrBdf2(5e-3).solver(Scene(raised_block(False, 1e-3, (1, 1, 1)), terms))
    run = Watched(solver, 0.02, falling(solver, speed))
    assert run.gap > 0
    # TR-BDF2 takes the step: contact makes what GAIN allows, and the elastic forces, which turn
    # within the step, do work of their own (0.6 % here; none with two cells per edge).
    assert run.energy.max() <= run.energy[0] * (1 + 2 * impacts.GAIN)


def test_the_reports_law_dissipates_and_lets_a_steady_push_creep_through():
    law = ReportContact(a1=1e6)
    terms = (ReportTissue(), Viscosity(5.0), Gravity(), Contact(Plane(), "z0", law))
    solver = TrBdf2(2e-3).solver(Scene(raised_block(False, 5e-4), terms))
    run = Watched(solver, 0.1, falling(solver, 0.2))
    assert np.diff(run.energy).max() <= 1e-6 * run.kinetic
    gaps = np.array([touch.gap for [touch] in run.touches])
    assert gaps[-1] < 0  # behind the plane
    assert np.diff(gaps)[-10:].max() < 0  # and on its way
    # Creep: in the end the traction 2 a1 (range - gap) |rate| carries the weight.
    depth, rate = law.range - gaps[-1], -np.diff(gaps)[-1] / 2e-3
    weight = -load_of(solver.model).sum(axis=0)[2]
    assert 2 * law.a1 * depth * rate * EDGE**2 == pytest.approx(weight, rel=0.05)


def test_a_barrier_beside_it_stops_the_creep():
    contacts = (Contact(Plane(), law=ReportContact(a1=1e6)), Contact(Plane()))
    terms = (ReportTissue(), Viscosity(5.0), Gravity(), *contacts)
    solver = TrBdf2(5e-3).solver(Scene(raised_block(False, 5e-4), terms))
    run = Watched(solver, 0.3, falling(solver, 0.2))
    assert run.gap > 0
    assert np.abs(run.states[-1].velocity).max() <= 1e-3
    assert np.diff(run.energy).max() <= impacts.GAIN * run.kinetic


@pytest.mark.parametrize("corrections", [None, 1])
def test_a_moved_ball_pushes_in_and_the_work_is_its_own(corrections):
    """Thrust against a held block: what it gains is at most the work of the ball."""
    body = block_body((0.03, 0.02, 0.015), (3, 2, 2))
    motion = (Still(), Still(), SmoothMove(-3e-3, 0.0, 0.02))
    push = Contact(Sphere((0.015, 0.01, 0.0255), 0.01), "z1", motion=motion)
    scene = Scene(body, (ReportTissue(), Viscosity(10.0), push), (Attached("z0"),))
    solver = TrBdf2(1e-3, corrections=corrections).solver(scene)
    run = Watched(solver, 0.04)
    assert 0 < run.gap < 2e-4
    assert run.resultant[-1, 2] < 0
    places = np.array([push.shift(t)[0] for t in run.times])
    mean = 0.5 * (run.resultant[1:] + run.resultant[:-1])
    work = float(np.sum(mean * np.diff(places, axis=0)))
    assert 0 < run.energy[-1] <= 1.02 * work


# -- explicit methods ----------------------------------------------------------------------------


def dropped(method) -> DirectSolver:
    terms = (ReportTissue(), Viscosity(2.0), Contact(Plane()))
    return method.solver(Scene(raised_block(True, 5e-4), terms))


def test_explicit_methods_agree_and_pass_nothing():
    """They share no control of the step; energy that one may make is what they may differ by."""
    fixed = dropped(RungeKutta4(2e-4, cut=True))
    with pytest.warns(RuntimeWarning, match="contact cuts steps of 0.0002 s"):
        run = Watched(fixed, 0.01, falling(fixed, 1.0))
    pair = dropped(Adaptive(1e-8, rtol=1e-7))
    other = Watched(pair, 0.01, falling(pair, 1.0))
    for one in (run, other):
        assert 0 < one.gap < 1e-4
        assert one.energy.max() <= one.energy[0] * (1 + impacts.GAIN)
    assert abs(run.energy[-1] - other.energy[-1]) <= impacts.GAIN * run.energy[0]
    steps = [state.step for state in run.states[1:]]
    assert min(steps) < 1e-4
    assert max(steps) == pytest.approx(2e-4)


def test_an_uncut_explicit_step_into_the_obstacle_is_refused():
    solver = dropped(RungeKutta4(2e-4))
    with pytest.raises(NotConverged, match=r"too long for contact.*Plane.*cut=True"):
        list(solver.march(0.01, falling(solver, 1.0)))


def test_an_adaptive_run_that_ends_behind_an_obstacle_is_refused(monkeypatch):
    """Without a force from the obstacle nothing else would stop it."""
    solver = dropped(Adaptive(1e-8))
    [obstacle] = solver.model.obstacles
    monkeypatch.setattr(obstacle, "add_force", lambda *arguments: None)
    with pytest.raises(NotConverged, match="behind the obstacle") as caught:
        list(solver.march(0.01, falling(solver, 1.0)))
    assert caught.value.time < 0.01


def test_a_start_behind_the_obstacle_is_refused():
    terms = (ReportTissue(), Contact(Plane()))
    for method in (TrBdf2(), RungeKutta4(1e-4), Adaptive()):
        solver = method.solver(Scene(raised_block(False, 1e-3), terms))
        state = solver.rest()
        state.displacement[:, 2] = -2e-3
        with pytest.raises(BadScene, match=r"0\.001 m behind the obstacle"):
            next(solver.march(0.1, state))
