"""Rigid bodies in the direct solver: their equations, and Newton's method on a stage."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cases import END, final, relative
from rigid_cases import OPENING, TISSUE, jaw, scene_of

from dolfin_tongue.base.errors import BadScene
from dolfin_tongue.boundary import Attached, Gravity, Sliding
from dolfin_tongue.constitutive import ActiveMuscles
from dolfin_tongue.control import Constant, Instant
from dolfin_tongue.control.motion import Swing
from dolfin_tongue.direct import (
    Adaptive,
    DirectSolver,
    Model,
    RungeKutta4,
    TrBdf2,
    multipliers,
    saddle,
)
from dolfin_tongue.direct.multipliers import Acceleration
from dolfin_tongue.direct.stage import Point, Stage
from dolfin_tongue.direct.tr_bdf2 import D
from dolfin_tongue.geometry.simple import block_body, distort
from dolfin_tongue.rigid import AngularSpring, Moment, RigidBody, Spring, plane
from dolfin_tongue.rigid.loads import Loads
from dolfin_tongue.scene.scene import Scene
from dolfin_tongue.surfaces import Sphere


def two_bodies() -> Scene:
    """Jaw and hyoid with one prescribed coordinate, a spring between them, nodes on a ball."""
    body = distort(
        block_body((0.03, 0.02, 0.02), (3, 2, 2), muscles={"pull": (1.0, 0.4, 0.2)}), 0.3
    )
    on_ball, back = body.nodes("y0")[[5, 9]], np.setdiff1d(body.nodes("x1"), body.nodes("y0"))
    ball, points = Sphere((0.015, -0.1, 0.01), 0.1), body.points.copy()
    points[on_ball] = ball.project(points[on_ball])
    node_sets = {**body.node_sets, "on ball": on_ball, "back": back}
    body = replace(body, points=points, node_sets=node_sets)
    between = Spring((-0.01, 0.0, 0.0), (0.04, 0.01, -0.01), 300.0, 0.5, to="hyoid")
    hyoid = RigidBody(
        "hyoid", ("back",), 0.01, 1e-6, (0.035, 0.01, 0.01),
        (AngularSpring(0.1, 1e-3), Moment(0.01)), {"z": Swing(1e-3, 5.0)},
    )  # fmt: skip
    muscle = ActiveMuscles({"pull": Constant(0.5)}, max_stress=5e3)
    supports = (jaw(forces=(between,)), hyoid, Sliding(ball, "on ball"))
    return Scene(body, (*TISSUE, muscle, Gravity((1.0, 0.5, -9.0))), supports)


def random_rows(
    solver: DirectSolver, time: float, turning: float = 1.0
) -> tuple[np.ndarray, np.ndarray]:
    """Random displacement and velocity with all rows; angles of up to 0.2, rates of 5 1/s."""
    random, shape = np.random.default_rng(3), solver.model.numbering.shape
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
    scene, now = two_bodies(), Instant(0.013)
    solver = method.solver(scene)
    model, tau = solver.model, 2e-3
    u, v = random_rows(solver, now.time)
    a, pressure = solver.stepper.acceleration(now, u, v)
    at, count = model.bodies.coordinates, len(scene.body.points)

    change, gradients = model.constraints.evaluate(u)
    second = model.constraints.curvature(u, v) + model.constraints.rate(gradients, a)
    damped = 2 / tau * model.constraints.rate(gradients, v) + change / tau**2
    for part in (slice(0, model.body.cell_count), slice(model.body.cell_count, None)):
        assert np.abs(second + damped)[part].max() <= 1e-10 * np.abs(damped[part]).max()

    # Free nodes.
    force = model.force(now, u, v)
    model.constraints.add_force(gradients, pressure, force)
    rest = force - model.mass @ a[:count]
    assert np.abs(rest[model.numbering.free]).max() <= 1e-9 * np.abs(force).max()

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
    balance = loads.inertia(q, rate, acceleration) - loads.force(now, q, rate) - received
    free = [0, 1, 2, 3, 5]
    scale = np.abs(loads.force(now, q, rate)).max()
    assert np.abs(balance[free]).max() <= 1e-9 * scale
    assert abs(balance[4]) > 1e-3 * scale  # what drives the prescribed coordinate
    assert acceleration[4] == Swing(1e-3, 5.0).at(now.time)[2]

    # The function for comparison with other programs says the same.
    state = model.numbering.state(now, u, v, pressure)
    told = model.force_on_bodies(state, a[:count])
    np.testing.assert_allclose(told.ravel(), received, rtol=1e-9, atol=1e-9 * scale)


def test_accelerations_of_a_prescribed_body_are_exact():
    solver = RungeKutta4(1e-4).solver(scene_of(jaw(motion=OPENING)))
    model, time = solver.model, 0.05
    nodes = model.bodies.attached

    def placed(t: float) -> np.ndarray:
        u = np.zeros(model.numbering.shape)
        model.hold(t, u)
        return u[nodes]

    u, v = np.zeros((2, *model.numbering.shape))
    model.hold(time, u, v)
    h = 1e-3  # central differences of order 4: h^4 / 90 of the sixth derivative
    stencil = [-1, 16, -30, 16, -1]
    second = sum(w * placed(time + i * h) for w, i in zip(stencil, range(-2, 3), strict=True))
    found = model.held_acceleration(time, u, v)[nodes]
    assert relative(found, second / (12 * h * h)) <= 1e-6
    a, _ = solver.stepper.acceleration(Instant(time), u, v)
    np.testing.assert_array_equal(a[nodes], found)


# -- Newton's method on a stage -------------------------------------------------------------------


def linear_solve(solver: DirectSolver, u, v, step: float, time: float):
    """Function from (change of unknown velocities, multipliers) to both after one linear solve."""
    model, stages = solver.model, solver.stepper.stages
    random = np.random.default_rng(5)
    history = v - step * 20.0 * random.uniform(-1, 1, v.shape)
    stage = Stage(Instant(time), step, step, u - step * v, history)

    def solved(change: np.ndarray, multiplier: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        point = Point(stage.read, u, v.copy(), v, multiplier.copy())
        model.numbering.add_unknowns(change, point.v)
        stages.solve(point, stage)
        return model.numbering.unknowns(point.v), point.pressure

    return solved


def left_over(step: float, time: float, turning: float) -> tuple[float, float]:
    """Share of a small change of (velocities, multipliers) that is left by a linear solve.

    It uses the factors that were made without the change: nothing is left if Newton's matrix is the
    derivative of the stage. The change is one by which G V changes through V alone.
    """
    solver = TrBdf2(corrections=1).solver(two_bodies())
    model, random = solver.model, np.random.default_rng(6)
    u, v = random_rows(solver, time, turning)
    multiplier = 2e3 * random.uniform(-1, 1, model.constraints.count)
    dv = 0.1 * random.standard_normal(model.numbering.size)
    dv[-3], dv[-1] = 3.0, -4.0  # the angles: their nodes then move like all others
    by_position = rates_by_position(model, time, u, v)
    dv -= np.linalg.pinv(by_position) @ (by_position @ dv)
    dp = 1e3 * random.standard_normal(model.constraints.count)
    solved, e = linear_solve(solver, u, v, step, time), 1e-4
    solved(0 * dv, multiplier)  # makes the factors
    plus, minus = (solved(s * dv, multiplier + s * dp) for s in (e, -e))
    assert solver.counts()["factorisations"] == 1
    left = [(a - b) / (2 * e) for a, b in zip(plus, minus, strict=True)]
    return tuple(np.abs(a).max() / np.abs(b).max() for a, b in zip(left, (dv, dp), strict=True))


def rates_by_position(model: Model, time: float, u, v) -> np.ndarray:
    """Derivative of G(U) V by the unknown displacements: what Newton's matrix leaves out."""
    columns, e = [], 1e-5
    for unit in np.eye(model.numbering.size):
        rates = []
        for step in (e, -e):
            moved = u.copy()
            model.numbering.add_unknowns(step * unit, moved)
            model.hold(time, moved)
            rates.append(model.constraints.rate(model.constraints.gradients(moved), v))
        columns.append((rates[0] - rates[1]) / (2 * e))
    return np.array(columns).T


