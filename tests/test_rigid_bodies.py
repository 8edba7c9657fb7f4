"""Rigid bodies in the FEniCSx solver (61), (62): momentum, reactions, order, prescribed motion."""

from __future__ import annotations

from dataclasses import replace
from math import radians

import numpy as np
import pytest

from benchmarks.extremes.proofs import hinged_bone
from dolfin_tongue.base.errors import BadScene, OutOfRange, UnknownName
from dolfin_tongue.boundary import Attached, Gravity
from dolfin_tongue.constitutive import MooneyRivlin, Viscosity
from dolfin_tongue.control import (
    Constant,
    Instant,
    Ramp,
    Recorded,
    SmoothMove,
    Step,
    Still,
    Swing,
)
from dolfin_tongue.geometry.simple import block_body
from dolfin_tongue.rigid import (
    AngularSpring,
    LineMuscle,
    Moment,
    PointForce,
    RigidBody,
    Spring,
    StateForce,
    plane,
)
from dolfin_tongue.rigid.loads import Loads
from dolfin_tongue.scene.scene import Scene

BLOCK = block_body((0.03, 0.02, 0.02), (3, 2, 2))
TISSUE = MooneyRivlin()


def carrier(**changes) -> RigidBody:
    """A bone of 50 g at the face x0 of the block."""
    values = {
        "name": "bone", "regions": ("x0",), "mass": 0.05, "inertia": 1e-5,
        "centre": (-0.01, 0.01, 0.015),
    }  # fmt: skip
    return RigidBody(**(values | changes))


# -- kinematics and loads, without a mesh --------------------------------------------------------


def two_bodies() -> Loads:
    """Every force, on two bodies of which one turns about a point that is not its centre."""
    pull = LineMuscle(
        (0.0, 0.0, 0.01), (0.05, 0.0, -0.03), to="b", max_force=3.0, activation=Constant(0.5)
    )
    forces = (
        pull,
        Spring((0.02, 0.0, 0.01), (0.05, 0.01, 0.03), stiffness=100.0, damping=0.3),
        AngularSpring(0.1, 0.01, 0.2),
        PointForce((0.1, 0.0, 0.05), (1.0, 2.0, 3.0)),
        StateForce(lambda t, q, v: np.array([q[0] * v[1], q[2] ** 2, v[2] * q[1]])),
        Moment(0.3),
    )
    first = RigidBody("a", (), 0.1, 1e-4, (0.01, 0.0, 0.02), forces, pivot=(0.0, 0.0, 0.0))
    second = RigidBody("b", (), 0.05, 2e-4, (0.06, 0.0, -0.02))
    return Loads((first, second), np.array([0.0, 0.0, -9.81]))


@pytest.fixture
def moving():
    rng = np.random.default_rng(0)
    q, v, a = rng.standard_normal((3, 6)) * [0.01, 0.01, 0.3, 0.01, 0.01, 0.3]
    return two_bodies(), q, v, a


def slopes(function, x: np.ndarray) -> np.ndarray:
    """Central differences; their error is 1e-12 h^-1 + h^2 of the size of the third derivative."""
    h = 1e-6
    return np.array([(function(x + h * d) - function(x - h * d)) / (2 * h) for d in np.eye(6)]).T


def test_tangents_of_forces_and_inertia_are_their_derivatives(moving):
    loads, q, v, a = moving
    now = Instant(0.1)
    by_q, by_v = loads.force_tangents(now, q, v)
    inertia_q, inertia_v = loads.inertia_tangents(q, v, a)
    for tangent, expected in (
        (by_q, slopes(lambda x: loads.force(now, x, v), q)),
        (by_v, slopes(lambda x: loads.force(now, q, x), v)),
        (inertia_q, slopes(lambda x: loads.inertia(x, v, a), q)),
        (inertia_v, slopes(lambda x: loads.inertia(q, x, a), v)),
        (loads.mass(q), slopes(lambda x: loads.inertia(q, v, x), a)),
    ):
        assert np.abs(tangent - expected).max() < 1e-7 * np.abs(expected).max()


