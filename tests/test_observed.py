"""What both solvers say of a state: stress, strain, muscles, contact, energies; by closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dolfin_tongue.base.units import mm
from dolfin_tongue.body import Body, Fibres, MuscleFibres, State
from dolfin_tongue.body.fibre_lines import fibre_lengths
from dolfin_tongue.boundary import Attached, Contact, Gravity
from dolfin_tongue.constitutive import (
    ActiveMuscles,
    ConstantFibreStress,
    MooneyRivlin,
    ReportTissue,
    StressMobilisation,
    Viscosity,
)
from dolfin_tongue.control import Constant
from dolfin_tongue.direct import TrBdf2
from dolfin_tongue.geometry.muscles import CROSS_SECTIONS
from dolfin_tongue.geometry.preliminary import preliminary_tongue
from dolfin_tongue.geometry.simple import block_body, distort
from dolfin_tongue.scene import Scene
from dolfin_tongue.surfaces import Plane

pytest.importorskip("dolfinx")
from dolfin_tongue.fenicsx import GeneralisedAlpha, Statics

MUSCLES = {"along": (1.0, 0.2, 0.0), "across": (0.0, 1.0, 1.0)}
BODY = distort(block_body((0.03, 0.02, 0.025), (3, 2, 2), muscles=MUSCLES), 0.3)
TERMS = (
    ReportTissue(),
    MooneyRivlin(c01=300.0),
    Viscosity(40.0),
    ActiveMuscles({"along": Constant(0.6), "across": Constant(0.3)}),
    Gravity((1.0, -2.0, -9.0)),
)
PAIRS = ("Q1/P0", "Q2/P1", "P2/P1")


def random_state(body=BODY, seed=0) -> State:
    random = np.random.default_rng(seed)
    shape = body.points.shape
    u, v = 1e-3 * random.uniform(-1, 1, shape), 0.3 * random.uniform(-1, 1, shape)
    return State(0.1, u, v, random.uniform(-2e3, 2e3, body.cell_count))


def homogeneous(body, gradient, rate, pressure=0.0) -> State:
    """State of a homogeneous deformation."""
    count = body.cell_count
    points = body.points
    return State(0.1, points @ gradient.T, points @ rate.T, np.full(count, float(pressure)))


def solvers(scene, pairs=PAIRS):
    yield "direct", TrBdf2().solver(scene)
    for pair in pairs:
        yield pair, GeneralisedAlpha(pair=pair).solver(scene)


# -- the solvers against each other ---------------------------------------------------------------


def test_stress_and_strain_agree_at_all_points():
    scene, state = Scene(BODY, TERMS), random_state()
    mine = TrBdf2().solver(scene).fields(state)
    theirs = GeneralisedAlpha().solver(scene).fields(state)
    names = {"report_tissue", "mooney_rivlin", "viscosity", "active_muscles"}
    assert set(mine.parts) == set(theirs.parts) == names
    for name in names:
        scale = np.abs(theirs.parts[name]).max()
        assert np.abs(mine.parts[name] - theirs.parts[name]).max() <= 1e-12 * scale
    for name in ("cauchy", "second_piola", "green_strain", "volume_ratio", "pressure"):
        a, b = getattr(mine, name), getattr(theirs, name)
        assert np.abs(a - b).max() <= 1e-12 * np.abs(b).max(), name
    np.testing.assert_array_equal(mine.points.cells, theirs.points.cells)


def test_muscles_agree():
    scene, state = Scene(BODY, TERMS), random_state()
    mine = TrBdf2().solver(scene).muscles(state)
    theirs = GeneralisedAlpha().solver(scene).muscles(state)
    assert set(mine) == {"along", "across"}
    for name, muscle in theirs.items():
        for what in ("stretch", "rate", "stress", "tension", "force"):
            a, b = getattr(mine[name], what), getattr(muscle, what)
            assert np.abs(a - b).max() <= 1e-12 * np.abs(b).max(), what


def test_energies_and_powers_agree():
    scene, state = Scene(BODY, TERMS), random_state()
    mine, theirs = TrBdf2().solver(scene), GeneralisedAlpha().solver(scene)
    for what in ("energies", "powers"):
        a, b = getattr(mine, what)(state), getattr(theirs, what)(state)
        assert set(a) == set(b)
        assert a == pytest.approx(b, rel=1e-11)


def test_stress_makes_the_forces():
    """The nodal forces of the direct solver are minus the integral of its own P : grad N."""
    scene, state = Scene(BODY, TERMS[:-1]), random_state()
    solver = TrBdf2().solver(scene)
    fields = solver.fields(state)
    (block,) = BODY.blocks
    P = fields.first_piola.reshape(*block.shape, 3, 3)
    forces = np.zeros_like(BODY.points)
    parts = -np.einsum("mq,mqij,mqkj->mki", block.weights, P, block.gradients)
    np.add.at(forces, block.cells, parts)
    expected = solver.model.balance(state, state.displacement, state.velocity)
    assert np.abs(forces - expected).max() <= 1e-12 * np.abs(expected).max()


# -- closed forms ----------------------------------------------------------------------------------


@pytest.mark.parametrize("pair", ["direct", *PAIRS])
def test_a_homogeneous_stretch_in_closed_form(pair):
    """Stretch l along x with free sides: T11 - T22 = 2 c10 (l^2 - 1/l) of a neo-Hookean law."""
    stretch = 1.3
    gradient = np.diag([stretch, stretch**-0.5, stretch**-0.5]) - np.eye(3)
    body = block_body((0.03, 0.02, 0.025), (3, 2, 2))
    scene = Scene(body, (MooneyRivlin(c10=1037.0, c20=0.0),))
    ((_, solver),) = [x for x in solvers(scene) if x[0] == pair]
    state = homogeneous(body, gradient, np.zeros((3, 3)), pressure=250.0)
    fields = solver.fields(state)
    expected = 2 * 1037.0 * (stretch**2 - 1 / stretch)
    T = fields.cauchy
    np.testing.assert_allclose(T[:, 0, 0] - T[:, 1, 1], expected, rtol=1e-12)
    np.testing.assert_allclose(-np.trace(T, axis1=1, axis2=2) / 3, 250.0, rtol=1e-10)
    np.testing.assert_allclose(fields.volume_ratio, 1.0, rtol=1e-12)
    E = fields.green_strain
    np.testing.assert_allclose(E[:, 0, 0], (stretch**2 - 1) / 2, rtol=1e-12)
    np.testing.assert_allclose(E[:, 0, 1], 0.0, atol=1e-14)
    S = fields.second_piola
    F = fields.deformation_gradient
    np.testing.assert_allclose(F @ S @ F.swapaxes(1, 2), T, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("pair", ["direct", *PAIRS])
def test_a_muscle_in_closed_form(pair):
    """Activation, stretch and rate of a bar; force = stress over the deformed cross-section."""
    stretch, rate = 1.1, -4.0
    gradient = np.diag([stretch, stretch**-0.5, stretch**-0.5]) - np.eye(3)
    body = block_body((0.03, 0.02, 0.01), (3, 2, 2), muscles={"along": (1, 0, 0)})
    law = StressMobilisation()
    term = ActiveMuscles({"along": Constant(0.4)}, max_stress=1e5)
    scene = Scene(body, (ReportTissue(), term))
    ((_, solver),) = [x for x in solvers(scene) if x[0] == pair]
    motion = np.diag([rate, 0.0, 0.0])
    muscle = solver.muscles(homogeneous(body, gradient, motion))["along"]
    stress = 0.4 * 1e5 * law.length_factor(stretch) * law.rate_factor(rate)
    assert muscle.activation == 0.4
    np.testing.assert_allclose(muscle.stretch, stretch, rtol=1e-12)
    np.testing.assert_allclose(muscle.rate, rate, rtol=1e-10)
    np.testing.assert_allclose(muscle.stress, stress, rtol=1e-10)
    assert muscle.force == pytest.approx(stress * 2e-4 / stretch, rel=1e-10)


def test_means_over_cells_and_around_nodes():
    """A constant stays constant; a linear field has its value at the cells' centroids."""
    scene = Scene(BODY, TERMS)
    points = TrBdf2().solver(scene).strain(random_state()).points
    (block,) = BODY.blocks
    np.testing.assert_allclose(points.on_nodes(np.full(len(points.cells), 3.0)), 3.0, rtol=1e-13)
    places = block.places.reshape(-1, 3)
    centroids = points.on_cells(places)
    volumes = np.einsum("mq,mqi->mi", block.weights, block.places) / BODY.volumes[:, None]
    np.testing.assert_allclose(centroids, volumes, rtol=1e-13)
    np.testing.assert_allclose(points.hats @ BODY.points, places, atol=1e-16)
    some = np.flatnonzero(points.cells < 2)
    means = points.on_cells(np.ones(len(some)), some)
    assert (means[:2] == 1).all() and np.isnan(means[2:]).all()


