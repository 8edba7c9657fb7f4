"""Sliding, contact and rigid bodies in both solvers: equal forces, and motions that converge."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cases import apply_matrices, relative

from benchmarks.extremes.proofs import hinged_bone
from dolfin_tongue.base.errors import BadScene
from dolfin_tongue.body.state import State
from dolfin_tongue.boundary import Barrier, Contact, Gravity, ReportContact, Sliding, moved_onto
from dolfin_tongue.boundary.sliding import off_surface
from dolfin_tongue.constitutive import MooneyRivlin, Viscosity
from dolfin_tongue.control import Constant, Instant, SmoothMove, Still, Swing
from dolfin_tongue.direct import Model, TrBdf2
from dolfin_tongue.geometry.simple import block_body, distort
from dolfin_tongue.march.compare import orders
from dolfin_tongue.rigid import AngularSpring, LineMuscle, RigidBody
from dolfin_tongue.scene.scene import Scene
from dolfin_tongue.surfaces import Cylinder, Implicit, Plane, Sphere

pytest.importorskip("dolfinx")

BOWL = Sphere((0.015, 0.01, 0.1), 0.1, inside=True)


def carried_block() -> Scene:
    """A block between two bones, whose underside slides on a bowl."""
    body = block_body((0.03, 0.02, 0.02), (3, 2, 2))
    bones = np.concatenate([body.nodes("x0"), body.nodes("x1")])
    under = np.setdiff1d(body.nodes("z0"), bones)
    body = replace(body, node_sets={**body.node_sets, "under": under})
    body = moved_onto(body, BOWL, "under")
    pull = LineMuscle(
        (-0.01, 0.01, 0.02), (0.04, 0.01, 0.0), to="right", max_force=2.0, activation=Constant(0.4)
    )
    left = RigidBody("left", ("x0",), 0.05, 1e-5, (-0.01, 0.01, 0.015), (pull, AngularSpring(0.1)))
    right = RigidBody("right", ("x1",), 0.02, 4e-6, (0.04, 0.01, 0.01), pivot=(0.05, 0.01, 0.05))
    terms = (MooneyRivlin(), Viscosity(30.0), Gravity())
    return Scene(body, terms, (Sliding(BOWL, "under"), left, right))


def random_state(scene: Scene, seed: int) -> State:
    """Random displacements, velocities, pressures, coordinates and multipliers."""
    rng = np.random.default_rng(seed)
    shape, cells = scene.body.points.shape, len(scene.body.cells)
    u, v = 1e-3 * rng.uniform(-1, 1, shape), 0.1 * rng.uniform(-1, 1, shape)
    q, rate = rng.uniform(-1, 1, (2, 2, 3)) * [2e-3, 2e-3, 0.1]
    return State(
        0.03, u, v, rng.uniform(-2e3, 2e3, cells), rigid=q, rigid_rate=10 * rate,
        sliding=rng.uniform(-1, 1, len(scene.sliding[0].nodes(scene.body))),
    )  # fmt: skip


@pytest.mark.parametrize("seed", [0, 1])
def test_forces_on_bones_and_sliding_nodes_agree(seed):
    """The FEniCSx side is given the displacements that the bones give their nodes."""
    from dolfin_tongue.fenicsx import System
    from dolfin_tongue.fenicsx.arguments import Arguments
    from dolfin_tongue.fenicsx.rigid import RigidBodies

    scene = carried_block()
    model, system = Model(scene), System(scene, dynamic=True)
    state = random_state(scene, seed)
    u, v = model.rows(state)
    count = len(scene.body.points)
    state = replace(state, displacement=u[:count], velocity=v[:count])
    acceleration = np.random.default_rng(seed).uniform(-5, 5, state.displacement.shape)
    now = Instant(state.time)
    y, rate = system.vectors(state)
    at = Arguments(now, now.time, y, rate, system.vector(acceleration), y)
    rows = system.reactions(at)
    (rigid,) = (part for part in system.couplings if isinstance(part, RigidBodies))
    theirs = rigid.tissue_force(state.rigid.ravel(), rows).reshape(-1, 3)
    ours = model.force_on_bodies(state, acceleration)
    assert relative(ours, theirs) <= 1e-12
    # The rows of free nodes, sliding ones among them.
    force = model.force(now, u, v)
    gradients = model.constraints.gradients(u)
    model.constraints.add_force(gradients, model.numbering.multipliers(state), force)
    mine = (force[:count] - model.mass[:count, :count] @ acceleration)[scene_free(scene)]
    assert relative(mine, -system.displacement(rows)[scene_free(scene)]) <= 1e-12


CONTACTS = {
    "barrier, plane": Contact(Plane((0.0, 0.0, -1e-3), (0.1, 0.0, 1.0)), "z0", Barrier(5e-3)),
    "barrier, moving ball": Contact(
        Sphere((0.015, 0.01, 0.05), 0.028), "z1", Barrier(5e-3), (Still(), Still(), Swing(1e-3, 5))
    ),
    "report's law, bowl": Contact(
        Sphere((0.015, 0.01, 0.098), 0.1, inside=True), law=ReportContact(range=8e-3)
    ),
    "report's palate": Contact(
        Plane((0.0, 0.0, 0.022), (0.0, 0.1, -1.0)), "boundary", ReportContact(1e9, 1.5, 2.0, 4e-3),
        (Still(), Swing(1e-3, 5), SmoothMove(1e-3)),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", CONTACTS)
def test_forces_and_tangents_of_contact_agree(name):
    from petsc4py import PETSc

    from dolfin_tongue.fenicsx import System
    from dolfin_tongue.fenicsx.arguments import Arguments, Shifts

    body = distort(block_body((0.03, 0.02, 0.02), (3, 2, 2)), 5e-4)
    scene = Scene(body, (CONTACTS[name],))
    model, system = Model(scene), System(scene, dynamic=True)
    rng = np.random.default_rng(3)
    u, v = 3e-4 * rng.uniform(-1, 1, body.points.shape), 0.1 * rng.uniform(-1, 1, body.points.shape)
    y, rate, now = system.vector(u), system.vector(v), Instant(0.03)
    at = Arguments(now, now.time, y, rate, 0 * y, y)
    out = np.zeros(system.size)
    system.residual(at, out)
    force = model.force(now, u, v)
    assert np.abs(force).max() > 1e-4
    assert relative(force, -system.displacement(out)) <= 1e-12
    matrix = system.new_matrix()
    way = rng.uniform(-1, 1, u.shape)
    for shift in (0.0, 130.0):
        system.jacobian(at, Shifts(shift, 0.0, 1.0), matrix)
        x = PETSc.Vec().createWithArray(system.vector(way))
        image = x.duplicate()
        matrix.mult(x, image)
        tangents = model.element_tangents(model.at(now, u, v), 1.0, shift)
        ours = apply_matrices(model, tangents, way)
        assert relative(ours, system.displacement(image.array_r)) <= 1e-12


def scene_free(scene: Scene) -> np.ndarray:
    """Numbers of the nodes that no bone carries."""
    return np.setdiff1d(np.arange(len(scene.body.points)), scene.held_nodes)


@pytest.mark.parametrize("make", [hinged_bone, carried_block])
def test_motions_converge_to_each_other(make):
    """At order 2: differences of nodes and coordinates fall to a quarter with half the step."""
    from dolfin_tongue.fenicsx import GeneralisedAlpha

    scene, steps, gaps = make(), (2e-3, 1e-3, 5e-4), []
    *_, fine = TrBdf2(1e-4, newton=1e-11).solver(scene).march(0.04)
    for dt in steps:
        *_, last = GeneralisedAlpha(dt).solver(scene).march(0.04)
        turn = 0.05 * np.abs(last.rigid[:, 2] - fine.rigid[:, 2]).max()
        gaps.append(max(float(np.abs(last.displacement - fine.displacement).max()), turn))
    assert min(orders(steps, gaps)) > 1.8, gaps
    assert gaps[-1] < 1e-3 * np.abs(fine.displacement).max()


@pytest.mark.parametrize("solver", ["fenicsx", "direct"])
def test_a_body_may_come_up_behind_the_rim_of_a_sheet(solver, tmp_path):
    """A block falls from above a wall's rim to behind the wall, as if it were not there."""
    from dolfin_tongue.app.pictures import read_table
    from dolfin_tongue.fenicsx import GeneralisedAlpha
    from dolfin_tongue.record.run import simulate
    from dolfin_tongue.surfaces import Triangulated

    body = block_body((0.02, 0.02, 0.02), (2, 2, 2))
    # The free side of the wall is away from the block, half a millimetre beside its face y1.
    x, z = np.meshgrid(np.linspace(-0.01, 0.03, 21), np.linspace(-0.03, -0.012, 10), indexing="ij")
    points = np.stack([x.ravel(), np.full(x.size, 0.0205), z.ravel()], axis=1)
    place = np.arange(x.size).reshape(x.shape)
    a, b, c, d = place[:-1, :-1], place[1:, :-1], place[1:, 1:], place[:-1, 1:]
    triangles = np.concatenate(
        [np.stack(t, axis=-1).reshape(-1, 3) for t in ((a, c, b), (a, d, c))]
    )
    wall = Triangulated(points, triangles, sheet=True, spacing=1e-3, band=6e-3, smoothing=0.0)
    gap = wall.gap(np.array([[0.01, 0.02, -0.02], [0.01, 0.021, -0.02], [0.01, 0.02, 0.0]]))
    assert gap.distance[0] < 0 < gap.distance[1] < gap.distance[2] == np.inf
    scene = Scene(body, (MooneyRivlin(), Viscosity(20.0), Gravity(), Contact(wall, "y1")))
    method = GeneralisedAlpha(5e-3) if solver == "fenicsx" else TrBdf2(5e-3)
    run = simulate(scene, 0.08, tmp_path, method)
    fallen = run.last.displacement[:, 2]
    assert np.abs(fallen + 0.5 * 9.81 * 0.08**2).max() < 1e-5
    table = read_table(tmp_path / "steps.csv")
    assert table["contact_gap_m"].min() > 0