def test_inertia_force_is_lagranges(moving):
    """d/dt(dT/dv) - dT/dq with the kinetic energy T."""
    loads, q, v, a = moving
    momentum = lambda q, v: slopes(lambda x: np.array([loads.kinetic_energy(q, x)]), v)[0]  # noqa: E731
    h = 1e-4
    change = (momentum(q + h * v, v + h * a) - momentum(q - h * v, v - h * a)) / (2 * h)
    by_q = slopes(lambda x: np.array([loads.kinetic_energy(x, v)]), q)[0]
    force = loads.inertia(q, v, a)
    assert np.abs(change - by_q - force).max() < 1e-5 * np.abs(force).max()


def test_a_muscle_between_two_bodies_pulls_both_alike():
    loads = two_bodies()
    only = replace(loads.bodies[0], forces=loads.bodies[0].forces[:1])
    pair = Loads((only, loads.bodies[1]), np.zeros(3))
    q = np.array([0.001, 0.002, 0.1, -0.001, 0.0, 0.2])
    force = pair.force(Instant(0.0), q, np.zeros(6))
    assert np.abs(force[:2] + force[3:5]).max() < 1e-15
    assert np.linalg.norm(force[:2]) > 0.1
    # Moments about the origin of space: those about the reference points, moved there.
    total = force[2] + force[5]
    for body, part in ((only, slice(0, 3)), (loads.bodies[1], slice(3, 6))):
        x, _, z = body.reference + np.array([q[part][0], 0.0, q[part][1]])
        total += z * force[part][0] - x * force[part][1]
    assert abs(total) < 1e-15


def test_given_forces_follow_their_control():
    """Off before the jump, on after it; steps end there."""
    push = PointForce((0.01, 0.0, 0.02), (2.0, 0.0, 1.0), control=Step(1.0, 0.1))
    turn = Moment(0.3, control=Ramp(0.5, 0.2, 0.1))
    bone = RigidBody("a", (), 0.1, 1e-4, (0.0, 0.0, 0.0), (push, turn))
    loads, rest = Loads((bone,), np.zeros(3)), np.zeros(3)
    assert not loads.force(Instant(0.09), rest, rest).any()
    # the moment of (2, 1) N at the arm (0.01, 0.02) m about y: z Fx - x Fz
    assert loads.force(Instant(0.1), rest, rest) == pytest.approx([2.0, 1.0, 0.04 - 0.01])
    assert loads.force(Instant(0.4), rest, rest)[2] == pytest.approx(0.03 + 0.15)
    assert sorted(bone.breakpoints) == pytest.approx([0.1, 0.2, 0.3])
    assert bone.jumps == (0.1,)


def test_negative_angles_open_the_mandible():
    """What lies in front of the pivot (smaller x) goes down."""
    arm = np.array([[-0.05, 0.0, 0.0]])
    moved = plane.displacement(arm, np.array([0.0, 0.0, -0.1]))
    assert moved[0, 2] < 0
    assert np.allclose(moved[0, 2], -0.05 * np.sin(0.1))


@pytest.mark.parametrize(
    "motion", [Still(0.0), SmoothMove(0.02, 0.1, 0.3), Swing(0.01, 3.0),
               Recorded((0.0, 0.1, 0.3, 0.4), (0.0, 0.01, -0.01, 0.0))]
)  # fmt: skip
def test_rates_of_motions_are_their_derivatives(motion):
    for time in (0.15, 0.22, 0.33):
        h = 1e-5
        (before, before_rate, _), (after, after_rate, _) = motion.at(time - h), motion.at(time + h)
        _, rate, acceleration = motion.at(time)
        assert rate == pytest.approx((after - before) / (2 * h), abs=1e-7)
        assert acceleration == pytest.approx((after_rate - before_rate) / (2 * h), abs=1e-5)


# -- with tissue ---------------------------------------------------------------------------------


