"""The Jacobian of a scene with everything: sliding nodes, two bones, two contacts, tissue."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dolfin_tongue.boundary import Barrier, Contact, Gravity, ReportContact, Sliding, moved_onto
from dolfin_tongue.constitutive import ReportTissue, Viscosity
from dolfin_tongue.control import Constant, Instant, Still, Swing
from dolfin_tongue.geometry.simple import block_body
from dolfin_tongue.rigid import AngularSpring, LineMuscle, RigidBody, Spring
from dolfin_tongue.scene.scene import Scene
from dolfin_tongue.surfaces import Plane, Sphere

pytest.importorskip("dolfinx")


def crowded_scene() -> Scene:
    """A block between two bones, one of them driven, that slides below and touches above."""
    body = block_body((0.03, 0.02, 0.02), (3, 2, 2))
    ends = np.concatenate([body.nodes("x0"), body.nodes("x1")])
    under = np.setdiff1d(body.nodes("z0"), ends)
    bowl = Sphere((0.015, 0.01, 0.1), 0.0995, inside=True)
    body = moved_onto(replace(body, node_sets={**body.node_sets, "under": under}), bowl, "under")
    spring = Spring((0.05, 0.0, 0.02), (0.08, 0.01, 0.03), stiffness=100.0, damping=0.3)
    pull = LineMuscle(
        (-0.01, 0.0, 0.01), (0.05, 0.0, 0.03), to="one", max_force=2.0, activation=Constant(0.4)
    )
    one = RigidBody(
        "one", ("x1",), 0.1, 1e-4, (0.05, 0.0, 0.02), (spring,), {"x": Swing(1e-3, 3.0)},
        (0.06, 0.0, 0.0),
    )  # fmt: skip
    two = RigidBody("two", ("x0",), 0.01, 1e-5, (-0.01, 0.0, 0.01), (pull, AngularSpring(0.1)))
    ball = Contact(Sphere((0.015, 0.01, 0.05), 0.0295), "z1", Barrier(range=2e-3))
    moving = (Still(), Still(), Swing(1e-3, 5.0))
    plate = Contact(
        Plane((0.0, 0.0, 0.021), (0.1, 0.0, -1.0)), "z1", ReportContact(range=3e-3), moving
    )
    terms = (ReportTissue(), Viscosity(30.0), Gravity(), ball, plate)
    return Scene(body, terms, (Sliding(bowl, "under"), one, two))


@pytest.mark.parametrize("pair", ["Q1/P0", "Q2/P1", "P2/P1"])
def test_jacobian_is_the_derivative_of_the_residual(pair):
    """Central differences at a random state, each kind of row by its own size."""
    from petsc4py import PETSc

    from dolfin_tongue.fenicsx import System
    from dolfin_tongue.fenicsx.arguments import Arguments, Shifts

    system = System(crowded_scene(), dynamic=True, pair=pair)
    rng = np.random.default_rng(0)
    unit = np.ones(system.size)
    unit[system.numbering.pressures], unit[system.sliding_dofs] = 1e6, 1e4
    sizes = np.array([1e-4, 0.02, 1.0, 1e-4])[:, None] * unit
    start = rng.standard_normal((4, system.size)) * sizes
    way, shifts = 1e-3 * unit * rng.standard_normal(system.size), (130.0, 170.0, 1.7)

    def arguments(step: float) -> Arguments:
        parts = [y + step * s * way for y, s in zip(start, (1.0, *shifts), strict=True)]
        return Arguments(Instant(0.1), 0.102, *parts)

    def residual(step: float) -> np.ndarray:
        out = np.zeros(system.size)
        system.residual(arguments(step), out)
        return out

    matrix = system.new_matrix()
    system.jacobian(arguments(0.0), Shifts(*shifts), matrix)
    image = PETSc.Vec().createSeq(system.size)
    matrix.mult(PETSc.Vec().createWithArray(way), image)
    h = 3e-5  # the error falls with h^2: 1e-7 here where a point of P2/P1 is deep in the barrier
    slope = (residual(h) - residual(-h)) / (2 * h)
    rows = (
        system.numbering.displacements, system.numbering.pressures,
        system.sliding_dofs, system.rigid_dofs,
    )  # fmt: skip
    for part in rows:
        assert np.abs(slope[part]).max() > 0
        assert np.abs(slope - image.array_r)[part].max() <= 1e-6 * np.abs(slope[part]).max()
