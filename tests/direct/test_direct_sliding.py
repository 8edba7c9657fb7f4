"""Nodes that slide on surfaces without friction, in the direct solver."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cases import relative
from scipy.special import ellipk

from dolfin_tongue.base.errors import BadScene
from dolfin_tongue.body.state import State
from dolfin_tongue.boundary import Attached, Gravity, Sliding
from dolfin_tongue.boundary.sliding import moved_onto, off_surface
from dolfin_tongue.constitutive import ActiveMuscles, MooneyRivlin, ReportTissue, Viscosity
from dolfin_tongue.control import Instant, SmoothRamp
from dolfin_tongue.direct import (
    Adaptive,
    DirectSolver,
    Model,
    RungeKutta4,
    TrBdf2,
    drift,
    multipliers,
    saddle,
)
from dolfin_tongue.direct.multipliers import Acceleration
from dolfin_tongue.geometry.simple import block_body, distort
from dolfin_tongue.scene.scene import Scene
from dolfin_tongue.surfaces import Cylinder, Plane, Sphere

START = Instant(0.0)
G = 9.81
RADIUS = 0.05
SIZE = (0.012, 0.01, 0.006)
CENTRE = np.array([SIZE[0] / 2, SIZE[1] / 2, RADIUS])
BOWL = Sphere(tuple(CENTRE), RADIUS, inside=True)


class Ellipsoid(Sphere):
    """g is no distance here: the gradient has a length of its own, which varies."""

    def value(self, points):
        return -100.0 * ((points - np.asarray(self.centre)) ** 2 @ [1.0, 2.0, 1.0] - self.radius**2)

    def gradient(self, points):
        return -200.0 * (points - np.asarray(self.centre)) * [1.0, 2.0, 1.0]

    def hessian(self, points):
        return np.tile(-200.0 * np.diag([1.0, 2.0, 1.0]), (len(points), 1, 1))


def bowl(stiffness: float = 1e6, surface=BOWL) -> Scene:
    """Stiff block in a bowl, its bottom on the surface."""
    body = moved_onto(block_body(SIZE, (2, 2, 1)), surface, "z0")
    return Scene(body, (MooneyRivlin(stiffness, 0.0), Gravity()), (Sliding(surface, "z0"),))


def turned(scene: Scene, angle: float) -> State:
    """Block at rest, turned about the centre of the bowl, by which x grows."""
    c, s = np.cos(angle), np.sin(angle)
    arms = scene.body.points - CENTRE
    moved = arms @ np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]]).T
    zero = np.zeros_like(moved)
    return State(0.0, moved - arms, zero, np.zeros(len(scene.body.cells)))


def sliding_nodes(scene: Scene) -> np.ndarray:
    """Numbers of all sliding nodes, in the order of their constraints."""
    return np.concatenate([part.nodes(scene.body) for part in scene.sliding])


def physical_pendulum(model: Model) -> tuple[float, float, float]:
    """Mass, distance of its centre below that of the bowl, inertia about the latter."""
    arms = model.body.points - CENTRE
    nodal = model.mass @ np.ones(len(arms))
    across = arms[:, [0, 2]]
    inertia = np.sum(across * (model.mass @ across))
    return nodal.sum(), -float(nodal @ arms[:, 2]) / nodal.sum(), inertia


def swing(
    method, angle: float, end: float
) -> tuple[DirectSolver, list[State], np.ndarray, np.ndarray]:
    """Motion with the angle of the block's mass centre and its rate."""
    scene = bowl()
    solver = method.solver(scene)
    mass = np.asarray(solver.model.mass.sum(axis=1)).ravel()
    states = list(solver.march(end, turned(scene, angle)))
    place = np.array([mass @ (scene.body.points + s.displacement - CENTRE) for s in states])
    speed = np.array([mass @ s.velocity for s in states])
    x, z = place[:, 0], -place[:, 2]
    rate = (speed[:, 0] * z + speed[:, 2] * x) / (x**2 + z**2)
    return solver, states, np.arctan2(x, z), rate