def test_free_bone_and_block_keep_their_momentum():
    """An internal muscle pulls, the block vibrates, nothing acts from outside."""
    pytest.importorskip("dolfinx")
    from dolfin_tongue.fenicsx import GeneralisedAlpha

    other = RigidBody("other", ("x1",), 0.01, 1e-6, (0.04, 0.01, 0.01))
    pull = LineMuscle(
        (-0.01, 0.01, 0.02), (0.04, 0.01, 0.0), to="other", max_force=1.0, activation=Ramp(1.0)
    )
    scene = Scene(BLOCK, (TISSUE, Viscosity(5.0)), (carrier(forces=(pull,)), other))
    solver = GeneralisedAlpha(2e-3).solver(scene)
    mass = nodal_mass(BLOCK)
    largest = 0.0
    for state in solver.march(0.1):
        bones = [
            bone.mass * plane.jacobian(bone.arms(np.asarray(bone.centre)), own)[0] @ rate
            for bone, own, rate in zip(
                scene.rigid_bodies, state.rigid, state.rigid_rate, strict=True
            )
        ]
        momentum = (mass @ state.velocity).sum(axis=0) + np.sum(bones, axis=0)
        size = np.abs(mass @ state.velocity).sum() + np.abs(state.rigid_rate).sum() * 0.05
        largest = max(largest, size)
        assert np.abs(momentum[[0, 2]]).max() <= 1e-9 * max(largest, 1e-12) + 1e-12
    assert largest > 1e-4
    assert np.abs(state.rigid).max() > 1e-3


def nodal_mass(body):
    """Consistent mass matrix from the other solver, kg."""
    from dolfin_tongue.direct import Model

    return Model(Scene(body, (TISSUE,))).mass


def test_bone_feels_what_it_exerts():
    """Mass times acceleration of a pushed bone is its forces minus what the nodes need."""
    pytest.importorskip("dolfinx")
    from dolfin_tongue.fenicsx import Statics
    from dolfin_tongue.fenicsx.rigid import RigidBodies

    spring = Spring((-0.01, 0.01, 0.015), (-0.05, 0.01, 0.015), stiffness=50.0)
    stop = AngularSpring(1.0)
    scene = Scene(
        BLOCK, (TISSUE, Gravity()),
        (carrier(forces=(spring, stop, PointForce((-0.01, 0.01, 0.015), (0.3, 0, 0)))),
         Attached("x1")),
    )  # fmt: skip
    statics = Statics(scene)
    state = statics.solve()
    system = statics.system
    at = system.at_state(state)
    rows = system.reactions(at)
    (rigid,) = (part for part in system.couplings if isinstance(part, RigidBodies))
    q = state.rigid.ravel()
    tissue = rigid.tissue_force(q, rows)
    applied = rigid.loads.force(at.now, q, np.zeros(3))
    assert np.abs(tissue + applied)[:2].max() <= 1e-9 * np.abs(applied).max()
    # The same from the nodes' forces by hand: sum, and moment about the moved reference point.
    nodes = BLOCK.nodes("x0")
    force = -system.displacement(rows)[nodes]
    arm = (BLOCK.points + state.displacement)[nodes] - scene.rigid_bodies[0].reference
    arm -= [q[0], 0.0, q[1]]
    moment = np.sum(arm[:, 2] * force[:, 0] - arm[:, 0] * force[:, 2])
    assert np.allclose(
        tissue, [force[:, 0].sum(), force[:, 2].sum(), moment], rtol=1e-9, atol=1e-12
    )


def test_pendulum_with_a_soft_block_is_of_order_two():
    pytest.importorskip("dolfinx")
    from dolfin_tongue.fenicsx import GeneralisedAlpha

    def last(dt: float) -> np.ndarray:
        for state in GeneralisedAlpha(dt).solver(hinged_bone()).march(0.08):
            end = state
        return np.append(end.displacement[-1], end.rigid[0, 2] * 0.05)

    steps = (4e-3, 2e-3, 1e-3)
    fine = last(2.5e-4)
    errors = [float(np.linalg.norm(last(dt) - fine)) for dt in steps]
    # Against a reference of a quarter of the smallest step: (1 - 1/16^2) of the true errors at most.
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert (orders > 1.8).all(), (errors, orders)
    assert errors[-1] < 1e-3 * np.linalg.norm(fine)


