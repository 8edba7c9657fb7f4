"""Contact with rigid obstacles: laws, points, tangents, what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from dolfin_tongue.base.errors import BadScene, OutOfRange, UnknownName
from dolfin_tongue.boundary import Barrier, Contact, Gravity, ReportContact
from dolfin_tongue.constitutive import ReportTissue
from dolfin_tongue.control import Instant, SmoothMove, Still
from dolfin_tongue.fenicsx import System
from dolfin_tongue.fenicsx.arguments import Arguments, Shifts
from dolfin_tongue.fenicsx.contact import ContactSurface, Situation
from dolfin_tongue.fenicsx.contact_points import surface_points
from dolfin_tongue.fenicsx.pairs import PAIRS
from dolfin_tongue.geometry.simple import block_body, distort
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
        (lambda: Contact(BELOW, motion=(0.0, 0.0, 1e-3)), BadScene, "must be a motion"),
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
    numbering = system.numbering
    y = np.zeros(numbering.size)
    y[numbering.displacements] = (numbering.positions @ G.T).ravel()
    table = surface_points(numbering, "boundary")
    assert (table.places == whole.points).all()
    assert table.moves @ y == pytest.approx((whole.points @ G.T).ravel(), abs=1e-15)


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
    random, numbering = np.random.default_rng(3), system.numbering
    state, rate, acceleration, end = random.uniform(-1, 1, (4, system.size))
    for y, size in ((state, 2e-4), (rate, 2e-2), (acceleration, 1.0), (end, 2e-4)):
        y[numbering.pressures] *= 100.0
        y[numbering.displacements] *= size
    if plane:
        for y in (state, end):
            y[numbering.displacements][2::3] -= 3e-3
    return system, [state, rate, acceleration, end]


TIMES = (0.045, 0.05)


def arguments(parts):
    """Of a residual at a stage before the end of a step."""
    return Arguments(Instant(TIMES[0]), TIMES[1], *parts)


def residual(system, parts):
    out = np.zeros(system.size)
    system.residual(arguments(parts), out)
    return out


@pytest.mark.parametrize("pair", PAIRS)
@pytest.mark.parametrize("name", OBSTACLES)
def test_jacobian_is_the_derivative_of_the_residual(name, pair):
    system, parts = bent_system(OBSTACLES[name], pair)
    shifts = (70.0, 4e3, 1.8)
    assert (system.couplings[0].pressed(arguments(parts)).traction > 0).sum() >= 5
    matrix = system.new_matrix()
    system.jacobian(arguments(parts), Shifts(*shifts), matrix)
    indptr, indices, values = matrix.getValuesCSR()
    way = np.random.default_rng(5).uniform(-1, 1, system.size)
    way[system.numbering.pressures] *= 1e6
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
    for dofs in (system.numbering.displacements, system.numbering.pressures):
        scale = np.abs(product[dofs]).max()
        assert np.abs(difference - product)[dofs].max() <= 1e-7 * scale


@pytest.mark.parametrize("pair", PAIRS)
@pytest.mark.parametrize("name", ["plane", "bowl", "rod", "moving"])
def test_residual_is_the_derivative_of_the_energy(name, pair):
    """At the end of the step; contact alone, so that no other energy covers it."""
    system, (_, _, _, y) = bent_system(OBSTACLES[name], pair)
    contact = system.couplings[0]
    way = np.random.default_rng(5).uniform(-1, 1, system.size)

    def at_end(y):
        return Arguments(Instant(TIMES[1]), TIMES[1], y, 0 * y, 0 * y, y)

    out = np.zeros(system.size)
    contact.add_residual(at_end(y), out)
    step = 1e-7  # (step/gap)^2 = 1e-8 times third derivatives; round-off 1e-16 gap/step = 1e-12
    ahead, behind = (contact.energies(at_end(y + s * step * way)) for s in (1, -1))
    (label,) = ahead
    power = (ahead[label] - behind[label]) / (2 * step)
    scale = np.abs(out * way).sum()
    assert scale > 0 and abs(power - out @ way) <= 1e-6 * scale
    assert not out[system.numbering.pressures].any()
    total = out[system.numbering.displacements].reshape(-1, 3).sum(axis=0)
    force = contact.touch(at_end(y)).force
    assert force == pytest.approx(-total, rel=1e-12, abs=1e-12 * np.abs(total).max())


def test_nothing_is_missed_by_what_is_spared():
    """Evaluations that rely on an earlier gap equal those of a system that never saw one."""
    contact = Contact(Sphere((0.01, 0.01, 0.002), 0.03, inside=True), "boundary", Barrier(1e-3))
    system = System(Scene(BODY, (ReportTissue(), contact)), True)
    part, random = system.couplings[0], np.random.default_rng(2)
    moves = surface_points(system.numbering, "boundary").moves
    before = part.watched(Situation(Instant(0.0), np.zeros(system.size)))
    spared = touched = 0
    for _ in range(150):
        y = system.vector(random.uniform(-1, 1) * random.uniform(-0.016, 0.016, (18, 3)))
        at, here = Arguments(Instant(0.0), 0.0, y, 0 * y, 0 * y, y), Situation(Instant(0.0), y)
        quick, whole = np.zeros((2, system.size))
        part.add_residual(at, quick)
        watched = part.watched(here)
        spared += watched is before and len(watched.points) < len(part.points)
        before = watched
        ContactSurface(contact, system.numbering, "new").add_residual(at, whole)
        assert (quick == whole).all()
        touched += whole.any()
        gap = part.gap(here)
        force = (part.weights * contact.law.traction(gap.distance)[0])[:, None] * gap.normal
        assert whole == pytest.approx(-moves.T @ force.ravel(), rel=1e-12, abs=1e-15)
    assert spared >= 5 and touched >= 5


def test_refusals():
    """A point behind the obstacle; a touching point that leaps; not one that goes over a rim."""
    system = System(Scene(BODY, (ReportTissue(), Contact(BELOW), Contact(Disc()))), True)
    plane, disc = system.couplings
    low, high, deep, aside = (
        system.vector(np.tile(way, (len(BODY.points), 1)))
        for way in ([0, 0, -0.9e-3], [0, 0, -0.5e-3], [0, 0, -1.2e-3], [0.05, 0, -0.9e-3])
    )
    rest = 0 * low

    def at(end):
        return Arguments(Instant(0.0), 0.0, end, rest, rest, end)

    assert plane.reason_to_reject(at(low), rest) == ""
    assert plane.reason_to_reject(at(low)) == ""
    assert "penetration of 0.0002 m at contact_1" in plane.reason_to_reject(at(deep), low)
    assert "penetration" in plane.reason_to_reject(at(deep))
    assert plane.reason_to_reject(at(rest), rest) == ""
    # 1e-4 to 5e-4 m, range 2e-4 m
    assert "leap" in plane.reason_to_reject(at(high), low)
    assert plane.reason_to_reject(at(high)) == ""
    assert "penetration" in disc.reason_to_reject(at(deep), low)
    assert disc.reason_to_reject(at(aside), low) == ""
    assert disc.reason_to_reject(at(low), aside) == ""
    assert disc.touch(at(aside)).gap == np.inf


class Disc(Plane):
    """BELOW, but nothing beyond 4 cm from the origin."""

    def __init__(self):
        super().__init__(BELOW.point)

    def gap(self, points):
        gap = super().gap(points)
        beyond = np.linalg.norm(points[:, :2], axis=1) > 0.04
        return replace(gap, distance=np.where(beyond, np.inf, gap.distance))