def test_a_block_in_a_bowl_swings_as_a_physical_pendulum():
    amplitude, period_of = 0.6, {}
    for dt in (4e-3, 2e-3):
        solver, states, angle, rate = swing(TrBdf2(dt, newton=1e-11), amplitude, 0.36)
        m, d, inertia = physical_pendulum(solver.model)
        exact = 4 * np.sqrt(inertia / (m * G * d)) * ellipk(np.sin(amplitude / 2) ** 2)
        # Two passages of the middle, where the angle is straight in time to third order.
        passing = np.flatnonzero(np.diff(np.sign(angle)))
        near = [i + (abs(angle[i + 1]) < abs(angle[i])) for i in passing]
        times = [states[i].time - angle[i] / rate[i] for i in near]
        assert len(times) == 2
        period_of[dt] = 2 * (times[1] - times[0])
        nodes = sliding_nodes(solver.scene)
        points = solver.scene.body.points[nodes]
        off = [off_surface(BOWL, points + s.displacement[nodes]) for s in states]
        assert np.abs(off).max() <= 1e-10
    # An error of order 2: 0.056 (omega dt)^2, 1.8e-4 and 4.5e-5 here. What the block gives is of
    # the size of its strain, rho g h / E = 1e-5.
    coarse, fine = (abs(period_of[dt] / exact - 1) for dt in (4e-3, 2e-3))
    assert fine <= 6e-5
    assert 3.2 <= coarse / fine <= 4.8
    # A mass point at the mass centre would differ by 0.3 %, which the test sees.
    point = 4 * np.sqrt(d / G) * ellipk(np.sin(amplitude / 2) ** 2)
    assert abs(point / exact - 1) > 20 * fine


def test_energy_in_the_bowl_is_kept_as_the_step_goes_to_zero():
    lost = []
    for dt in (4e-3, 2e-3):
        solver, states, _, _ = swing(TrBdf2(dt, newton=1e-12), 0.6, 0.2)
        lost.append(drift(solver.model, states).energy)
    assert lost[1] <= 1e-3
    assert 3.0 <= lost[0] / lost[1] <= 10.0
    scene = bowl(2e4)
    solver = Adaptive(1e-11, rtol=1e-10).solver(scene)
    assert drift(solver.model, solver.march(0.02, turned(scene, 0.6))).energy <= 1e-7


def ellipsoid() -> Scene:
    """Soft block on a surface whose g is no distance, driven obliquely."""
    surface = Ellipsoid(tuple(CENTRE), RADIUS, inside=True)
    body = moved_onto(block_body(SIZE, (2, 2, 1)), surface, "z0")
    terms = (ReportTissue(), Viscosity(2.0), Gravity((4.0, 3.0, -8.0)))
    return Scene(body, terms, (Sliding(surface, "z0"),))


@pytest.fixture(scope="module")
def tight() -> State:
    """Tight solution of the block on the ellipsoid."""
    *_, state = Adaptive(1e-11, rtol=1e-10).solver(ellipsoid()).march(0.04)
    assert np.abs(state.displacement).max() > 3e-3
    return state


@pytest.mark.parametrize(
    ("method", "off", "error"),
    [(RungeKutta4(1e-4, tau=5e-4), 1e-9, 1e-5), (RungeKutta4(1e-4, mass="lumped"), 1e-9, None),
     (Adaptive(1e-9), 1e-9, 1e-5), (TrBdf2(1e-3, newton=1e-12), 1e-10, 2e-4)],
    ids=["rk4", "lumped", "pair", "implicit"],
)  # fmt: skip
def test_every_method_stays_on_the_surface_and_meets_the_same_place(method, off, error, tight):
    scene = ellipsoid()
    solver, surface, nodes = method.solver(scene), scene.sliding[0].surface, scene.body.nodes("z0")
    for state in solver.march(0.04):
        x = scene.body.points[nodes] + state.displacement[nodes]
        assert np.abs(off_surface(surface, x)).max() <= off
        normal = surface.gradient(x)
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        through = np.abs(np.sum(normal * state.velocity[nodes], axis=1)).max()
        assert through <= 1e-4 * max(np.abs(state.velocity).max(), 1e-3)
    if error is not None:  # another mass is another block
        change = np.abs(state.displacement - tight.displacement).max()
        assert change <= error * np.abs(tight.displacement).max()
        assert relative(state.sliding, tight.sliding) <= 100 * error