def test_opening_of_a_jaw_is_followed_exactly_and_its_work_is_known():
    pytest.importorskip("dolfinx")
    from dolfin_tongue.fenicsx import GeneralisedAlpha
    from dolfin_tongue.record.observe import EnergyAudit

    opening = {"x": Still(), "z": Still(), "angle": SmoothMove(radians(-10.0), 0.0, 0.2)}
    scene = Scene(
        BLOCK, (TISSUE, Viscosity(20.0), Gravity()),
        (carrier(motion=opening, pivot=(0.05, 0.01, 0.04)), Attached("x1")),
    )  # fmt: skip
    nodes, bone = BLOCK.nodes("x0"), scene.rigid_bodies[0]
    errors = []
    for dt in (4e-3, 2e-3):
        solver = GeneralisedAlpha(dt).solver(scene)
        audit = EnergyAudit(solver, scene)
        worst = 0.0
        for state in solver.march(0.24):
            angle = bone.prescribed(state.time)[0]
            exact = plane.displacement(bone.arms(BLOCK.points[nodes]), angle)
            assert np.abs(state.displacement[nodes] - exact).max() < 1e-10
            assert np.abs(state.rigid[0] - angle).max() < 1e-10
            record = audit.update(state)
            worst = max(worst, abs(record["balance_J"]))
        errors.append(worst / record["exchanged_J"])
        # The bone of 50 g goes down 1 cm: what opens it holds it back.
        assert -6e-3 < record["work_supports_J"] < -2e-3
    assert state.rigid[0, 2] == pytest.approx(radians(-10.0))
    assert errors[1] < 2e-3
    assert errors[1] < 0.4 * errors[0]  # order 2: a quarter


@pytest.mark.parametrize("mass", [1e-3, 10.0])
def test_light_and_heavy_mandibles_march(mass):
    """The tissue that hangs on it weighs 12 g."""
    pytest.importorskip("dolfinx")
    from dolfin_tongue.fenicsx import GeneralisedAlpha

    spring = Spring((-0.01, 0.01, 0.015), (-0.01, 0.01, 0.1), stiffness=100.0 * mass, damping=mass)
    bone = carrier(mass=mass, inertia=1e-4 * mass, forces=(spring, AngularSpring(0.01)))
    scene = Scene(BLOCK, (TISSUE, Viscosity(20.0), Gravity()), (bone,))
    times = []
    for state in GeneralisedAlpha(5e-3).solver(scene).march(0.2):
        times.append(state.time)
    assert len(times) == 41
    assert np.isfinite(state.displacement).all()
    # A free bone of 10 kg on its spring: z = -(g/w^2)(1 - cos w t) with damping, w^2 = 100 /s2.
    if mass == 10.0:
        free = -9.81 / 100.0 * (1 - np.exp(-0.1) * (np.cos(1.9987) + 0.05 * np.sin(1.9987)))
        assert state.rigid[0, 1] == pytest.approx(free, rel=0.02)


# -- bad input -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "error", "text"),
    [
        ({"mass": -1.0}, OutOfRange, "mass"),
        ({"mass": 0.0}, OutOfRange, "mass"),
        ({"inertia": float("nan")}, OutOfRange, "inertia"),
        ({"centre": (0, 0)}, OutOfRange, "three finite numbers"),
        ({"name": "skull"}, BadScene, "name of its own"),
        ({"regions": "x0"}, BadScene, "tuple of names"),
        ({"motion": {"y": Still()}}, BadScene, "no coordinate 'y'; there are x, z, angle"),
        ({"motion": {"x": 0.01}}, BadScene, "must be a motion"),
        ({"forces": (Still(),)}, BadScene, "forces must be a tuple"),
    ],
)
def test_bad_bodies_are_refused(changes, error, text):
    with pytest.raises(error, match=text):
        carrier(**changes)