@pytest.mark.parametrize(("turning", "bound"), [(0.0, 1e-8), (1.0, 1e-4)], ids=["still", "turning"])
def test_newton_s_matrix_is_the_derivative_of_the_stage(turning, bound):
    """Border, Hessians of g, springs, arms that turn: exact but for stiffness times turning."""
    step, time = 1e-3, 0.013
    velocity, multiplier = left_over(step, time, turning)
    assert velocity <= bound
    assert multiplier <= 10 * bound
    if turning:  # that what is left out is of this size, and the turning of T is not
        again, _ = left_over(step / 4, time, turning)
        assert again <= velocity / 8  # second order: 16


def test_full_newton_converges_fast_with_bodies_and_slides(monkeypatch):
    """Linearly, by the strain and rotation of a step: what Newton's matrix leaves out."""
    dt = 4e-3
    solver = TrBdf2(dt, newton=1e-13, patience=0).solver(two_bodies())
    numbering, sizes = solver.model.numbering, []
    add = numbering.add_unknowns

    def recorded(values, rows):
        sizes.append(D * dt * np.abs(values).max())
        add(values, rows)

    states = solver.march(0.02)
    next(states)  # from here on only updates of stages are added
    monkeypatch.setattr(numbering, "add_unknowns", recorded)
    assert len(list(states)) == 5
    ratios = np.array(sizes[1:]) / sizes[:-1]
    within = np.array(sizes[:-1]) > 1e-13  # not the last one of its stage
    assert within.sum() >= 30
    # The first step, of 4 ms from rest without activation ramp, turns by 0.02.
    assert ratios[within].max() <= 0.1


