"""No silent blow-up: steps beyond the stability limit are refused or cut, with the cause."""

from __future__ import annotations

import re

import numpy as np
import pytest
from cases import unjudged

from dolfin_tongue.base.errors import NotConverged, OutOfRange
from dolfin_tongue.boundary import Attached, Gravity
from dolfin_tongue.constitutive import ActiveMuscles, MooneyRivlin, ReportTissue, Viscosity
from dolfin_tongue.control import Instant, Ramp
from dolfin_tongue.direct import Adaptive, RungeKutta4, TrBdf2, runge_kutta4
from dolfin_tongue.direct.limits import StabilityLimits
from dolfin_tongue.direct.multipliers import Acceleration
from dolfin_tongue.geometry.simple import block_body
from dolfin_tongue.scene.scene import Scene


def block(*terms) -> Scene:
    """Held block of 1 cm cells."""
    body = block_body((0.03, 0.02, 0.01), (3, 2, 1), muscles={"pull": (1.0, 0.0, 0.0)})
    return Scene(body, (*terms, Gravity()), (Attached("x0"),))


@pytest.mark.parametrize(
    ("terms", "dt", "tau", "cause"),
    [
        ((ReportTissue(), Viscosity(50.0)), 5e-3, 1e-2, "the viscosity of Viscosity"),
        ((MooneyRivlin(1e6, 0.0),), 5e-3, 1e-2, "the passive stiffness of MooneyRivlin"),
        ((ReportTissue(),), 1e-3, 1e-4, r"the constraint time constant tau = 0\.0001 s"),
    ],
    ids=["viscosity", "stiffness", "tau"],
)
def test_a_step_beyond_the_limit_is_refused_with_its_cause(terms, dt, tau, cause):
    solver = RungeKutta4(dt, tau).solver(block(*terms))
    message = (
        f"dt = {dt} s is not allowed.*at most the stability limit, which {cause}.* sets to .* s$"
    )
    with pytest.raises(OutOfRange, match=message):
        next(solver.march(0.1))


@pytest.mark.parametrize(
    ("terms", "tau"),
    [((ReportTissue(), Viscosity(20.0)), 1e-2), ((MooneyRivlin(1e6, 0.0),), 1e-2),
     ((ReportTissue(),), 1e-4)],
    ids=["viscosity", "stiffness", "tau"],
)  # fmt: skip
def test_the_limit_is_sharp(terms, tau):
    """Just below the limit the motion stays; a factor 1.6 beyond it is lost."""
    scene = block(*terms)
    solver = RungeKutta4(1e-6, tau).solver(scene)
    state = solver.rest()
    arrays = (state.displacement, state.velocity, state.pressure)
    limit = StabilityLimits(Acceleration(solver.model, tau))(Instant(0.0), *arrays).step
    kick = np.random.default_rng(0).uniform(-1e-6, 1e-6, state.velocity.shape)
    kick[solver.model.numbering.held] = 0.0
    state.velocity[:] = kick

    def speed(dt: float) -> float:
        solver = RungeKutta4(dt, tau, watch=10**9).solver(scene)
        *_, last = unjudged(solver, 400 * dt, state)
        return float(np.abs(last.velocity).max())

    assert np.isfinite(speed(0.95 * limit))
    with pytest.raises(NotConverged, match="beyond the stability limit"):
        speed(1.6 * limit)


def test_a_step_is_cut_on_request_with_a_warning():
    solver = RungeKutta4(5e-3, cut=True).solver(block(ReportTissue(), Viscosity(50.0)))
    with pytest.warns(RuntimeWarning, match=r"step cut from 0\.005 s to .*the viscosity"):
        states = list(solver.march(0.005))
    assert max(state.step for state in states) < 5e-4
    assert np.isfinite(states[-1].displacement).all()


def test_a_limit_that_falls_below_the_step_on_the_way_is_named():
    """Rising activation stiffens the block until the step is too large."""
    muscle = ActiveMuscles({"pull": Ramp(1.0, 0.0, 0.02)}, max_stress=2e4)
    solver = RungeKutta4(5e-4, watch=1).solver(block(ReportTissue(), muscle))
    states = []
    with pytest.raises(NotConverged, match="beyond the stability limit") as caught:
        for state in solver.march(0.1):
            states.append(state)
    assert "the active stiffness (force-velocity slope) of ActiveMuscles" in str(caught.value)
    assert 1e-3 < caught.value.time == states[-1].time
    assert all(np.isfinite(state.displacement).all() for state in states)


@pytest.mark.parametrize(
    ("method", "cause"),
    [(RungeKutta4(2e-4, watch=10**9), "the motion is lost in a step of .*: not the step"),
     (Adaptive(1e-6), "the motion is lost in a step of .*: Required step size is less than"),
     (TrBdf2(5e-3, smallest=1e-4), "a stage is not finite in a step of")],
    ids=["rk4", "pair", "implicit"],
)  # fmt: skip
def test_a_lost_motion_names_time_cells_and_cause(method, cause, monkeypatch):
    """Forces that turn into NaN stand for anything that goes wrong in a step."""
    solver = method.solver(block(ReportTissue()))
    force = solver.model.force

    def broken(now, displacement, velocity):
        return force(now, displacement, velocity) * (np.nan if now.time > 0.0105 else 1.0)

    monkeypatch.setattr(solver.model, "force", broken)
    states = []
    with pytest.raises(NotConverged, match=r"Most distorted cells.*det F") as caught:
        for state in solver.march(0.1):
            states.append(state)
    assert caught.value.time == states[-1].time <= 0.0106
    assert re.match(cause, caught.value.reason)
    assert caught.value.diagnosis.cells


def test_the_implicit_method_takes_steps_far_beyond_the_explicit_limit():
    scene = block(MooneyRivlin(1e6, 0.0), Viscosity(5e4))
    state = RungeKutta4(1e-6).solver(scene).rest()
    model = TrBdf2().solver(scene).model
    limits = StabilityLimits(Acceleration(model, 1e-3))
    limit = limits(Instant(0.0), state.displacement, state.velocity, state.pressure)
    *_, last = TrBdf2(5e-3).solver(scene).march(0.1)
    assert 5e-3 > 1000 * limit.step
    change, _ = model.constraints.evaluate(last.displacement)
    assert np.abs(change / model.body.volumes).max() <= 1e-10


def test_lost_volumes_are_noticed_before_anything_is_infinite(monkeypatch):
    monkeypatch.setattr(runge_kutta4, "LOST_VOLUME", 1e-12)
    solver = RungeKutta4(2e-4).solver(block(ReportTissue()))
    with pytest.raises(NotConverged, match=r"the motion is lost .* not the step \(its limit is"):
        list(solver.march(0.1))