@pytest.mark.parametrize(
    ("make", "error", "text"),
    [
        (lambda: Spring((0, 0, 0), (0, 0, 0)), OutOfRange, "apart from the point"),
        (lambda: Spring((0, 0, 0), (0, 0, 1), stiffness=-1.0), OutOfRange, "stiffness"),
        (lambda: LineMuscle((0, 0, 0), (0, 0, 1), activation=0.5), BadScene, "must be a control"),
        (lambda: LineMuscle((0, 0, 0), (0, 0, 1), max_force=0.0), OutOfRange, "max_force"),
        (lambda: StateForce(lambda t, q, v: 1.0), BadScene, "three finite numbers"),
        (lambda: Moment(float("inf")), OutOfRange, "moment"),
        (lambda: SmoothMove(0.1, duration=0.0), OutOfRange, "duration"),
        (lambda: Recorded((0.0, 0.0), (0.0, 1.0)), BadScene, "must increase"),
        (lambda: Recorded((0.0,), (0.0,)), BadScene, "at least two"),
    ],
)
def test_bad_forces_and_motions_are_refused(make, error, text):
    with pytest.raises(error, match=text):
        make()


def test_bad_combinations_are_refused():
    with pytest.raises(BadScene, match=r"belong to both bone and other"):
        Scene(BLOCK, (TISSUE,), (carrier(), carrier(name="other")))
    with pytest.raises(BadScene, match="different names"):
        Scene(BLOCK, (TISSUE,), (carrier(), carrier(regions=("x1",))))
    with pytest.raises(UnknownName, match="known region names"):
        Scene(BLOCK, (TISSUE,), (carrier(regions=("jaw",)),))
    line = Spring((0, 0, 0), (0, 0, 1), stiffness=1.0, to="hyoid")
    with pytest.raises(UnknownName, match="unknown rigid body 'hyoid'"):
        Scene(BLOCK, (TISSUE,), (carrier(forces=(line,)),))
    with pytest.raises(BadScene, match="leads to itself"):
        Scene(BLOCK, (TISSUE,), (carrier(forces=(replace(line, to="bone"),)),))
    with pytest.raises(BadScene, match="must be 0 at t = 0"):
        Scene(BLOCK, (TISSUE,), (carrier(motion={"x": Still(0.01)}),))


# -- runs ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("solver", ["fenicsx", "direct"])
def test_runs_record_bones_and_resume(solver, tmp_path):
    """A run that is taken up again goes on with the coordinates that were there."""
    pytest.importorskip("dolfinx")
    from dolfin_tongue.app.pictures import read_table
    from dolfin_tongue.direct import TrBdf2
    from dolfin_tongue.fenicsx import GeneralisedAlpha
    from dolfin_tongue.record.run import simulate

    steps = GeneralisedAlpha(2e-3) if solver == "fenicsx" else TrBdf2(2e-3)
    scene = hinged_bone()
    whole = simulate(scene, 0.08, tmp_path / "whole", steps)
    simulate(scene, 0.04, tmp_path / "parts", steps)
    parts = simulate(scene, 0.08, tmp_path / "parts", steps, resume=True)
    table = read_table(tmp_path / "parts" / "trajectories.csv")
    assert len(table["bone_angle_rad"]) == 41
    assert np.array_equal(table["bone_angle_rad"][-1:], parts.last.rigid[:, 2])
    assert [len(frame.rigid) for frame in parts.frames] == [1] * 5
    assert parts.frames[-1].rigid == pytest.approx(parts.last.rigid)
    assert parts.frames[-1].rigid_rate == pytest.approx(parts.last.rigid_rate)
    # The seam estimates the acceleration anew: an error of the method's order, not of a jump.
    assert parts.last.rigid[0, 2] == pytest.approx(whole.last.rigid[0, 2], rel=1e-3)
    assert abs(whole.last.rigid[0, 2]) > 0.1
