"""Contact with rigid obstacles: laws, tangents, balance of forces, impacts."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dolfin_tongue.base.errors import BadScene, OutOfRange, UnknownName
from dolfin_tongue.boundary import Attached, Barrier, Contact, Gravity, ReportContact
from dolfin_tongue.constitutive import ReportTissue, Viscosity
from dolfin_tongue.control import SmoothMove, Still
from dolfin_tongue.fenicsx.generalised_alpha import Dynamics, TimeSteps
from dolfin_tongue.fenicsx.mesh import PAIRS
from dolfin_tongue.fenicsx.newton import Tolerances
from dolfin_tongue.fenicsx.statics import Statics
from dolfin_tongue.fenicsx.system import System
from dolfin_tongue.geometry.simple import block_body, distort
from dolfin_tongue.record.observe import EnergyAudit, contact_pressures
from dolfin_tongue.scene.scene import Scene
from dolfin_tongue.surfaces import Cylinder, Plane, Sphere

RANGE, STEEP = 2e-4, 50.0


# -- laws -----------------------------------------------------------------------------------------


def test_barrier_derives_from_its_energy():
    """Central differences: smooth inside, tangent continued below range/steep, zero beyond."""
    law = Barrier(RANGE, 1e3, STEEP)
    kink = RANGE / STEEP
    gap = np.concatenate([np.linspace(-10, 0.99, 40) * kink, np.geomspace(1.01 * kink, 2e-4, 60)])
    step = 1e-5 * kink  # (step / gap)^2 = 1e-10, round-off 1e-16 / 1e-5
    traction, slope, by_rate = law.traction(gap)
    by_energy = -(law.energy(gap + step) - law.energy(gap - step)) / (2 * step)
    by_traction = (law.traction(gap + step)[0] - law.traction(gap - step)[0]) / (2 * step)
    assert by_energy == pytest.approx(traction, rel=1e-8, abs=1e-9 * traction.max())
    assert by_traction == pytest.approx(slope, rel=1e-8, abs=1e-9 * np.abs(slope).max())
    assert by_rate == 0.0
    assert (traction[:-1] > 0).all() and (np.diff(traction) < 0).all()  # convex energy
    far = np.array([RANGE, 1.0, np.inf])
    assert not law.traction(far)[0].any() and not law.traction(far)[1].any()
    assert np.abs(law.energy(far)).max() <= 1e-15 * 1e3 * RANGE


def test_barrier_by_hand():
    law = Barrier(RANGE, 1e3, STEEP)
    gap = np.array([RANGE / 2, RANGE / 3, RANGE / STEEP, 0.0])
    steepest = 2 * 1e3 * 49 * 50**2 / RANGE
    expected = [1e3, 4e3, 1e3 * 49**2, 1e3 * 49**2 + steepest * RANGE / 50]
    assert law.traction(gap)[0] == pytest.approx(expected, rel=1e-12)
    assert law.energy(gap[:1])[0] == pytest.approx(1e3 * RANGE * (1.5 - 2 * np.log(2)), rel=1e-12)


def test_report_law_by_hand_and_slopes():
    """(60): t = 2 a1 |h - h_eps|^a2 |h'|^a3 while the gap is in range and closes."""
    law = ReportContact(1e8, 1.0, 1.0, 1e-3)
    gap = np.array([4e-4, -2e-4, 4e-4, 1.1e-3])
    rate = np.array([-0.05, -0.05, 0.05, -0.05])
    assert law.traction(gap, rate)[0] == pytest.approx([6e3, 1.2e4, 0.0, 0.0], rel=1e-12)
    law = ReportContact(2e9, 1.5, 1.25, 1e-3)
    expected = 4e9 * 6e-4**1.5 * 0.05**1.25
    assert law.traction(gap[:1], rate[:1])[0] == pytest.approx([expected], rel=1e-12)
    _, by_gap, by_rate = law.traction(gap, rate)
    for slope, dg, dr in ((by_gap, 1e-8, 0.0), (by_rate, 0.0, 1e-6)):
        ahead, behind = law.traction(gap + dg, rate + dr)[0], law.traction(gap - dg, rate - dr)[0]
        assert (ahead - behind) / (2 * (dg + dr)) == pytest.approx(slope, rel=1e-8)
    assert not law.energy(gap).any()


