"""Motions with rigid bodies in the direct solver: balances, orders, supports, light and heavy."""

from __future__ import annotations

import numpy as np
import pytest
from cases import END, final, relative, unjudged
from rigid_cases import HINGE, OPENING, PIVOT, TISSUE, jaw, scene_of

from dolfin_tongue.base.errors import NotConverged, OutOfRange
from dolfin_tongue.body.state import State
from dolfin_tongue.boundary import Attached, Gravity
from dolfin_tongue.constitutive import ActiveMuscles, MooneyRivlin, ReportTissue, Viscosity
from dolfin_tongue.control import Instant, SmoothRamp
from dolfin_tongue.control.motion import SmoothMove, Still
from dolfin_tongue.direct import Adaptive, RungeKutta4, TrBdf2, momentum
from dolfin_tongue.direct.limits import StabilityLimits
from dolfin_tongue.direct.multipliers import Acceleration
from dolfin_tongue.rigid import AngularSpring, Spring, plane
from dolfin_tongue.scene.scene import Scene
from dolfin_tongue.terms.support import Held

# -- balances of a motion ------------------------------------------------------------------------


def flight(method) -> tuple[np.ndarray, np.ndarray]:
    """Momentum and angular momentum of a free jaw with a block that a muscle bends; tumbling."""
    muscle = ActiveMuscles({"pull": SmoothRamp(0.8, 0.0, 0.05)}, max_stress=5e3)
    scene = scene_of(jaw(), terms=(*TISSUE, muscle))
    solver = method.solver(scene)
    rate, arms = np.array([0.1, 0.2, 8.0]), scene.body.points - PIVOT
    velocity = plane.jacobian(arms, np.zeros(3)) @ rate
    zero = np.zeros_like(velocity)
    start = State(0.0, zero, velocity, np.zeros(3), rigid_rate=rate[None])
    pairs = [momentum(solver.model, state) for state in solver.march(0.06, start)]
    linear, angular = (np.array(part) for part in zip(*pairs, strict=True))
    return linear[:, [0, 2]], angular[:, 1]


def test_a_free_body_with_a_block_keeps_its_momentum():
    linear, angular = flight(TrBdf2(2e-3, newton=1e-14, patience=0))
    assert np.abs(linear - linear[0]).max() <= 1e-12 * np.abs(linear[0]).max()
    _, finer = flight(TrBdf2(1e-3, newton=1e-12))
    coarse, fine = (np.abs(part - part[0]).max() / abs(part[0]) for part in (angular, finer))
    assert fine <= 5e-5
    assert 3.2 <= coarse / fine <= 9
    linear, angular = flight(RungeKutta4(2e-4))
    finer, _ = flight(RungeKutta4(1e-4))
    coarse, fine = (np.abs(part - part[0]).max() for part in (linear, finer))
    # The coordinates, not the momentum, are what Runge-Kutta adds up: kept to its order.
    assert fine <= 1e-12 * np.abs(linear[0]).max()
    assert coarse / fine >= 8


def test_energy_of_an_elastic_pendulum_is_kept():
    scene = scene_of(jaw(motion=HINGE), terms=(ReportTissue(), Gravity()))
    solver = Adaptive(1e-11, rtol=1e-10).solver(scene)
    energies = [solver.model.energy(state) for state in solver.march(END)]
    assert np.ptp(energies) <= 1e-10 * 0.02 * 9.81 * 0.02


# -- orders --------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def pendulum() -> Scene:
    """Jaw hinged at its pivot that carries the block, falling."""
    return scene_of(jaw(motion=HINGE))


@pytest.fixture(scope="module")
def reference(pendulum) -> State:
    """Tight solution of the pendulum, which turns by 7 degrees."""
    state = final(pendulum, Adaptive(1e-12, rtol=1e-11))
    assert 0.1 < state.rigid[0, 2] < 0.2
    return state


def errors(state: State, reference: State) -> np.ndarray:
    """Relative errors of angle, its rate, displacement of the tip, velocity, pressure."""
    return np.array(
        [
            relative(getattr(state, name), getattr(reference, name))
            for name in ("rigid", "rigid_rate", "displacement", "velocity", "pressure")
        ]
    )


@pytest.mark.parametrize("corrections", [None, 1], ids=["newton", "linearly implicit"])
def test_implicit_pendulum_has_order_2(pendulum, reference, corrections):
    methods = [TrBdf2(dt, newton=1e-12, corrections=corrections) for dt in (1e-3, 5e-4)]
    coarse, fine = (errors(final(pendulum, method), reference) for method in methods)
    measured = np.log2(coarse / fine)
    assert (np.abs(measured[:4] - 2) < 0.1).all(), measured
    assert measured[4] > 1.6
    assert fine[:4].max() <= 2e-5


def test_runge_kutta_pendulum_has_order_4_and_the_same_limit(pendulum, reference):
    coarse, fine = (errors(final(pendulum, RungeKutta4(dt)), reference) for dt in (4e-4, 2e-4))
    measured = np.log2(coarse / fine)
    assert (measured > 3.7).all() and (measured < 4.6).all(), measured
    assert fine[:4].max() <= 5e-7


def test_a_march_goes_on_from_a_state(pendulum):
    for method, bound in ((RungeKutta4(2e-4), 1e-12), (TrBdf2(1e-3, newton=1e-12), 1e-4)):
        whole = final(pendulum, method)
        half = final(pendulum, method, END / 2)
        *_, end = method.solver(pendulum).march(END, half)
        assert relative(end.rigid, whole.rigid) <= bound
        assert relative(end.displacement, whole.displacement) <= bound