def test_the_size_of_g_does_not_matter():
    """The same bowl as a function of another scale and unit, in both solvers; lambda is smaller."""
    from dolfin_tongue.fenicsx import GeneralisedAlpha

    body = moved_onto(block_body((0.02, 0.02, 0.02), (2, 2, 2)), BOWL, "z0")
    centre = np.asarray(BOWL.centre)
    other = Implicit(lambda x: 1e7 * (BOWL.radius**2 - ((x - centre) ** 2).sum(axis=1)))
    ends = []
    for surface in (BOWL, other):
        scene = Scene(body, (MooneyRivlin(), Gravity((3.0, 0.0, -9.0))), (Sliding(surface, "z0"),))
        for solver in (GeneralisedAlpha(5e-3).solver(scene), TrBdf2(5e-3).solver(scene)):
            *_, last = solver.march(0.03)
            places = (body.points + last.displacement)[body.nodes("z0")]
            assert np.abs(off_surface(surface, places)).max() <= 1e-9
            ends.append(last)
    for one, two in zip(ends[:2], ends[2:], strict=True):
        assert np.abs(one.displacement - two.displacement).max() < 1e-6
        slope = np.linalg.norm(other.gradient(body.points[:1]))
        assert np.abs(one.sliding).max() == pytest.approx(
            slope * np.abs(two.sliding).max(), rel=0.1
        )