@pytest.mark.parametrize("law", [Barrier, ReportContact])
@pytest.mark.parametrize("bad", [0.0, -1e-4, np.nan, np.inf])
def test_numbers_of_laws_without_physical_sense(law, bad):
    for name in ("range", "pressure" if law is Barrier else "a1"):
        with pytest.raises(OutOfRange, match=f"{law.__name__}.{name}"):
            law(**{name: bad})


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Barrier(steep=2.0), "Barrier.steep"),
        (lambda: Barrier(steep=np.nan), "Barrier.steep"),
        (lambda: ReportContact(a2=0.5), "ReportContact.a2"),
        (lambda: ReportContact(a3=np.nan), "ReportContact.a3"),
    ],
)
def test_exponents_of_laws(make, message):
    with pytest.raises(OutOfRange, match=message):
        make()


BODY = replace(block_body((0.02, 0.02, 0.01), (2, 2, 1)), name="block")
BELOW = Plane((0.0, 0.0, -1e-3))


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: Contact("palate"), BadScene, "takes a surface first"),
        (lambda: Contact(BELOW, law=1e3), BadScene, "law must be a law"),
        (lambda: Contact(BELOW, motion=(Still(), Still())), BadScene, "three motions"),
        (lambda: Contact(BELOW, motion=(0.0, 0.0, 1e-3)), BadScene, "three motions"),
        (lambda: Contact(BELOW, motion=SmoothMove(1e-3)), BadScene, "three motions"),
        (lambda: Contact(BELOW, surface="sole"), UnknownName, "unknown surface 'sole'.*boundary"),
        (
            lambda: Contact(Plane((0, 0, 1e-3))),
            BadScene,
            "25 of 66 points.*behind.*deepest by 0.001",
        ),
        (lambda: Contact(Plane()), BadScene, "behind the obstacle"),  # touches: no gap
        (
            lambda: Contact(BELOW, motion=(Still(), Still(), Still(2e-3))),
            BadScene,
            "behind the obstacle",
        ),
        (lambda: Contact(Plane((0, 0, -1e-3), (0, 0, -1))), BadScene, "turn the obstacle round"),
    ],
)
def test_bad_contacts(make, error, message):
    with pytest.raises(error, match=message):
        Scene(BODY, (ReportTissue(), make()))


# -- points of the surface ------------------------------------------------------------------------


@pytest.mark.parametrize("pair", PAIRS)
def test_rule_on_the_surface(pair):
    """Areas, moments of degree 1, points at all nodes, and displacements of degree 1 are exact."""
    body = block_body((0.03, 0.02, 0.01), (3, 2, 1))
    terms = (ReportTissue(), Gravity(), Contact(BELOW, "z0"), Contact(BELOW))
    system = System(Scene(body, terms), True, pair)
    bottom, whole = system.couplings
    assert bottom.weights.sum() == pytest.approx(6e-4, rel=1e-12)
    assert bottom.weights @ bottom.points == pytest.approx([9e-6, 6e-6, 0.0], abs=1e-18)
    assert whole.weights.sum() == pytest.approx(2.2e-3, rel=1e-12)
    assert (whole.weights > 0).all()
    places = {tuple(np.round(x, 9)) for x in whole.points}
    assert len(places) == len(whole.points)
    assert {tuple(np.round(x, 9)) for x in body.points} <= places
    G = np.array([[0.1, 0.2, 0.0], [0.0, -0.1, 0.3], [0.05, 0.0, 0.1]])
    y = np.zeros(system.size)
    y[system.space.all_displacement_dofs] = dof_places(system) @ G.T
    assert whole._moves @ y[: system.space.size] == pytest.approx(
        (whole.points @ G.T).ravel(), abs=1e-15
    )