def test_implicit_sliding_has_order_2():
    """In displacement, velocity and the multipliers of both kinds."""
    scene = replace(bowl(), terms=(ReportTissue(), Viscosity(5.0), Gravity()))
    start, errors = turned(scene, 0.6), []
    *_, tight = Adaptive(1e-12, rtol=1e-11).solver(scene).march(0.03, start)
    for dt in (5e-4, 2.5e-4):
        *_, state = TrBdf2(dt, newton=1e-12).solver(scene).march(0.03, start)
        names = ("displacement", "velocity", "pressure", "sliding")
        errors.append([relative(getattr(state, n), getattr(tight, n)) for n in names])
    measured = np.log2(np.array(errors[0]) / errors[1])
    assert (np.abs(measured[:3] - 2) < 0.15).all(), measured
    assert measured[3] > 1.8  # 1.90 here, on its way from 1.7 to 2
    assert max(errors[1]) <= 3e-6


def test_the_surface_acts_along_its_normal_and_carries_the_block():
    """The nodal balance without the surface leaves lambda dg/dy at sliding nodes, 0 elsewhere."""
    solver, states, angle, rate = swing(TrBdf2(1e-3, newton=1e-12), 0.6, 0.05)
    model, state = solver.model, states[-1]
    u, v = state.displacement, state.velocity
    now = Instant(state.time)
    a, pressure = Acceleration(model, None)(now, u, v)
    rest = model.mass @ a - model.force(now, u, v)
    of_cells, push = pressure.copy(), np.zeros_like(rest)
    of_cells[model.body.cell_count :] = 0.0
    model.constraints.add_force(model.constraints.gradients(u), of_cells, push)
    rest -= push
    nodes = sliding_nodes(solver.scene)
    others = np.setdiff1d(np.arange(len(u)), nodes)
    scale = np.abs(rest[nodes]).max()
    assert np.abs(rest[others]).max() <= 1e-9 * scale
    normal = BOWL.gradient(model.body.points[nodes] + u[nodes])
    assert np.abs(np.cross(rest[nodes], normal)).max() <= 1e-9 * scale
    told = model.numbering.state(START, u, v, pressure)
    np.testing.assert_allclose(model.numbering.multipliers(told), pressure)
    along = np.sum(rest[nodes] * normal, axis=1)
    np.testing.assert_allclose(along, told.sliding, atol=1e-9 * scale)
    # All in all it carries weight and centripetal force of a physical pendulum; a stiff block that
    # was let go vibrates by about its weight, so that only the mean over the motion is sharp.
    m, d, _ = physical_pendulum(model)
    carried = [
        np.sum(
            s.sliding[:, None] * BOWL.gradient(model.body.points[nodes] + s.displacement[nodes]),
            axis=0,
        )
        for s in states[1:]
    ]
    place = np.array([[-np.sin(x), 0.0, np.cos(x)] for x in angle[1:]])
    along = np.sum(carried * place, axis=1)
    expected = m * G * np.cos(angle[1:]) + m * d * rate[1:] ** 2
    assert abs(along[10:].mean() / expected[10:].mean() - 1) <= 0.02