@pytest.mark.parametrize("solver", ["fenicsx", "direct"])
def test_a_steady_push_creeps_through_the_reports_law(solver):
    """(60) has no force at rest: it slows the block and lets it pass, alike in both solvers."""
    from dolfin_tongue.fenicsx import GeneralisedAlpha

    body = block_body((0.02, 0.02, 0.01), (2, 2, 1))
    law = ReportContact(a1=3e6, range=5e-4)
    wall = Contact(Plane((0.0, 0.0, -3e-4)), "z0", law)
    scene = Scene(body, (MooneyRivlin(), Viscosity(20.0), Gravity(), wall))
    method = GeneralisedAlpha(4e-3) if solver == "fenicsx" else TrBdf2(4e-3)
    states = method.solver(scene).march(0.2)
    heights = [state.displacement[body.nodes("z0"), 2].mean() for state in states]
    assert heights[-1] < -3.2e-4  # behind the plane
    assert heights[-1] > -0.1 * 0.5 * 9.81 * 0.2**2  # far from free fall


def test_an_obstacle_between_the_nodes_is_noticed():
    """A wire under the middle of a face, which touches none of its nodes."""
    body = block_body((0.02, 0.02, 0.02), (1, 1, 1))
    wire = Cylinder((0.01, 0.0, -5e-4), (0.0, 1.0, 0.0), 1e-3)
    assert wire.gap(body.points).distance.min() > 5e-3
    with pytest.raises(
        BadScene, match=r"3 of 9 points .* behind the obstacle, the deepest by 0.0005"
    ):
        Scene(body, (MooneyRivlin(), Contact(wire, "z0")))