def dof_places(system):
    """Reference positions of all points of the displacement."""
    return system.space.space.sub(0).collapse()[0].tabulate_dof_coordinates()


# -- residual, energy, Jacobian -------------------------------------------------------------------

#: Wide laws, so that many points touch, at different gaps.
WIDE = Barrier(3e-3, 1e3, 20.0)
MOVING = (Still(), SmoothMove(1e-3, 0.0, 0.1), SmoothMove(-1e-3, 0.0, 0.1))
RISING = (Still(), Still(), SmoothMove(4e-3, 0.0, 0.1))  # at 0.07 m/s: most points close
OBSTACLES = {
    "plane": Contact(Plane((0, 0, -1e-3), (0.1, -0.2, 1.0)), "boundary", WIDE),
    "bowl": Contact(Sphere((0.01, 0.01, 0.004), 0.017, inside=True), "boundary", WIDE),
    "rod": Contact(Cylinder((0.01, 0.0, -0.0055), (0.1, 1, 0), 0.005), "z0", WIDE),
    "moving": Contact(Sphere((0.01, 0.01, -0.0105), 0.01), "z0", WIDE, MOVING),
    "report": Contact(
        Sphere((0.01, 0.01, -0.0105), 0.01), "z0", ReportContact(1e7, 1.5, 1.5, 3e-3), RISING
    ),
}


def bent_system(contact, pair):
    """A distorted block near the obstacle, moved at random, with its arguments."""
    body = distort(block_body((0.02, 0.02, 0.008), (2, 2, 2)), 0.2, 1)
    plane = isinstance(contact.obstacle, Plane)
    if plane:
        body = replace(body, points=body.points + np.array([0.0, 0.0, 4e-3]))
    system = System(Scene(body, (ReportTissue(), Gravity(), contact)), True, pair)
    random = np.random.default_rng(3)
    state, rate, acceleration, end = random.uniform(-1, 1, (4, system.size))
    u = system.space.all_displacement_dofs
    for y, size in ((state, 2e-4), (rate, 2e-2), (acceleration, 1.0), (end, 2e-4)):
        y[system.space.pressure_dofs] *= 100.0
        y[u] *= size
    if plane:
        state[u[:, 2]] -= 3e-3
        end[u[:, 2]] -= 3e-3
    return system, [state, rate, acceleration, end]


TIMES = (0.045, 0.05)


def residual(system, parts):
    out = np.zeros(system.size)
    system.set_state(TIMES[0], *parts)
    system.residual(TIMES[1], out)
    return out


@pytest.mark.parametrize("pair", PAIRS)
@pytest.mark.parametrize("name", OBSTACLES)
def test_jacobian_is_the_derivative_of_the_residual(name, pair):
    system, parts = bent_system(OBSTACLES[name], pair)
    shifts = (70.0, 4e3, 1.8)
    residual(system, parts)
    touching = system.couplings[0].traction(system.arguments(TIMES[1]))[2]
    assert (touching > 0).sum() >= 5
    matrix = system.new_matrix()
    system.jacobian(matrix, shifts, TIMES[1])
    indptr, indices, values = matrix.getValuesCSR()
    way = np.random.default_rng(5).uniform(-1, 1, system.size)
    way[system.space.pressure_dofs] *= 1e6
    product = np.bincount(
        np.repeat(np.arange(system.size), np.diff(indptr)), values * way[indices], system.size
    )
    step = 1e-9  # m, of gaps of about 1e-3: (step/gap)^2 = 1e-12; round-off 1e-16 gap/step = 1e-10
    moved = [
        residual(
            system, [y + sign * step * s * way for y, s in zip(parts, (1.0, *shifts), strict=True)]
        )
        for sign in (1, -1)
    ]
    difference = (moved[0] - moved[1]) / (2 * step)
    for dofs in (system.space.all_displacement_dofs, system.space.pressure_dofs):
        scale = np.abs(product[dofs]).max()
        assert np.abs(difference - product)[dofs].max() <= 1e-7 * scale