@pytest.mark.parametrize(
    "method", [RungeKutta4(2e-4), Adaptive(1e-9), TrBdf2(5e-3)], ids=["rk4", "pair", "implicit"]
)
def test_a_block_slides_down_an_inclined_plane_in_free_fall(method):
    tilt = 0.4
    c, s = np.cos(tilt), np.sin(tilt)
    turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    flat = block_body((0.02, 0.01, 0.01), (2, 1, 1), muscles={"pull": (1.0, 0.4, 0.2)})
    body = replace(flat, points=flat.points @ turn.T + [0.1, 0.0, 0.3])
    plane = Plane((0.1, 0.0, 0.3), (s, 0.0, c))
    muscle = ActiveMuscles({"pull": SmoothRamp(0.8, 0.0, 0.05)}, max_stress=5e3)
    terms = (ReportTissue(), Viscosity(5.0), muscle, Gravity())
    solver = method.solver(Scene(body, terms, (Sliding(plane, "z0"),)))
    mass = np.asarray(solver.model.mass.sum(axis=1)).ravel()
    down = np.array([c, 0.0, -s])
    for state in solver.march(0.05):
        # No force acts along the plane, whatever the muscle does: exact for every method, as
        # quadratic motion is.
        way = mass @ state.displacement / mass.sum()
        assert way @ down == pytest.approx(0.5 * G * s * state.time**2, rel=1e-7, abs=1e-13)
        assert abs(way[1]) <= 1e-10
        nodes = body.nodes("z0")
        off = plane.value(body.points[nodes] + state.displacement[nodes])
        assert np.abs(off).max() <= 1e-12
    assert np.ptp(state.displacement, axis=0).max() > 1e-4  # the muscle did something


def slides_of(mass: str = "consistent") -> tuple[Model, np.ndarray, np.ndarray]:
    """Distorted block on two curved surfaces at a random state."""
    body = distort(block_body((0.03, 0.02, 0.02), (3, 2, 2)), 0.3)
    middle = np.setdiff1d(body.nodes("z0"), np.concatenate([body.nodes("x0"), body.nodes("x1")]))
    own = {"under": middle, "end": body.nodes("x1")[3:]}
    body = replace(body, node_sets={**body.node_sets, **own})
    ball = Ellipsoid((0.01, 0.01, 0.08), 0.08)
    pipe = Cylinder((0.09, 0.0, 0.01), (0.0, 1.0, 0.2), 0.06)
    body = moved_onto(moved_onto(body, ball, "under"), pipe, "end")
    parts = (Attached("x0"), Sliding(ball, "under"), Sliding(pipe, "end"))
    model = Model(Scene(body, (ReportTissue(), Viscosity(9.0), Gravity()), parts), mass)
    random = np.random.default_rng(1)
    u, v = 5e-4 * random.uniform(-1, 1, body.points.shape), random.uniform(-1, 1, body.points.shape)
    model.hold(0.0, u, v)
    return model, u, v


def test_derivatives_of_the_sliding_constraints():
    model, u, v = slides_of()
    e, own = 1e-6, slice(model.body.cell_count, None)
    nodes = sliding_nodes(model.scene)
    assert model.constraints.count == model.body.cell_count + len(nodes)
    plus, minus = (model.constraints.evaluate(u + s * e * v)[0] for s in (1, -1))
    _, gradients = model.constraints.evaluate(u)
    rate = model.constraints.rate(gradients, v)
    assert relative(((plus - minus) / (2 * e))[own], rate[own]) <= 1e-8
    rates = [model.constraints.rate(model.constraints.gradients(u + s * e * v), v) for s in (1, -1)]
    second = model.constraints.curvature(u, v)
    assert relative(((rates[0] - rates[1]) / (2 * e))[own], second[own]) <= 1e-7
    # The element matrices hold the same Hessians.
    weight = np.random.default_rng(2).uniform(-1, 1, model.constraints.count)
    matrices = [np.zeros((len(d), d.shape[1], d.shape[1])) for d in model.numbering.part_dofs]
    model.constraints.add_hessians(u, weight, matrices)
    at = v[nodes]
    power = np.einsum("si,sij,sj->s", at, matrices[-1], at)
    np.testing.assert_allclose(power, (weight * second)[own], rtol=1e-12)
    # Scaled, g counts as a volume: of a cell where a node is its size away.
    size = np.mean(model.body.volumes) ** (1 / 3)
    distance = off_surface(Ellipsoid((0.01, 0.01, 0.08), 0.08), model.body.points + u)
    part = model.scene.sliding[0].nodes(model.body)
    volumes = model.constraints.evaluate(u)[0][own][: len(part)]
    np.testing.assert_allclose(volumes / size**2, distance[part], rtol=0.05)