def test_the_implicit_stage_balances_the_bodies_at_its_tolerance(monkeypatch):
    """Action = reaction: what the bodies lack is what Newton's tolerance leaves."""
    scene = two_bodies()
    solver = TrBdf2(1e-3, newton=1e-12).solver(scene)
    model, stages, points = solver.model, solver.stepper.stages, []
    solve = stages.solve

    def recorded(point, stage):
        solve(point, stage)
        points.append(point)

    monkeypatch.setattr(stages, "solve", recorded)
    assert 2 * (len(list(solver.march(0.02))) - 1) == len(points)
    point = points[-2]  # the inner stage; the end of the step has been projected
    count, at = len(scene.body.points), model.bodies.coordinates
    q, rate = point.u[at].ravel(), point.v[at].ravel()
    load = Loads(scene.rigid_bodies, scene.gravity).force(point.now, q, rate)
    state = model.numbering.state(point.now, point.u, point.v, point.pressure)
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
    usual = final(two_bodies(), TrBdf2(1e-3, newton=1e-12))
    with monkeypatch.context() as patch:
        patch.setattr(saddle, "DENSE_SIZE", 0)
        sparse = final(two_bodies(), TrBdf2(1e-3, newton=1e-12))
    for name in ("displacement", "velocity", "rigid", "rigid_rate", "pressure", "sliding"):
        assert relative(getattr(sparse, name), getattr(usual, name)) <= 1e-7
    tight = final(two_bodies(), Adaptive(1e-10))
    solver = TrBdf2(2e-4, tolerance=1e-6, newton=1e-10).solver(two_bodies())
    states = list(solver.march(END))
    steps = np.array([state.step for state in states[1:]])
    assert steps.max() > 1.5 * steps.min()
    assert np.abs(states[-1].displacement - tight.displacement).max() <= len(steps) * 1e-6
    assert relative(usual.displacement, tight.displacement) <= 1e-3
    assert relative(usual.rigid, tight.rigid) <= 1e-3


# -- edges ---------------------------------------------------------------------------------------


def test_the_printed_metric_refuses_rigid_bodies():
    with pytest.raises(BadScene, match="no inverse mass"):
        RungeKutta4(1e-4, constraint_metric="report").solver(scene_of(jaw()))


def test_a_scene_without_bodies_has_no_rows_of_them():
    model = TrBdf2().solver(scene_of(Attached("x0"))).model
    assert not model.numbering.has_bodies and not model.bodies.rows.size
    assert not model.constraints.slide_scale.size
    assert model.numbering.shape == model.body.points.shape and model.whole_mass is model.mass
    assert Acceleration(model, 1e-3).columns.shape[2] == 0