@pytest.mark.parametrize("pair", PAIRS)
@pytest.mark.parametrize("name", ["plane", "bowl", "rod", "moving"])
def test_residual_is_the_derivative_of_the_energy(name, pair):
    """At the end of the step; contact alone, so that no other energy covers it."""
    system, (_, _, _, y) = bent_system(OBSTACLES[name], pair)
    contact = system.couplings[0]
    way = np.random.default_rng(5).uniform(-1, 1, system.size)

    def arguments(y):
        system.set_state(TIMES[1], y, 0 * y, 0 * y, y)
        return system.arguments(TIMES[1])

    out = np.zeros(system.size)
    contact.add_residual(arguments(y), out)
    step = 1e-7  # (step/gap)^2 = 1e-8 times third derivatives; round-off 1e-16 gap/step = 1e-12
    ahead, behind = (contact.energies(arguments(y + s * step * way)) for s in (1, -1))
    (label,) = ahead
    power = (ahead[label] - behind[label]) / (2 * step)
    scale = np.abs(out * way).sum()
    assert scale > 0 and abs(power - out @ way) <= 1e-6 * scale
    assert not out[system.space.pressure_dofs].any()
    force = contact.observed(arguments(y))
    total = out[system.space.all_displacement_dofs].sum(axis=0)
    named = [force[f"contact_force_{axis}_N"] for axis in "xyz"]
    assert named == pytest.approx(-total, rel=1e-12, abs=1e-12 * np.abs(total).max())


def test_nothing_is_missed_by_what_is_spared():
    """Evaluations that rely on an earlier gap equal those of a system that never saw one."""
    contact = Contact(Sphere((0.01, 0.01, 0.002), 0.03, inside=True), "boundary", Barrier(1e-3))
    system = System(Scene(BODY, (ReportTissue(), contact)), True)
    part, random = system.couplings[0], np.random.default_rng(2)
    spared = touched = 0
    for _ in range(150):
        y = system.mixed(random.uniform(-1, 1) * random.uniform(-0.016, 0.016, (18, 3)))
        system.set_state(0.0, y, 0 * y, 0 * y, y)
        quick, whole = np.zeros((2, system.size))
        before = part._watched
        part.add_residual(system.arguments(0.0), quick)
        spared += part._watched is before and len(before.points) < len(part.points)
        part._watched = None
        part.add_residual(system.arguments(0.0), whole)
        assert (quick == whole).all()
        touched += whole.any()
        gap = part.gap(0.0, y)
        force = (part.weights * contact.law.traction(gap.distance)[0])[:, None] * gap.normal
        assert whole == pytest.approx(-part._moves.T @ force.ravel(), rel=1e-12, abs=1e-15)
    assert spared >= 5 and touched >= 5


# -- rest -----------------------------------------------------------------------------------------


def observed(solver, state):
    """What the first contact of a static problem shows, and the force of the supports, N."""
    system = solver.system
    y, _ = system.vectors(state)
    system.set_state(solver.time, y)
    shown = system.couplings[0].observed(system.arguments(solver.time))
    return shown, system.reactions(solver.time)[system._held_dofs].sum(axis=0)


def pressed_block():
    """A block that is held at its top and pressed from below by a plane."""
    body = block_body((0.02, 0.02, 0.01), (4, 4, 2))
    rising = (Still(), Still(), SmoothMove(1.2e-3))
    contact = Contact(Plane((0, 0, -5e-4)), "z0", motion=rising)
    return Scene(body, (ReportTissue(), Gravity(), contact), (Attached("z1"),))