@pytest.mark.parametrize("mass", ["consistent", "lumped"])
def test_accelerations_fulfil_the_differentiated_constraint(mass, monkeypatch):
    model, u, v = slides_of(mass)
    tau = 2e-3
    a, pressure = Acceleration(model, tau)(START, u, v)
    for support in model.scene.sliding:
        surface, part = support.surface, support.nodes(model.body)
        x = model.body.points[part] + u[part]
        normal, g = surface.gradient(x), surface.value(x)
        curved = np.einsum("ki,kij,kj->k", v[part], surface.hessian(x), v[part])
        damped = 2 / tau * np.sum(normal * v[part], axis=1) + g / tau**2
        left = curved + np.sum(normal * a[part], axis=1) + damped
        assert np.abs(left).max() <= 1e-9 * np.abs(damped).max()
    force = model.force(START, u, v)
    model.constraints.add_force(model.constraints.gradients(u), pressure, force)
    left = (model.mass @ a - force)[model.numbering.free]
    assert np.abs(left).max() <= 1e-9 * np.abs(force).max()
    if mass == "consistent":
        monkeypatch.setattr(multipliers, "DENSE_NODES", 0)
        again = Acceleration(model, tau)(START, u, v)
        assert max(relative(again[0], a), relative(again[1], pressure)) <= 1e-8
    assert set(sliding_nodes(model.scene)) <= set(model.numbering.free)


def test_sparse_and_dense_saddle_systems_agree_with_slides(monkeypatch):
    model, u, v = slides_of()
    matrices = model.element_tangents(model.at(START, u, v), 1e-3, 1.0)
    model.constraints.add_hessians(u, np.full(model.constraints.count, 1e2), matrices)
    gradients = model.constraints.gradients(u)
    random = np.random.default_rng(0)
    momentum = random.standard_normal(model.numbering.size)
    volume = 1e-6 * random.standard_normal(model.constraints.count)
    dense = saddle.Saddle(model).factor(matrices, gradients)(momentum, volume)
    monkeypatch.setattr(saddle, "DENSE_SIZE", 0)
    sparse = saddle.Saddle(model).factor(matrices, gradients)(momentum, volume)
    assert max(relative(a, b) for a, b in zip(sparse, dense, strict=True)) <= 1e-8
    rate = np.zeros_like(u)
    model.numbering.add_unknowns(dense[0], rate)
    assert relative(model.constraints.rate(gradients, rate), volume) <= 1e-9


def test_a_march_goes_on_with_its_multipliers():
    scene, method = bowl(2e4), RungeKutta4(1e-4)
    start = turned(scene, 0.3)
    *_, half = method.solver(scene).march(0.01, start)
    first, *_ = method.solver(scene).march(0.02, half)
    np.testing.assert_allclose(first.sliding, half.sliding, rtol=1e-9)
    *_, end = method.solver(scene).march(0.02, half)
    *_, whole = method.solver(scene).march(0.02, start)
    assert relative(end.displacement, whole.displacement) <= 1e-11
    assert np.abs(half.sliding).max() > 0


def test_the_printed_metric_refuses_sliding():
    with pytest.raises(BadScene, match="no inverse mass"):
        RungeKutta4(1e-4, constraint_metric="report").solver(bowl())