# -- prescribed motion ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    "method", [RungeKutta4(5e-4), Adaptive(1e-7), TrBdf2(1e-2)], ids=["rk4", "pair", "implicit"]
)
def test_attached_nodes_follow_a_prescribed_opening(method):
    scene = scene_of(jaw(motion=OPENING))
    nodes = scene.body.nodes("x0")
    arms = scene.body.points[nodes] - PIVOT
    angle = 0.0
    for state in method.solver(scene).march(0.21):
        angle, rate, _ = SmoothMove(-0.1745).at(state.time)
        c, s = np.cos(angle), np.sin(angle)
        turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        by_angle = np.array([[-s, 0, c], [0, 0, 0], [-c, 0, -s]])
        moved = state.displacement[nodes]
        np.testing.assert_allclose(moved, arms @ turn.T - arms, rtol=0, atol=1e-17)
        expected = rate * arms @ by_angle.T
        np.testing.assert_allclose(state.velocity[nodes], expected, rtol=0, atol=1e-15)
        np.testing.assert_allclose(state.rigid, [[0, 0, angle]], rtol=0, atol=0)
        np.testing.assert_allclose(state.rigid_rate, [[0, 0, rate]], rtol=0, atol=0)
    assert angle == -0.1745


class Opened(Held):
    """The same opening, by displacements alone."""

    def nodes(self, body):
        return body.nodes("x0")

    def displacement(self, points, time):
        return plane.displacement(
            points - PIVOT, np.array([0.0, 0.0, SmoothMove(-0.1745).at(time)[0]])
        )


def test_a_prescribed_body_moves_the_tissue_as_held_nodes_do():
    methods = (Adaptive(1e-10), TrBdf2(5e-3, newton=1e-11))
    for method in methods:
        body, held = (
            final(scene_of(part), method, 0.1) for part in (jaw(motion=OPENING), Opened())
        )
        # Held nodes get their rates by central differences over 1e-4 s: (1e-4 / 0.2)^2.
        assert relative(body.displacement, held.displacement) <= 1e-6
        assert relative(body.velocity, held.velocity) <= 1e-5
        assert relative(body.pressure, held.pressure) <= 1e-4


# -- light, heavy, fast --------------------------------------------------------------------------


@pytest.mark.parametrize("mass", [1e-3, 10.0])
def test_light_and_heavy_jaws_run_through(mass):
    """A jaw of 1 g and one of 10 kg on springs, pulled by a muscle; by every method."""
    muscle = ActiveMuscles({"pull": SmoothRamp(0.8, 0.0, 0.05)}, max_stress=2e4)
    spring = Spring((-0.02, 0.005, 0.0), (-0.02, 0.005, -0.05), 500.0, 1.0)
    rigid = jaw(mass, forces=(spring, AngularSpring(0.05, 1e-3)), motion={"x": Still()})
    terms = (ReportTissue(), Viscosity(20.0), muscle, Gravity())
    solver = TrBdf2(5e-3).solver(scene_of(rigid, terms=terms))
    states = list(solver.march(0.2))
    assert len(states) <= 41 + 5  # hardly a step was cut
    change, _ = solver.model.constraints.evaluate(states[-1].displacement)
    assert np.abs(change / solver.model.body.volumes).max() <= 1e-10
    early = RungeKutta4(1.5e-4).solver(solver.scene)
    *_, explicit = early.march(0.02)
    *_, pair = Adaptive(1e-7).solver(solver.scene).march(0.02)
    implicit = next(state for state in states if state.time >= 0.02 - 1e-9)
    assert relative(explicit.rigid, pair.rigid) <= 1e-4
    assert relative(implicit.rigid, pair.rigid) <= 0.01
    if mass == 10.0:  # the block, 3 g, hardly disturbs it: it falls on its springs alone
        bone = jaw(mass, (), forces=rigid.forces, motion=rigid.motion)
        alone = TrBdf2(5e-3).solver(scene_of(bone, Attached("x0"), terms=terms))
        *_, other = alone.march(0.2)
        assert relative(states[-1].rigid, other.rigid) <= 0.05


@pytest.mark.parametrize(
    ("terms", "forces", "cause"),
    [
        (TISSUE, (Spring((-0.02, 0.005, 0.0), (-0.02, 0.005, -0.05), 1e5),),
         "springs and dampers of jaw"),
        (TISSUE, (AngularSpring(0.0, 0.1),), "springs and dampers of jaw"),
        ((MooneyRivlin(1e6, 0.0),), (), "the passive stiffness of MooneyRivlin"),
    ],
    ids=["spring", "damper", "tissue"],
)  # fmt: skip
def test_limit_of_a_light_body_is_sharp_and_named(terms, forces, cause):
    scene = scene_of(jaw(1e-4, forces=forces), terms=terms)
    solver = RungeKutta4(1e-8, 1e-2).solver(scene)
    model = solver.model
    nothing = np.zeros(model.constraints.count)
    limits = StabilityLimits(Acceleration(model, 1e-2))
    limit = limits(Instant(0.0), *model.rows(solver.rest()), nothing)
    with pytest.raises(OutOfRange, match=f"which {cause}"):
        next(RungeKutta4(2 * limit.step, 1e-2).solver(scene).march(1.0))

    def speed(dt: float) -> float:
        solver = RungeKutta4(dt, 1e-2, watch=10**9).solver(scene)
        kicked = solver.rest()
        kicked.rigid_rate[:] = [[1e-6, 1e-6, 1e-5]]
        *_, last = unjudged(solver, 300 * dt, kicked)
        return float(np.abs(last.velocity).max())

    assert speed(0.95 * limit.step) <= 1.0
    with pytest.raises(NotConverged, match="beyond the stability limit"):
        speed(1.6 * limit.step)
