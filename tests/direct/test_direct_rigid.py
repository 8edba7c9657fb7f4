"""Rigid bodies in the direct solver: balances, orders, prescribed motion, light and heavy ones."""

from __future__ import annotations

import numpy as np
import pytest
from cases import relative

from dolfin_tongue.base.errors import BadScene, NotConverged, OutOfRange
from dolfin_tongue.boundary import Attached, Gravity, Sliding
from dolfin_tongue.constitutive import ActiveMuscles, MooneyRivlin, ReportTissue, Viscosity
from dolfin_tongue.control import Constant, SmoothRamp
from dolfin_tongue.control.motion import SmoothMove, Still, Swing
from dolfin_tongue.direct import (
    Adaptive,
    Direct,
    Implicit,
    RungeKutta4,
    momentum,
    multipliers,
    saddle,
)
from dolfin_tongue.direct.limits import StabilityLimits
from dolfin_tongue.direct.multipliers import Acceleration
from dolfin_tongue.direct.tr_bdf2 import Motion
from dolfin_tongue.geometry.simple import block_body, distort
from dolfin_tongue.march.state import State
from dolfin_tongue.rigid import AngularSpring, Moment, RigidBody, Spring, plane
from dolfin_tongue.rigid.loads import Loads
from dolfin_tongue.scene.scene import Scene
from dolfin_tongue.surfaces import Sphere
from dolfin_tongue.terms.term import Held

HINGE = {"x": Still(), "z": Still()}
PIVOT = (-0.03, 0.005, 0.01)
CENTRE = (-0.01, 0.005, 0.005)
TISSUE = (ReportTissue(), Viscosity(5.0))
END = 0.03


def jaw(mass: float = 0.02, regions=("x0",), **options) -> RigidBody:
    """Body in front of the block, with a pivot apart from its centre of mass."""
    return RigidBody("jaw", regions, mass, 2.5e-4 * mass, CENTRE, pivot=PIVOT, **options)


def scene_of(*supports, terms=None) -> Scene:
    """Block of three cells, 3 cm long, with an oblique muscle."""
    body = block_body((0.03, 0.01, 0.01), (3, 1, 1), muscles={"pull": (1.0, 0.4, 0.2)})
    return Scene(body, terms or (*TISSUE, Gravity()), supports)


def final(scene: Scene, method, end: float = END) -> State:
    """Last state of a march."""
    *_, state = Direct(scene, method).march(end)
    return state


def two_bodies() -> Scene:
    """Jaw and hyoid with one prescribed coordinate, a spring between them, nodes on a ball."""
    body = distort(
        block_body((0.03, 0.02, 0.02), (3, 2, 2), muscles={"pull": (1.0, 0.4, 0.2)}), 0.3
    )
    body.node_sets["on ball"] = body.nodes("y0")[[5, 9]]
    body.node_sets["back"] = np.setdiff1d(body.nodes("x1"), body.nodes("y0"))
    ball = Sphere((0.015, -0.1, 0.01), 0.1)
    body.points[body.node_sets["on ball"]] = ball.project(body.points[body.node_sets["on ball"]])
    between = Spring((-0.01, 0.0, 0.0), (0.04, 0.01, -0.01), 300.0, 0.5, to="hyoid")
    hyoid = RigidBody(
        "hyoid", ("back",), 0.01, 1e-6, (0.035, 0.01, 0.01),
        (AngularSpring(0.1, 1e-3), Moment(0.01)), {"z": Swing(1e-3, 5.0)},
    )  # fmt: skip
    muscle = ActiveMuscles({"pull": Constant(0.5)}, max_stress=5e3)
    supports = (jaw(forces=(between,)), hyoid, Sliding(ball, "on ball"))
    return Scene(body, (*TISSUE, muscle, Gravity((1.0, 0.5, -9.0))), supports)