@pytest.mark.parametrize("pair", PAIRS)
def test_mean_volumes_of_every_pair(pair):
    """A motion keeps the mean volume of each cell (of P2/P1: around each node) to 1e-8."""
    pull = ConstantFibreStress({"along": Constant(0.3)}, 2e4)
    scene = Scene(BODY, (ReportTissue(), Viscosity(20.0), pull), (Attached("x0"),))
    solver = GeneralisedAlpha(5e-3, pair=pair).solver(scene)
    *_, last = solver.march(0.05)
    strain = solver.strain(last)
    ratio = strain.volume_ratio
    assert np.abs(ratio - 1).max() > 1e-3  # inside the cells it varies
    means = strain.points.on_cells(ratio)
    if pair == "P2/P1":
        means = strain.points.on_nodes(ratio)
    assert np.abs(means - 1).max() < 1e-8


def test_fibre_lengths():
    """Lines through cells: along a box, across its edges, and the sections of the report's tongue."""
    body = block_body((0.03, 0.02, 0.01), (3, 2, 2), muscles={"x": (1, 0, 0), "xz": (1, 0, 1)})
    np.testing.assert_allclose(fibre_lengths(body, "x"), 0.03, rtol=1e-12)
    # at 45 degrees through the centres of cells of 10 x 10 x 5 mm: cut off by the box's corners
    lengths = {round(1e5 * x) for x in fibre_lengths(body, "xz")}
    assert lengths == {round(1e5 * 2**0.5 * x) for x in (0.0075, 0.01)}
    cut = Body(body.points, {"prism6": prisms(body.hexahedra)}, fibres=along_x(24))
    np.testing.assert_allclose(fibre_lengths(cut, "x"), 0.03, rtol=1e-12)
    tongue = preliminary_tongue()
    for name, nominal in CROSS_SECTIONS.items():
        muscle = tongue.fibres[name]
        volumes = tongue.volumes[muscle.cells] * muscle.density
        section = (volumes / fibre_lengths(tongue, name)).sum() / mm**2
        # scaled by the mean length; by its inverse fibres of other lengths count more
        assert nominal < section < 1.3 * nominal