@pytest.mark.parametrize("pair", PAIRS)
def test_block_pressed_by_a_rising_plane(pair):
    """Held at its top, pressed from below: contact, supports and weight are in balance."""
    scene = pressed_block()
    body = scene.body
    solver = Statics(scene, Tolerances(1e-11, iterations=25, renew_above=0.0), pair=pair)
    state = solver.solve()
    shown, held = observed(solver, state)
    weight = 9.81 * body.mass
    total = held + [shown[f"contact_force_{axis}_N"] for axis in "xyz"] - [0, 0, weight]
    assert shown["contact_force_z_N"] > 3 * weight
    # an error of 1e-11 m in a barrier of slope < 2e7 Pa/m on 4e-4 m2 is 1e-7 N
    assert np.abs(total).max() <= 1e-7
    assert shown["contact_area_m2"] == pytest.approx(4e-4, rel=1e-12)
    assert 0 < shown["contact_gap_m"] < RANGE
    z = (body.points + state.displacement)[:, 2] - 7e-4
    assert z.min() == pytest.approx(shown["contact_gap_m"], rel=1e-6)
    system = solver.system
    y, _ = system.vectors(state)
    system.set_state(solver.time, y)
    pressures = system.couplings[0].pressure_map(system.arguments(solver.time))
    assert (pressures[body.nodes("z0")] > 0).all()
    assert (pressures > 0).sum() == 25


def test_block_comes_to_rest_on_a_plane():
    """The resultant is the weight, and the map of pressures integrates to it."""
    body = block_body((0.02, 0.02, 0.01), (4, 4, 2))
    body = replace(body, points=body.points + np.array([0, 0, 1.5e-4]))
    scene = Scene(body, (ReportTissue(), Viscosity(20.0), Gravity(), Contact(Plane(), "z0")))
    dynamics = Dynamics(scene, TimeSteps(5e-3, spectral_radius=0.0))
    *_, state = dynamics.march(1.0)
    weight = 9.81 * body.mass
    shown = EnergyAudit(dynamics.system).observed(state)
    assert np.abs(state.velocity).max() <= 1e-9
    # at 2e6 N/m2 per m of gap (t = 100 Pa at 1.5e-4 m) on 4e-4 m2, 1e-8 m are 8e-6 N
    assert shown["contact_force_z_N"] == pytest.approx(weight, abs=1e-5)
    assert abs(shown["contact_force_x_N"]) + abs(shown["contact_force_y_N"]) <= 1e-12
    assert 0 < shown["contact_gap_m"] < RANGE
    pressure = contact_pressures(dynamics.system, state)["contact"]
    share = np.ones((5, 5))
    share[[0, -1]] /= 2
    share[:, [0, -1]] /= 2
    bottom = pressure[body.nodes("z0")]
    assert bottom @ share.ravel() * 25e-6 == pytest.approx(shown["contact_force_z_N"], rel=1e-9)
    assert (bottom > 0).all() and pressure.sum() == bottom.sum()
    assert bottom.max() <= shown["contact_pressure_Pa"]


@pytest.mark.parametrize("pair", PAIRS)
def test_pressure_map(pair):
    """Under a parallel plane the law's own value; under a tilted one its integral is kept."""
    body = block_body((0.02, 0.02, 0.01), (4, 2, 1))
    law, bottom = Barrier(2e-3, 1e3), body.nodes("z0")
    contacts = [Contact(Plane((0, 0, -5e-4), (x, 0, 1)), "z0", law) for x in (0.0, 0.02)]
    system = System(Scene(body, (ReportTissue(), Gravity(), *contacts)), True, pair)
    state = system.state_of(0.0, *np.zeros((2, system.size)))
    even, tilted = contact_pressures(system, state).values()
    assert even[bottom] == pytest.approx(9e3, rel=1e-12)  # 1e3 (2e-3 / 5e-4 - 1)^2
    assert not np.delete(even, bottom).any() and not np.delete(tilted, bottom).any()
    rows = tilted[bottom].reshape(3, 5)
    assert (np.diff(rows, axis=1) < 0).all()  # the gap grows with x
    shares = (system.couplings[1].weights @ system.couplings[1]._hats)[bottom].reshape(3, 5)
    assert shares.sum() == pytest.approx(4e-4, rel=1e-12)
    shown = system.couplings[1].observed(system.arguments(0.0))
    total = np.hypot(shown["contact_2_force_x_N"], shown["contact_2_force_z_N"])
    assert (rows * shares).sum() == pytest.approx(total, rel=1e-12)


