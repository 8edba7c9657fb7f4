"""Named surfaces, surface tension and skin: closed forms, all pairs of spaces, bad input."""

from dataclasses import replace

import numpy as np
import pytest

from dolfin_tongue.base.errors import BadMesh, OutOfRange, UnknownName
from dolfin_tongue.body.faces import areas
from dolfin_tongue.boundary import Attached, Skin, SurfaceTension
from dolfin_tongue.constitutive import ReportTissue, Viscosity
from dolfin_tongue.control import Instant
from dolfin_tongue.direct import Model
from dolfin_tongue.direct.choice import parts_of
from dolfin_tongue.fenicsx import GeneralisedAlpha, Statics, System
from dolfin_tongue.fenicsx.arguments import Arguments
from dolfin_tongue.fenicsx.pairs import PAIRS
from dolfin_tongue.geometry.simple import ball_body, block_body
from dolfin_tongue.record.observe import EnergyAudit
from dolfin_tongue.scene.scene import Scene

BODY = block_body((0.03, 0.02, 0.01), (3, 2, 1))


def nodal_forces(body, term, displacement):
    """Inner forces of a term from both solvers, which agree; shape (n, 3), N."""
    scene = Scene(body, (term,))
    model = Model(scene)
    mine = -model.force(Instant(0.0), displacement, 0 * displacement)
    system = System(scene, dynamic=True)
    y, out = system.vector(displacement), np.zeros(system.size)
    system.residual(Arguments(Instant(0.0), 0.0, y, 0 * y, 0 * y, y), out)
    assert np.abs(system.displacement(out) - mine).max() <= 1e-12 * np.abs(mine).max()
    return mine


# -- surfaces -------------------------------------------------------------------------------------


def test_boundary_is_closed_and_points_outward():
    for body in (BODY, ball_body(0.01, 3)):
        corner = body.points[body.boundary]
        normal = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1]) / 2
        assert np.abs(normal.sum(axis=0)).max() <= 1e-15
        volume = (corner.mean(axis=1) * normal).sum() / 3  # flat or nearly flat faces
        assert volume == pytest.approx(body.volumes.sum(), rel=5e-3)
    assert len(BODY.boundary) == 2 * (6 + 3 + 2)


def test_surfaces_of_a_block():
    size = {"x0": 2e-4, "x1": 2e-4, "y0": 3e-4, "y1": 3e-4, "z0": 6e-4, "z1": 6e-4}
    for name, area in size.items():
        assert areas(BODY.points, BODY.surface(name)).sum() == pytest.approx(area, rel=1e-12)
    assert areas(BODY.points, BODY.surface("boundary")).sum() == pytest.approx(2.2e-3)


def test_ball():
    errors = []
    for cells, count in ((2, 32), (4, 256)):
        body = ball_body(0.01, cells)
        assert len(body.cells) == count
        assert body.scaled_jacobians.min() > 0.3
        outer = np.unique(body.boundary)
        assert np.linalg.norm(body.points[outer], axis=1) == pytest.approx(0.01, rel=1e-12)
        errors.append(1 - body.volumes.sum() / (4 / 3 * np.pi * 1e-6))
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.15)


def test_unknown_surface_lists_the_known_ones():
    with pytest.raises(UnknownName, match=r"unknown surface 'top'.*boundary, x0, x1"):
        Scene(BODY, (SurfaceTension(1.0, surface="top"),))
    with pytest.raises(UnknownName, match="unknown surface"):
        Scene(BODY, (Skin(1e3, 1e-3, surface="top"),))
    with pytest.raises(UnknownName, match=r"known surface names: boundary"):
        parts_of(BODY, [("skin", Skin(1.0, 1.0, "top"))])


@pytest.mark.parametrize(
    ("faces", "message"),
    [
        (BODY.surface("z1")[:, ::-1], r"'film': face\(s\) 0, 1, 2, .* point inward"),
        (BODY.surface("z1")[:, [0, 2, 1, 3]], "cross themselves"),
        (BODY.cells[:1, [1, 2, 6, 5]], r"face\(s\) 0 are not the face of exactly one"),
        (np.array([[0, 1, 2, 3]]), "not the face of exactly one cell"),
        (BODY.surface("z1")[[0, 1, 0]], "names a face twice"),
        (np.zeros((0, 4), dtype=int), "is empty"),
        (np.zeros((2, 3), dtype=int), "not the face of exactly one cell"),  # triangles
        (np.zeros((2, 5), dtype=int), r"shape \(k, 4\)"),
        (np.zeros((2, 4)), "not float64"),
    ],
)
def test_bad_surfaces(faces, message):
    with pytest.raises(BadMesh, match=message):
        replace(BODY, surfaces={"film": faces})


def test_the_name_of_the_boundary_is_taken():
    with pytest.raises(BadMesh, match="'boundary' is taken"):
        replace(BODY, surfaces={"boundary": BODY.surface("z1")})


@pytest.mark.parametrize("bad", [0.0, -0.07, np.nan, np.inf])
def test_numbers_without_physical_sense(bad):
    for make in (
        lambda: SurfaceTension(bad),
        lambda: Skin(bad, 1e-3),
        lambda: Skin(1e3, bad),
        lambda: ball_body(bad),
    ):
        with pytest.raises(OutOfRange):
            make()