def random_rows(solver: Direct, time: float, turning: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Random displacement and velocity with all rows; angles of up to 0.2, rates of 5 1/s."""
    random, shape = np.random.default_rng(3), solver.model.shape
    u, v = 5e-4 * random.uniform(-1, 1, shape), 0.1 * random.uniform(-1, 1, shape)
    at = solver.model.bodies.coordinates
    u[at, 2], v[at, 2] = 0.2 * random.uniform(-1, 1, 2), turning * np.array([5.0, -3.0])
    solver.model.hold(time, u, v)
    return u, v


# -- equations -----------------------------------------------------------------------------------


@pytest.mark.parametrize("how", ["dense", "conjugate gradients", "lumped"])
def test_accelerations_fulfil_all_balances_and_constraints(how, monkeypatch):
    """Stated anew, with the inertia of `Loads`, for two coupled bodies and sliding nodes."""
    if how == "conjugate gradients":
        monkeypatch.setattr(multipliers, "DENSE_NODES", 0)
    method = RungeKutta4(1e-4, tau=2e-3, mass="lumped" if how == "lumped" else "consistent")
    scene, time = two_bodies(), 0.013
    solver = Direct(scene, method)
    model, tau = solver.model, 2e-3
    u, v = random_rows(solver, time)
    a, pressure = solver.stepper.acceleration(time, u, v)
    at, count = model.bodies.coordinates, len(scene.body.points)

    change, gradients = model.constraint(u)
    second = model.constraint_curvature(u, v) + model.constraint_rate(gradients, a)
    damped = 2 / tau * model.constraint_rate(gradients, v) + change / tau**2
    for part in (slice(0, model.cell_count), slice(model.cell_count, None)):
        assert np.abs(second + damped)[part].max() <= 1e-10 * np.abs(damped[part]).max()

    # Free nodes.
    force = model.force(time, u, v)
    model.add_constraint_force(gradients, pressure, force)
    rest = force - model.mass @ a[:count]
    assert np.abs(rest[model.free]).max() <= 1e-9 * np.abs(force).max()

    # Attached nodes move with their bodies, which obey (61), (62).
    loads, received = Loads(scene.rigid_bodies, scene.gravity), np.zeros(6)
    q, rate, acceleration = u[at].ravel(), v[at].ravel(), a[at].ravel()
    for i, body in enumerate(scene.rigid_bodies):
        nodes = body.nodes(scene.body)
        arms, part = body.arms(scene.body.points[nodes]), slice(3 * i, 3 * i + 3)
        T = plane.jacobian(arms, q[part])
        expected = T @ acceleration[part] + plane.bend(arms, q[part]) * rate[part][2] ** 2
        np.testing.assert_allclose(a[nodes], expected, rtol=1e-12, atol=1e-12)
        received[part] = np.einsum("kij,ki->j", T, rest[nodes])
    balance = loads.inertia(q, rate, acceleration) - loads.force(time, q, rate) - received
    free = [0, 1, 2, 3, 5]
    scale = np.abs(loads.force(time, q, rate)).max()
    assert np.abs(balance[free]).max() <= 1e-9 * scale
    assert abs(balance[4]) > 1e-3 * scale  # what drives the prescribed coordinate
    assert acceleration[4] == Swing(1e-3, 5.0).at(time)[2]

    # The function for comparison with other programs says the same.
    state = model.state(time, u, v, pressure)
    told = model.force_on_bodies(state, a[:count])
    np.testing.assert_allclose(told.ravel(), received, rtol=1e-9, atol=1e-9 * scale)


def stage(solver: Direct, u, v, step: float, time: float):
    """Function from (change of unknown velocities, multipliers) to momentum and rates of a stage."""
    model, stepper = solver.model, solver.stepper
    random = np.random.default_rng(5)
    history = v - step * 20.0 * random.uniform(-1, 1, v.shape)

    def point(change: np.ndarray, multiplier: np.ndarray) -> Motion:
        motion = Motion(time, u, v.copy(), v, multiplier)
        model.add_unknowns(change, motion.v)
        stepper._place(motion, u - step * v, history, step)
        return motion

    def residual(change: np.ndarray, multiplier: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        p = point(change, multiplier)
        force = stepper._balance(time, p, model.constraint_gradients(p.u))
        # rates at the gradients of the beginning, as in Newton's matrix
        rates = model.constraint_rate(model.constraint_gradients(u), p.v)
        return -model.reduced(time, p.u, p.v, p.a, force), rates

    return point, residual


@pytest.mark.parametrize(("turning", "bound"), [(0.0, 1e-8), (1.0, 1e-4)], ids=["still", "turning"])
def test_newton_s_matrix_is_the_derivative_of_the_stage(turning, bound):
    """Border, Hessians of g, springs, arms that turn: exact but for stiffness times turning."""
    solver, step, time = Direct(two_bodies(), Implicit()), 1e-3, 0.013
    model, stepper = solver.model, solver.stepper
    u, v = random_rows(solver, time, turning)
    random = np.random.default_rng(6)
    multiplier = 2e3 * random.uniform(-1, 1, model.constraint_count)
    point, residual = stage(solver, u, v, step, time)
    stepper._renew(time, point(np.zeros(model.size), multiplier), step, step)
    dv = 0.1 * random.standard_normal(model.size)
    dv[-3], dv[-1] = 3.0, -4.0  # the angles: their nodes then move like all others
    dp = 1e3 * random.standard_normal(model.constraint_count)
    e = 1e-4
    plus, minus = (residual(s * e * dv, multiplier + s * e * dp) for s in (1, -1))
    rhs = [(a - b) / (2 * e) for a, b in zip(plus, minus, strict=True)]
    velocity, found = stepper._solver(*rhs)
    assert relative(velocity, dv) <= bound
    assert relative(found, dp) <= 10 * bound
    if turning:  # that what is left out is of this size, and the turning of T is not
        half = Direct(two_bodies(), Implicit())
        point, residual = stage(half, u, v, step / 4, time)
        half.stepper._renew(time, point(np.zeros(model.size), multiplier), step / 4, step / 4)
        plus, minus = (residual(s * e * dv, multiplier + s * e * dp) for s in (1, -1))
        rhs = [(a - b) / (2 * e) for a, b in zip(plus, minus, strict=True)]
        again, _ = half.stepper._solver(*rhs)
        assert relative(again, dv) <= relative(velocity, dv) / 8  # second order: 16


def test_full_newton_converges_fast_with_bodies_and_slides():
    """Linearly, by the strain and rotation of a step: what Newton's matrix leaves out."""
    solver = Direct(two_bodies(), Implicit(4e-3, newton=1e-13, patience=0))
    sizes: list[float] = []
    correct = solver.stepper._correct

    def recorded(*arguments):
        sizes.append(correct(*arguments))
        return sizes[-1]

    solver.stepper._correct = recorded
    list(solver.march(0.02))
    ratios = np.array(sizes[1:]) / sizes[:-1]
    within = np.array(sizes[:-1]) > 1e-13  # not the last one of its stage
    assert within.sum() >= 30
    # The first step, of 4 ms from rest without activation ramp, turns by 0.02.
    assert ratios[within].max() <= 0.1


def test_the_implicit_stage_balances_the_bodies_at_its_tolerance():
    """Action = reaction: what the bodies lack is what Newton's tolerance leaves."""
    scene = two_bodies()
    solver = Direct(scene, Implicit(1e-3, newton=1e-12))
    list(solver.march(0.02))
    point, model = solver.stepper._inner, solver.model
    count, at = len(scene.body.points), model.bodies.coordinates
    q, rate = point.u[at].ravel(), point.v[at].ravel()
    load = Loads(scene.rigid_bodies, scene.gravity).force(point.time, q, rate)
    state = model.state(point.time, point.u, point.v, point.pressure)
    received = model.force_on_bodies(state, point.a[:count]).ravel()
    inertia = np.zeros(6)
    for i, body in enumerate(scene.rigid_bodies):
        part = slice(3 * i, 3 * i + 3)
        arm = body.arms(np.asarray(body.centre))
        T = plane.jacobian(arm, q[part])[0]
        inertia[part] = body.mass * T.T @ point.a[count + i]
        inertia[3 * i + 2] += body.inertia * point.a[at][i, 2]
    free = [0, 1, 2, 3, 5]
    # A velocity of newton / (d h) is left, which M / (d h) turns into a force.
    left = 1e-12 / (0.29e-3) ** 2 * (0.02 + scene.body.mass)
    assert np.abs(inertia - load - received)[free].max() <= left <= 1e-5 * np.abs(load).max()


def test_sparse_systems_and_adapted_steps_give_the_same_motion(monkeypatch):
    usual = final(two_bodies(), Implicit(1e-3, newton=1e-12))
    with monkeypatch.context() as patch:
        patch.setattr(saddle, "DENSE_SIZE", 0)
        sparse = final(two_bodies(), Implicit(1e-3, newton=1e-12))
    for name in ("displacement", "velocity", "rigid", "rigid_rate", "pressure", "sliding"):
        assert relative(getattr(sparse, name), getattr(usual, name)) <= 1e-7
    tight = final(two_bodies(), Adaptive(1e-10))
    solver = Direct(two_bodies(), Implicit(2e-4, tolerance=1e-6, newton=1e-10))
    states = list(solver.march(END))
    steps = np.array([state.step for state in states[1:]])
    assert steps.max() > 1.5 * steps.min()
    assert np.abs(states[-1].displacement - tight.displacement).max() <= len(steps) * 1e-6
    assert relative(usual.displacement, tight.displacement) <= 1e-3
    assert relative(usual.rigid, tight.rigid) <= 1e-3


# -- balances of a motion ------------------------------------------------------------------------


def flight(method) -> tuple[np.ndarray, np.ndarray]:
    """Momentum and angular momentum of a free jaw with a block that a muscle bends; tumbling."""
    muscle = ActiveMuscles({"pull": SmoothRamp(0.8, 0.0, 0.05)}, max_stress=5e3)
    scene = scene_of(jaw(), terms=(*TISSUE, muscle))
    solver = Direct(scene, method)
    rate, arms = np.array([0.1, 0.2, 8.0]), scene.body.points - PIVOT
    velocity = plane.jacobian(arms, np.zeros(3)) @ rate
    zero = np.zeros_like(velocity)
    start = State(0.0, zero, velocity, np.zeros(3), rigid_rate=rate[None])
    pairs = [momentum(solver.model, state) for state in solver.march(0.06, start)]
    linear, angular = (np.array(part) for part in zip(*pairs, strict=True))
    return linear[:, [0, 2]], angular[:, 1]


def test_a_free_body_with_a_block_keeps_its_momentum():
    linear, angular = flight(Implicit(2e-3, newton=1e-14, patience=0))
    assert np.abs(linear - linear[0]).max() <= 1e-12 * np.abs(linear[0]).max()
    _, finer = flight(Implicit(1e-3, newton=1e-12))
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
    solver = Direct(scene, Adaptive(1e-11, rtol=1e-10))
    energies = [
        solver.model.energy(s.displacement, s.velocity, s.rigid, s.rigid_rate)
        for s in solver.march(END)
    ]
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
    methods = [Implicit(dt, newton=1e-12, corrections=corrections) for dt in (1e-3, 5e-4)]
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
    for method, bound in ((RungeKutta4(2e-4), 1e-12), (Implicit(1e-3, newton=1e-12), 1e-4)):
        whole = final(pendulum, method)
        half = final(pendulum, method, END / 2)
        *_, end = Direct(pendulum, method).march(END, half)
        assert relative(end.rigid, whole.rigid) <= bound
        assert relative(end.displacement, whole.displacement) <= bound


# -- prescribed motion ---------------------------------------------------------------------------

OPENING = {**HINGE, "angle": SmoothMove(-0.1745)}


@pytest.mark.parametrize(
    "method", [RungeKutta4(5e-4), Adaptive(1e-7), Implicit(1e-2)], ids=["rk4", "pair", "implicit"]
)
def test_attached_nodes_follow_a_prescribed_opening(method):
    scene = scene_of(jaw(motion=OPENING))
    nodes = scene.body.nodes("x0")
    arms = scene.body.points[nodes] - PIVOT
    angle = 0.0
    for state in Direct(scene, method).march(0.21):
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
    methods = (Adaptive(1e-10), Implicit(5e-3, newton=1e-11))
    for method in methods:
        body, held = (
            final(scene_of(part), method, 0.1) for part in (jaw(motion=OPENING), Opened())
        )
        # Held nodes get their rates by central differences over 1e-4 s: (1e-4 / 0.2)^2.
        assert relative(body.displacement, held.displacement) <= 1e-6
        assert relative(body.velocity, held.velocity) <= 1e-5
        assert relative(body.pressure, held.pressure) <= 1e-4


def test_accelerations_of_a_prescribed_body_are_exact():
    solver = Direct(scene_of(jaw(motion=OPENING)), RungeKutta4(1e-4))
    model, time = solver.model, 0.05
    nodes = model.bodies.attached

    def placed(t: float) -> np.ndarray:
        u = np.zeros(model.shape)
        model.hold(t, u)
        return u[nodes]

    u, v = np.zeros((2, *model.shape))
    model.hold(time, u, v)
    h = 1e-3  # central differences of order 4: h^4 / 90 of the sixth derivative
    stencil = [-1, 16, -30, 16, -1]
    second = sum(w * placed(time + i * h) for w, i in zip(stencil, range(-2, 3), strict=True))
    found = model.held_acceleration(time, u, v)[nodes]
    assert relative(found, second / (12 * h * h)) <= 1e-6
    a, _ = solver.stepper.acceleration(time, u, v)
    np.testing.assert_array_equal(a[nodes], found)


# -- light, heavy, fast --------------------------------------------------------------------------


@pytest.mark.parametrize("mass", [1e-3, 10.0])
def test_light_and_heavy_jaws_run_through(mass):
    """A jaw of 1 g and one of 10 kg on springs, pulled by a muscle; by every method."""
    muscle = ActiveMuscles({"pull": SmoothRamp(0.8, 0.0, 0.05)}, max_stress=2e4)
    spring = Spring((-0.02, 0.005, 0.0), (-0.02, 0.005, -0.05), 500.0, 1.0)
    rigid = jaw(mass, forces=(spring, AngularSpring(0.05, 1e-3)), motion={"x": Still()})
    terms = (ReportTissue(), Viscosity(20.0), muscle, Gravity())
    solver = Direct(scene_of(rigid, terms=terms), Implicit(5e-3))
    states = list(solver.march(0.2))
    assert len(states) <= 41 + 5  # hardly a step was cut
    change, _ = solver.model.constraint(states[-1].displacement)
    assert np.abs(change / solver.model.rest_volumes).max() <= 1e-10
    early = Direct(solver.model.problem, RungeKutta4(1.5e-4))
    *_, explicit = early.march(0.02)
    *_, pair = Direct(solver.model.problem, Adaptive(1e-7)).march(0.02)
    implicit = next(state for state in states if state.time >= 0.02 - 1e-9)
    assert relative(explicit.rigid, pair.rigid) <= 1e-4
    assert relative(implicit.rigid, pair.rigid) <= 0.01
    if mass == 10.0:  # the block, 3 g, hardly disturbs it: it falls on its springs alone
        alone = Direct(scene_of(jaw(mass, (), forces=(spring, AngularSpring(0.05, 1e-3)),
                                    motion={"x": Still()}), Attached("x0"), terms=terms),
                       Implicit(5e-3))  # fmt: skip
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
def test_limit_of_a_light_body_is_sharp_and_named(terms, forces, cause, monkeypatch):
    scene = scene_of(jaw(1e-4, forces=forces), terms=terms)
    solver = Direct(scene, RungeKutta4(1e-8, 1e-2))
    solver.stepper.begin(solver.rest())
    limit = StabilityLimits(solver.stepper.acceleration)(
        0.0, *solver.stepper._now[:2], np.zeros(solver.model.constraint_count)
    )
    with pytest.raises(OutOfRange, match=f"which {cause}"):
        next(Direct(scene, RungeKutta4(2 * limit.step, 1e-2)).march(1.0))

    def speed(dt: float) -> float:
        march = Direct(scene, RungeKutta4(dt, 1e-2, watch=10**9))
        monkeypatch.setattr(march.stepper, "_judge", lambda *arguments: None)
        kicked = march.rest()
        kicked.rigid_rate[:] = [[1e-6, 1e-6, 1e-5]]
        *_, last = march.march(300 * dt, kicked)
        return float(np.abs(last.velocity).max())

    assert speed(0.95 * limit.step) <= 1.0
    with pytest.raises(NotConverged, match="beyond the stability limit"):
        speed(1.6 * limit.step)


def test_the_printed_metric_refuses_rigid_bodies():
    with pytest.raises(BadScene, match="no inverse mass"):
        Direct(scene_of(jaw()), RungeKutta4(1e-4, constraint_metric="report"))


def test_a_scene_without_bodies_has_no_rows_of_them():
    model = Direct(scene_of(Attached("x0")), Implicit()).model
    assert model.bodies is None and model.slides is None
    assert model.shape == model.load.shape and model.whole_mass is model.mass
    assert Acceleration(model, 1e-3)._border is None