# -- impacts --------------------------------------------------------------------------------------

DEFAULT = Barrier()
TURNS = {"flat": (0.0, 0.0), "edge": (0.0, 30.0), "corner": (30.0, 39.0)}


def dropped(turn, law=DEFAULT):
    """A block 1 mm above a plane."""
    body = block_body((0.02, 0.02, 0.01), (4, 4, 2))
    matrix = Rotation.from_euler("xy", TURNS[turn], degrees=True).as_matrix()
    points = body.points @ matrix.T
    points[:, 2] += 1e-3 - points[:, 2].min()
    terms = (ReportTissue(), Viscosity(20.0), Gravity(), Contact(Plane(), law=law))
    return Scene(replace(body, points=points), terms)


@pytest.mark.parametrize(
    ("turn", "speed", "dt", "rise"),
    [
        ("flat", 0.1, 5e-3, 1e-12),
        ("flat", 0.3, 5e-3, 1e-5),
        ("flat", 1.0, 1e-3, 1e-12),
        ("edge", 0.3, 5e-3, 1e-12),
        ("edge", 1.0, 2e-3, 1e-12),
        ("corner", 0.1, 2e-3, 1e-12),
        ("corner", 1.0, 1e-3, 1e-12),
    ],
)
def test_impact(turn, speed, dt, rise):
    """Nothing passes, no energy appears, momentum changes by the impulses of the steps.

    Generalised-alpha turns (R + weight)/m = f of the end of a step into a velocity by
    (1 - am) b0 + am b1 = f, v1 = v0 + dt ((1 - g) b0 + g b1), starting from b = -9.81 m/s2.
    """
    scene = dropped(turn)
    body, mass = scene.body, scene.body.mass
    steps = TimeSteps(dt, newton=Tolerances(displacement=1e-11))
    dynamics = Dynamics(scene, steps)
    audit = EnergyAudit(dynamics.system)
    rho = steps.spectral_radius
    am, g = (2 - rho) / (1 + rho), 0.5 + (1 - rho) / (1 + rho)
    lumped = np.bincount(body.cells.ravel(), np.repeat(body.volumes / 8, 8)) * body.density
    start = replace(dynamics.rest(), velocity=np.tile([0.0, 0.0, -speed], (len(body.points), 1)))
    energies, impulse, touched = [], np.zeros(3), 0
    b, v = np.array([0, 0, -9.81]), np.array([0, 0, -speed])
    for state in dynamics.march(0.1, start):
        record = audit.update(state)
        energies.append(sum(record[f"{name}_J"] for name in audit.energy_names))
        assert (body.points + state.displacement)[:, 2].min() > 0
        assert record["contact_gap_m"] > 0
        force = np.array([record[f"contact_force_{axis}_N"] for axis in "xyz"])
        if state.time > 0:
            f = force / mass + [0, 0, -9.81]
            after = (f - (1 - am) * b) / am
            v, b = v + state.step * ((1 - g) * b + g * after), after
            impulse += state.step * f
        touched += force[2] > 0
        mean = lumped @ state.velocity / mass
        assert np.abs(mean - v).max() <= 1e-6 * speed
    assert touched >= 3
    kinetic = 0.5 * mass * speed**2
    # 7 ranges per step, and dt grows while the block rings: 4e-6; without `LEAP` 9e-2
    assert np.diff(energies).max() <= rise * kinetic
    assert energies[-1] < energies[0] - 0.5 * kinetic
    # the plain sum of impulses misses (af - 1/2) b of every change of dt (1 to 5 % here)
    assert np.abs(mean - [0, 0, -speed] - impulse).max() <= 0.1 * speed