def test_a_scene_without_surface_terms_has_no_surface_integrals():
    plain = System(Scene(BODY, (ReportTissue(),)), True)
    film = System(Scene(BODY, (ReportTissue(), SurfaceTension(1.0))), True)
    assert [block.domain.surface for block in plain.blocks] == [None]
    assert [block.domain.surface for block in film.blocks] == [None, "boundary"]
    for system in (plain, film):
        assert not system.volume.residual_form.integrals_by_type("exterior_facet")
    assert len(film.blocks[1].residual_form.integrals()) == 1
    assert len(film.blocks[1].domain.owners) == len(BODY.boundary)


# -- closed forms ---------------------------------------------------------------------------------


@pytest.mark.parametrize("pair", PAIRS)
def test_energy_of_every_pair_of_spaces(pair):
    """At rest the energy is sigma times the area, also of surfaces that overlap."""
    terms = (SurfaceTension(2.0), SurfaceTension(5.0, "z1"), Skin(1e3, 1e-3, "x0"))
    scene = Scene(BODY, terms)
    solver = GeneralisedAlpha(1e-3, pair=pair).solver(scene)
    rest, system = solver.rest(), solver.system
    found = solver.energies(rest)
    energies = [found[label] for label in scene.labels]
    assert energies == pytest.approx([2.0 * 2.2e-3, 5.0 * 6e-4, 0.0], abs=1e-15)
    out = np.zeros(system.size)
    system.residual(system.at_state(rest), out)
    assert np.abs(out).max() > 1e-3


def test_edge_of_a_film_pulls_with_sigma_per_length():
    """Integral of the first Piola-Kirchhoff membrane stress of a homogeneous state."""
    F = np.array([[1.2, 0.3, 0.0], [-0.1, 0.9, 0.2], [0.0, 0.1, 1.1]])
    force = nodal_forces(BODY, SurfaceTension(3.0, "z1"), BODY.points @ (F - np.eye(3)).T)
    normal = np.linalg.det(F) * np.linalg.inv(F).T @ [0.0, 0.0, 1.0]
    ratio = np.linalg.norm(normal)
    projector = np.eye(3) - np.outer(normal, normal) / ratio**2
    stress = force.T @ BODY.points @ F.T / (6e-4 * ratio)
    assert stress == pytest.approx(3.0 * projector, abs=1e-12)


@pytest.mark.parametrize("stretch", [0.8, 1.3, 2.0])
def test_skin_closed_forms(stretch):
    """Force per deformed length: equibiaxial mu h (1 - l^-6), uniaxial mu h (l^2 - 1/l) l^-1/2."""
    l, mu_h = stretch, 20.0  # noqa: E741
    cases = {(l, l): (1 - l**-6, 1 - l**-6), (l, l**-0.5): ((l**2 - 1 / l) * l**-0.5, 0.0)}
    for (first, second), expected in cases.items():
        F = np.diag([first, second, 1.4])  # the stretch across is not the body's
        force = nodal_forces(BODY, Skin(20e3, 1e-3, "z1"), BODY.points @ (F - np.eye(3)).T)
        stress = force.T @ BODY.points @ F.T / (6e-4 * first * second)
        assert stress == pytest.approx(mu_h * np.diag([*expected, 0.0]), abs=1e-11)


@pytest.mark.parametrize("cells", [2, 4])
def test_tension_of_a_sphere_is_laplaces_pressure(cells):
    """Virial of the nodal forces: f.x = 2 sigma area, so that p = 2 sigma area / (3 volume)."""
    body = ball_body(0.01, cells)
    force = nodal_forces(body, SurfaceTension(0.5), np.zeros_like(body.points))
    area = areas(body.points, body.boundary).sum()
    assert (force * body.points).sum() == pytest.approx(2 * 0.5 * area, rel=1e-12)
    pressure = (force * body.points).sum() / (3 * body.volumes.sum())
    radius = (3 * body.volumes.sum() / (4 * np.pi)) ** (1 / 3)
    assert pressure == pytest.approx(2 * 0.5 / radius, rel=0.25 / cells**2)


def test_inflated_skin_and_static_film_find_equilibrium():
    """A block under tension of one face contracts there; statics raises the tension in steps."""
    terms = (ReportTissue(), SurfaceTension(3.0, "z1"), Skin(20e3, 1e-3, "z0"))
    static = Statics(Scene(BODY, terms, (Attached("x0"),)))
    states = list(static.load_steps(first=0.5))
    lengths = [
        np.ptp((BODY.points + s.displacement)[np.unique(BODY.surface("z1"))], axis=0)[0]
        for s in states
    ]
    assert states[-1].load == 1.0
    assert lengths[-1] < lengths[0] < 0.03


def test_the_energy_audit_counts_surfaces():
    scene = Scene(BODY, (ReportTissue(), Viscosity(20.0), SurfaceTension(1.0), Skin(5e3, 1e-3)))
    errors = []
    for dt in (1e-3, 5e-4):
        solver = GeneralisedAlpha(dt).solver(scene)
        audit = EnergyAudit(solver, scene)
        balances = [audit.update(state) for state in solver.march(0.02)]
        errors.append(max(abs(b["balance_J"]) for b in balances) / balances[-1]["exchanged_J"])
    assert {"surface_tension_J", "skin_J"} <= set(balances[-1])
    assert balances[0]["surface_tension_J"] == pytest.approx(2.2e-3)
    assert errors[1] <= 0.35 * errors[0]
    assert errors[1] <= 0.02
