"""Contact with obstacles: derivatives, balance, and steps that neither pass nor gain energy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cases import apply_matrices, mesh_model, mixed_mesh, random_body, relative

from dolfin_tongue.base.errors import BadScene, NoDirectForce, NotConverged
from dolfin_tongue.body.body import Body
from dolfin_tongue.boundary import Attached, Barrier, Contact, Gravity, ReportContact
from dolfin_tongue.constitutive import MooneyRivlin, ReportTissue, Viscosity
from dolfin_tongue.control import SmoothMove, Still
from dolfin_tongue.direct import Adaptive, Direct, Implicit, RungeKutta4, impacts
from dolfin_tongue.direct.limits import StabilityLimits
from dolfin_tongue.direct.multipliers import Acceleration
from dolfin_tongue.direct.tr_bdf2 import D
from dolfin_tongue.geometry.simple import block_body
from dolfin_tongue.march.state import State
from dolfin_tongue.scene.scene import Scene
from dolfin_tongue.surfaces import Plane, Sphere, Surface
from dolfin_tongue.terms.term import Term

TIME = 0.1
MOVED = (Still(1e-4), SmoothMove(4e-4), Still())
PLANE = Plane((0.0, 0.0, -3e-4), (0.1, -0.05, 1.0))
BALL = Sphere((0.012, 0.004, -0.0505), 0.05)
#: A range of millimetres brings most points of a distorted body near the obstacle.
BARRIER, REPORT = Barrier(range=4e-3), ReportContact(range=4e-3, a2=1.5, a3=2.0)


def name_of_contact(term: Contact) -> str:
    moved = "moved" if term.motion else "still"
    return f"{type(term.law).__name__}-{type(term.obstacle).__name__}-{moved}"


CONTACTS = [
    Contact(obstacle, law=law, motion=motion)
    for law in (BARRIER, REPORT)
    for obstacle in (PLANE, BALL)
    for motion in (None, MOVED)
]


def touching_state(model, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Displacements of up to 0.15 mm and velocities of up to 0.3 m/s."""
    random = np.random.default_rng(seed)
    shape = model.mesh.points.shape
    return 1.5e-4 * random.uniform(-1, 1, shape), 0.3 * random.uniform(-1, 1, shape)


def central(function, step: float) -> np.ndarray:
    """Derivative at 0, of order 4 in the step."""
    near, far = function(step) - function(-step), function(2 * step) - function(-2 * step)
    return (8 * near - far) / (12 * step)


@pytest.mark.parametrize("term", [c for c in CONTACTS if not c.law.rated], ids=name_of_contact)
def test_force_is_minus_the_gradient_of_the_energy(term):
    model = mesh_model(mixed_mesh(0.1), term)
    u, _ = touching_state(model)
    still, force = np.zeros_like(u), model.force(TIME, u, np.zeros_like(u))
    assert np.abs(force).max() > 0
    direction = touching_state(model, 1)[0]
    slope = central(lambda s: model.energy(u + s * direction, still, time=TIME), 1e-3)
    assert abs(slope + np.sum(force * direction)) <= 1e-8 * np.abs(force * direction).sum()


@pytest.mark.parametrize("term", CONTACTS, ids=name_of_contact)
def test_tangents_are_the_derivatives_of_the_force(term):
    model = mesh_model(mixed_mesh(0.1), term)
    u, v = touching_state(model)
    direction = touching_state(model, 1)[0]
    assert model.rated == term.law.rated
    for factor, rate_factor in ((1.0, 0.0), (0.0, 1.0), (0.3, 0.7)):
        matrices = model.element_tangents(TIME, u, v, factor, rate_factor)
        product = apply_matrices(model, matrices, direction)
        expected = -factor * central(lambda s: model.force(TIME, u + s * direction, v), 1e-3)
        expected -= rate_factor * central(lambda s: model.force(TIME, u, v + s * direction), 1.0)
        scale = max(np.abs(expected).max(), np.abs(model.force(TIME, u, v)).max() * 1e-3)
        assert scale > 0
        assert np.abs(product - expected).max() <= 1e-7 * scale
    other: tuple[Term, ...] = ()
    assert not any(part.any() for part in model.element_tangents(TIME, u, v, 1.0, 1.0, other))


#: Points on [-1, 1], the nodes among them, and their weights.
SIMPSON = ((-1.0, 1 / 3), (0.0, 4 / 3), (1.0, 1 / 3))