def test_refusals():
    """A point behind the obstacle; a touching point that leaps; not one that goes over a rim."""
    system = System(Scene(BODY, (ReportTissue(), Contact(BELOW), Contact(Disc()))), True)
    plane, disc = system.couplings
    low, high, deep, aside = (
        system.mixed(np.tile(way, (len(BODY.points), 1)))
        for way in ([0, 0, -0.9e-3], [0, 0, -0.5e-3], [0, 0, -1.2e-3], [0.05, 0, -0.9e-3])
    )
    rest = 0 * low
    assert plane.refusal(0.0, low, rest) == ""
    assert plane.refusal(0.0, low) == ""
    assert "penetration of 0.0002 m at contact_1" in plane.refusal(0.0, deep, low)
    assert "penetration" in plane.refusal(0.0, deep)
    assert plane.refusal(0.0, rest, rest) == ""
    assert "leap" in plane.refusal(0.0, high, low)  # 1e-4 to 5e-4 m, range 2e-4 m
    assert plane.refusal(0.0, high) == ""
    assert "penetration" in disc.refusal(0.0, deep, low)
    assert disc.refusal(0.0, aside, low) == "" and disc.refusal(0.0, low, aside) == ""
    system.set_state(0.0, aside, rest, rest, aside)
    assert disc.observed(system.arguments(0.0))["contact_2_gap_m"] == np.inf


class Disc(Plane):
    """BELOW, but nothing beyond 4 cm from the origin."""

    def __init__(self):
        super().__init__(BELOW.point)

    def gap(self, points):
        gap = super().gap(points)
        beyond = np.linalg.norm(points[:, :2], axis=1) > 0.04
        return replace(gap, distance=np.where(beyond, np.inf, gap.distance))


def test_report_law_stops_a_drop_but_lets_it_creep():
    """(60) loses energy while the gap closes and does no work while it opens; a barrier holds."""
    last = {}
    for beside in (False, True):
        scene = dropped("flat", ReportContact(1e8, 1.0, 1.0, 5e-4))
        if beside:
            scene = replace(scene, terms=(*scene.terms, Contact(Plane(), "z0", Barrier(3e-4))))
        dynamics = Dynamics(scene, TimeSteps(2e-3))
        audit = EnergyAudit(dynamics.system)
        start = dynamics.rest()
        start = replace(start, velocity=np.tile([0, 0, -0.1], (len(scene.body.points), 1)))
        label = "contact_1" if beside else "contact"
        gaps, works = [], []
        for state in dynamics.march(0.2, start):
            record = audit.update(state)
            gaps.append(record[f"{label}_gap_m"])
            works.append(record[f"work_{label}_J"])
        assert min(gaps) > 0
        assert np.diff(works).max() <= 1e-15 and works[-1] < -1e-6
        last[beside] = np.array(gaps[-20:])
    assert (np.diff(last[False]) < 0).all() and last[False][-1] < 1.5e-4
    resting = 3e-4 / (1 + np.sqrt(9.81 * scene.body.mass / 4e-4 / 1e3))
    assert last[True] == pytest.approx(resting, rel=0.2)  # the pressure is not uniform


def test_moving_obstacle_gives_the_work_that_the_body_takes():
    """A plane lifts a block: its work becomes height; the balance closes better with smaller dt."""
    body = block_body((0.02, 0.02, 0.01), (2, 2, 1))
    body = replace(body, points=body.points + np.array([0, 0, 1.5e-4]))
    lift = (Still(), Still(), SmoothMove(0.01, 0.05, 0.3))
    terms = (ReportTissue(), Viscosity(20.0), Gravity(), Contact(Plane(), "z0", motion=lift))
    errors = []
    for dt in (8e-3, 2e-3):
        dynamics = Dynamics(Scene(body, terms), TimeSteps(dt))
        audit = EnergyAudit(dynamics.system)
        for state in dynamics.march(0.5):
            record = audit.update(state)
        lifted = body.mass * 9.81 * 0.01
        assert record["work_contact_motion_J"] == pytest.approx(lifted, rel=0.03)
        errors.append(abs(record["balance_J"]) / lifted)
    assert errors[1] < errors[0] / 2 and errors[1] < 1e-2