def prisms(cells: np.ndarray) -> np.ndarray:
    """Two prisms of each brick, cut along the diagonal of its bottom."""
    return np.concatenate([cells[:, [0, 1, 2, 4, 5, 6]], cells[:, [0, 2, 3, 4, 6, 7]]])


def along_x(count: int) -> Fibres:
    directions = np.tile([1.0, 0.0, 0.0], (count, 1))
    return Fibres((MuscleFibres("x", np.arange(count), directions, np.ones(count)),))


# -- contact ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["direct", "FEniCSx"])
def test_the_pressure_of_contact_adds_up_to_the_resultant(name):
    body = block_body((0.02, 0.02, 0.01), (4, 4, 2))
    body = replace(body, points=body.points + np.array([0.0, 0.0, 1e-4]))
    scene = Scene(body, (ReportTissue(), Viscosity(20.0), Gravity(), Contact(Plane(), "z0")))
    method = TrBdf2(5e-3) if name == "direct" else GeneralisedAlpha(5e-3)
    solver = method.solver(scene)
    *_, last = solver.march(0.3)
    (touch,) = solver.contacts(last).values()
    weight = 9.81 * body.mass
    assert touch.force[2] == pytest.approx(weight, rel=2e-2)
    assert (touch.pressure[~np.isclose(body.points[:, 2], 1e-4)] == 0).all()
    # the integral of the bilinear map over the bottom, whose faces are equal
    faces = body.surface("z0")
    integral = touch.pressure[faces].mean(axis=1).sum() * 4e-4 / len(faces)
    assert integral == pytest.approx(touch.force[2], rel=1e-10)


# -- statics ---------------------------------------------------------------------------------------


def test_statics_is_asked_like_a_motion():
    scene = Scene(BODY, (ReportTissue(), Gravity()), (Attached("x0"),))
    solver = Statics(scene)
    state = solver.solve()
    assert state.load == 1.0
    fields = solver.fields(state)
    assert set(fields.parts) == {"report_tissue"}
    energies = solver.energies(state)
    assert set(energies) == {"report_tissue", "gravity"}
    # of a nearly linear problem: the load has lost twice what the tissue has stored
    assert energies["gravity"] == pytest.approx(-2 * energies["report_tissue"], rel=0.1)