def stated(term: Contact, body: Body, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Nodal forces as the definition has them, face by face and point by point."""
    out = np.zeros_like(u)
    shift, drift = term.shift(TIME)
    for face in body.surface(term.surface):
        for a, weight_a in SIMPSON:
            for b, weight_b in SIMPSON:
                Y = np.array([(1 - a) * (1 - b), (1 + a) * (1 - b), (1 + a) * (1 + b),
                              (1 - a) * (1 + b)]) / 4  # fmt: skip
                by_a = np.array([b - 1, 1 - b, 1 + b, -1 - b]) / 4 @ body.points[face]
                by_b = np.array([a - 1, -1 - a, 1 + a, 1 - a]) / 4 @ body.points[face]
                area = weight_a * weight_b * np.linalg.norm(np.cross(by_a, by_b))
                gap = term.obstacle.gap((Y @ (body.points + u)[face] - shift)[None])
                rate = gap.normal[0] @ (Y @ v[face] - drift)
                traction, *_ = term.law.traction(gap.distance, np.array([rate]))
                out[face] += area * traction * Y[:, None] * gap.normal
    return out


@pytest.mark.parametrize("surface", ["z0", "boundary"])
@pytest.mark.parametrize("term", CONTACTS, ids=name_of_contact)
def test_the_force_is_as_defined(term, surface):
    body = random_body()
    nearest = term.obstacle.gap(body.points).distance.min() - 1.5e-3
    if isinstance(term.obstacle, Plane):
        point = np.array(PLANE.point) + nearest * PLANE.gradient(body.points)[0]
        moved = replace(PLANE, point=tuple(point))
    else:
        moved = replace(BALL, radius=BALL.radius + nearest)
    term = replace(term, surface=surface, obstacle=moved)
    model = Direct(Scene(body, (term,)), Implicit()).model
    u, v = touching_state(model)
    expected = stated(term, body, u, v)
    assert np.abs(expected).max() > 0
    assert relative(model.force(TIME, u, v), expected) <= 1e-12


# -- motions -------------------------------------------------------------------------------------

#: Edges of the block, m, and the angle between its diagonal and the plane's normal on a corner: 0.
EDGE = 0.02


def block(corner: bool, height: float, cells: tuple[int, int, int] = (2, 2, 2)) -> Body:
    """Block above the plane z = 0, on a face or on a corner."""
    body = block_body((EDGE, EDGE, EDGE), cells)
    points = body.points - EDGE / 2
    if corner:  # the rows are an orthonormal basis whose third vector is the diagonal
        turn = np.array([[1.0, -1.0, 0.0], [1.0, 1.0, -2.0], [1.0, 1.0, 1.0]])
        points = points @ (turn / np.linalg.norm(turn, axis=1)[:, None]).T
    points[:, 2] += height - points[:, 2].min()
    return replace(body, points=np.ascontiguousarray(points))


def falling(solver: Direct, speed: float) -> State:
    state = solver.rest()
    state.velocity[:, 2] = -speed
    return state


class Watched:
    """States of a march with energies, momenta, smallest gaps and resultants."""

    def __init__(self, solver: Direct, end: float, start: State | None = None):
        model, self.solver = solver.model, solver
        self.states = list(solver.march(end, start))
        self.energy = np.array(
            [model.energy(s.displacement, s.velocity, time=s.time) for s in self.states]
        )
        first = self.states[0].velocity
        self.kinetic = 0.5 * float(np.sum(first * (model.mass @ first)))
        self.momentum = np.array([(model.mass @ s.velocity).sum(axis=0) for s in self.states])
        self.times = np.array([s.time for s in self.states])
        touches = [
            [obstacle.touch(s.time, s.displacement, s.velocity) for _, obstacle in model.obstacles]
            for s in self.states
        ]
        self.gap = min(touch.gap for row in touches for touch in row)
        self.resultant = np.array([sum(touch.resultant for touch in row) for row in touches])
        self.touches = touches


@pytest.mark.parametrize("dt", [5e-3, 1e-3])
@pytest.mark.parametrize("corner", [False, True], ids=["flat", "corner"])
@pytest.mark.parametrize("speed", [0.1, 1.0])
def test_a_dropped_block_neither_passes_nor_gains_energy(speed, corner, dt):
    """Momentum changes by what contact and weight gave, to the error Newton's method leaves."""
    terms = (ReportTissue(), Viscosity(1.0), Gravity(), Contact(Plane()))
    solver = Direct(Scene(block(corner, 5e-4), terms), Implicit(dt, newton=1e-9))
    run = Watched(solver, 0.06, falling(solver, speed))
    assert 0 < run.gap < Barrier().range
    assert run.energy.max() - run.energy[0] <= impacts.GAIN * run.kinetic
    weight, mass = solver.model.load.sum(axis=0), solver.model.mass.sum()
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
        solver = Direct(Scene(block(False, 2.2e-3), terms), Implicit(dt, newton=1e-10))
        run = Watched(solver, 0.02, falling(solver, 0.1))
        mean = 0.5 * (run.resultant[1:] + run.resultant[:-1])
        impulse = (np.diff(run.times)[:, None] * mean).sum(axis=0)
        change = run.momentum[-1] - run.momentum[0]
        error.append(np.abs(impulse - change).max() / np.abs(change).max())
        assert solver.stepper.euler_steps == 0
    assert error[0] <= 1e-2
    assert error[1] <= error[0] / 3


def test_energy_that_tr_bdf2_makes_is_refused(monkeypatch):
    """A stiff block on a soft barrier would rebound with 1.04 of its energy."""
    law = Barrier(range=2e-3, pressure=300.0)
    terms = (ReportTissue(), MooneyRivlin(1e5, 0.0), Contact(Plane(), law=law))

    def rise() -> float:
        solver = Direct(Scene(block(False, 4.25e-3), terms), Implicit(5e-3))
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
    *_, exact = Direct(scene, Adaptive(1e-10, rtol=1e-8)).march(0.04)
    error = []
    for dt in (2.5e-3, 1.25e-3, 6.25e-4):
        solver = Direct(scene, Implicit(dt, newton=1e-10))
        *_, last = solver.march(0.04)
        error.append(np.abs(last.displacement - exact.displacement).max())
    assert np.log2(error[0] / error[-1]) / 2 >= 1.7


def test_a_block_rests_with_its_weight_on_the_plane():
    """Newton's tolerance times the stiffness of the contact is what the resultant may miss."""
    tolerance = 1e-10
    terms = (ReportTissue(), Viscosity(50.0), Gravity(), Contact(Plane(), "z0"))
    solver = Direct(Scene(block(False, 2e-4), terms), Implicit(5e-3, newton=tolerance))
    run = Watched(solver, 0.5)
    weight = solver.model.load.sum(axis=0)
    [touch] = run.touches[-1]
    _, slope, _ = Barrier().traction(np.array([touch.gap]))
    stiffness = -slope[0] * EDGE**2
    left = np.abs(np.diff(run.momentum, axis=0)[-1]).max() / 5e-3
    assert left <= 1e-4 * np.abs(weight).max()
    assert np.abs(touch.resultant + weight).max() <= left + 10 * tolerance * stiffness
    assert touch.gap > 0
    assert touch.area == pytest.approx(EDGE**2, rel=1e-12)
    assert touch.traction >= -weight[2] / EDGE**2
    assert run.energy.max() <= run.energy[0] + 1e-12


@pytest.mark.parametrize("speed", [3.0, 20.0])
def test_a_step_through_the_whole_barrier_ends_before_the_plane(speed):
    """In one step the stiff block would be 15 mm or 100 mm behind the plane, not 0.2 mm before."""
    terms = (ReportTissue(), MooneyRivlin(1e5, 0.0), Contact(Plane()))
    solver = Direct(Scene(block(False, 1e-3, (1, 1, 1)), terms), Implicit(5e-3))
    run = Watched(solver, 0.02, falling(solver, speed))
    assert run.gap > 0
    # TR-BDF2 takes the step: contact makes what GAIN allows, and the elastic forces, which turn
    # within the step, do work of their own (0.6 % here; none with two cells per edge).
    assert run.energy.max() <= run.energy[0] * (1 + 2 * impacts.GAIN)


def test_the_reports_law_dissipates_and_lets_a_steady_push_creep_through():
    law = ReportContact(a1=1e6)
    terms = (ReportTissue(), Viscosity(5.0), Gravity(), Contact(Plane(), "z0", law))
    solver = Direct(Scene(block(False, 5e-4), terms), Implicit(2e-3))
    run = Watched(solver, 0.1, falling(solver, 0.2))
    assert np.diff(run.energy).max() <= 1e-6 * run.kinetic
    gaps = np.array([touch.gap for [touch] in run.touches])
    assert gaps[-1] < 0  # behind the plane
    assert np.diff(gaps)[-10:].max() < 0  # and on its way
    # Creep: in the end the traction 2 a1 (range - gap) |rate| carries the weight.
    depth, rate = law.range - gaps[-1], -np.diff(gaps)[-1] / 2e-3
    weight = -solver.model.load.sum(axis=0)[2]
    assert 2 * law.a1 * depth * rate * EDGE**2 == pytest.approx(weight, rel=0.05)


def test_a_barrier_beside_it_stops_the_creep():
    contacts = (Contact(Plane(), law=ReportContact(a1=1e6)), Contact(Plane()))
    terms = (ReportTissue(), Viscosity(5.0), Gravity(), *contacts)
    solver = Direct(Scene(block(False, 5e-4), terms), Implicit(5e-3))
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
    solver = Direct(scene, Implicit(1e-3, corrections=corrections))
    run = Watched(solver, 0.04)
    assert 0 < run.gap < 2e-4
    assert run.resultant[-1, 2] < 0
    places = np.array([push.shift(t)[0] for t in run.times])
    mean = 0.5 * (run.resultant[1:] + run.resultant[:-1])
    work = float(np.sum(mean * np.diff(places, axis=0)))
    assert 0 < run.energy[-1] <= 1.02 * work


# -- explicit methods ----------------------------------------------------------------------------


def dropped(method) -> Direct:
    terms = (ReportTissue(), Viscosity(2.0), Contact(Plane()))
    return Direct(Scene(block(True, 5e-4), terms), method)


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
    [(_, obstacle)] = solver.model.obstacles
    monkeypatch.setattr(obstacle, "add_force", lambda *arguments: None)
    with pytest.raises(NotConverged, match="behind the obstacle") as caught:
        list(solver.march(0.01, falling(solver, 1.0)))
    assert caught.value.time < 0.01


def test_the_limit_names_the_contact():
    terms = (ReportTissue(), Contact(Plane(), "z0"))
    model = Direct(Scene(block(False, 5e-5), terms), Implicit()).model
    zero = np.zeros_like(model.load)
    limit = StabilityLimits(Acceleration(model, 1e-2))(0.0, zero, zero, np.zeros(model.cell_count))
    assert "the contact stiffness of 'z0' on Plane" in limit.cause
    far = Direct(Scene(block(False, 5e-3), terms), Implicit()).model
    free = StabilityLimits(Acceleration(far, 1e-2))(0.0, zero, zero, np.zeros(far.cell_count))
    assert limit.step < free.step


# -- edges ---------------------------------------------------------------------------------------


def test_a_start_behind_the_obstacle_is_refused():
    terms = (ReportTissue(), Contact(Plane()))
    for method in (Implicit(), RungeKutta4(1e-4), Adaptive()):
        solver = Direct(Scene(block(False, 1e-3), terms), method)
        state = solver.rest()
        state.displacement[:, 2] = -2e-3
        with pytest.raises(BadScene, match=r"0\.001 m behind the obstacle"):
            next(solver.march(0.1, state))


def test_a_subclass_of_contact_is_refused_by_name():
    class Sticky(Contact):
        pass

    with pytest.raises(NoDirectForce, match="Sticky"):
        Direct(Scene(block(False, 1e-3), (ReportTissue(), Sticky(Plane()))), Implicit())


class Counted(Surface):
    """The plane z = 0, which counts how often it is asked for gaps; inf beyond x = 0 if `rim`."""

    def __init__(self, rim: bool = False):
        self.rim, self.count, self.plane = rim, 0, Plane()

    def value(self, points):
        return self.plane.value(points)

    def gradient(self, points):
        return self.plane.gradient(points)

    def hessian(self, points):
        return self.plane.hessian(points)

    def gap(self, points):
        self.count += 1
        gap = self.plane.gap(points)
        if self.rim:
            out = points[:, 0] > 0
            gap.distance[out], gap.normal[out] = np.inf, 0.0
        return gap


@pytest.mark.parametrize("rim", [False, True])
def test_a_far_obstacle_is_not_asked_until_points_may_be_near(rim):
    obstacle = Counted(rim)
    solver = Direct(Scene(block(False, 5e-3), (ReportTissue(), Contact(obstacle))), Implicit())
    model, zero = solver.model, np.zeros_like(solver.model.load)
    down, count = np.broadcast_to([0.0, 0.0, -1.0], zero.shape), obstacle.count
    model.force(0.0, zero, zero)
    for fraction in (0.2, 0.5, 0.95):
        assert np.abs(model.force(0.0, fraction * 4.8e-3 * down, zero)).max() <= 1e-15
        # Where some points have no distance, nothing bounds the others.
        assert obstacle.count == count + 1 if not rim else obstacle.count > count + 1
    assert model.force(0.0, 4.9e-3 * down, zero).sum() > 0.1
    assert obstacle.count > count + 1
