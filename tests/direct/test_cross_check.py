"""Both solvers at the same random states: forces, mass, volumes, gradients, tangents.

The two sides share no code but the dataclasses of the terms. Everything agrees to round-off: 1e-12
of the largest entry, for sums of some hundred products.
"""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import subprocess
import sys

import numpy as np
import pytest
from cases import TERMS, apply_matrices, name_of, random_body, random_state, relative

import dolfin_tongue
from dolfin_tongue.boundary import Contact
from dolfin_tongue.constitutive import ReportTissue
from dolfin_tongue.control import Instant
from dolfin_tongue.direct import Model
from dolfin_tongue.direct.choice import LAWS, PARTS
from dolfin_tongue.scene.scene import Scene
from dolfin_tongue.terms.term import Term

pytest.importorskip("dolfinx")
TOLERANCE = 1e-12
NOW = Instant(0.03)


class BothSides:
    """One scene in both solvers at one state."""

    def __init__(self, term: Term, seed: int):
        from dolfin_tongue.fenicsx import System

        scene = Scene(random_body(seed), (term,))
        self.model = Model(scene)
        self.system = System(scene, dynamic=True)
        self.u, self.v = random_state(scene.body.points, seed)
        self.pressure = np.random.default_rng(seed).uniform(-2e3, 2e3, len(scene.body.cells))
        self.acceleration = np.random.default_rng(seed).uniform(-5, 5, self.u.shape)

    def at(self, pressure: bool = False, inertia: bool = False):
        """Arguments of the FEniCSx side, with pressures and inertia on request."""
        from dolfin_tongue.fenicsx.arguments import Arguments

        system = self.system
        state = system.vector(self.u, self.pressure if pressure else 0.0)
        acceleration = system.vector(self.acceleration if inertia else 0 * self.u)
        return Arguments(NOW, NOW.time, state, system.vector(self.v), acceleration, state)

    def residual(self, pressure: bool = False, inertia: bool = False) -> np.ndarray:
        """Mixed residual of the FEniCSx side."""
        out = np.zeros(self.system.size)
        self.system.residual(self.at(pressure, inertia), out)
        return out

    def tangent(self, pressure: bool, shift: float, du: np.ndarray, dp: np.ndarray) -> np.ndarray:
        """Product of the FEniCSx Jacobian (shift on the rate, 1 on the end state)."""
        from petsc4py import PETSc

        from dolfin_tongue.fenicsx.arguments import Shifts

        matrix = self.system.new_matrix()
        self.system.jacobian(self.at(pressure), Shifts(shift, 0.0, 1.0), matrix)
        x = PETSc.Vec().createWithArray(self.system.vector(du, dp))
        y = x.duplicate()
        matrix.mult(x, y)
        return y.array_r.copy()


@pytest.fixture(params=TERMS, ids=name_of)
def both(request) -> BothSides:
    """Each term in turn."""
    return BothSides(request.param, seed=TERMS.index(request.param))


def test_nodal_forces_agree(both):
    expected = -both.system.displacement(both.residual())
    assert relative(both.model.force(NOW, both.u, both.v), expected) <= TOLERANCE


def test_tangent_actions_agree(both):
    direction = np.random.default_rng(5).uniform(-1, 1, both.u.shape)
    zero = np.zeros(both.model.body.cell_count)
    for shift in (0.0, 130.0):
        image = both.tangent(False, shift, direction, zero)
        at = both.model.at(NOW, both.u, both.v)
        matrices = both.model.element_tangents(at, 1.0, shift)
        mine = apply_matrices(both.model, matrices, direction)
        expected = both.system.displacement(image)
        if np.abs(expected).max() == 0.0:
            assert np.abs(mine).max() == 0.0
        else:
            assert relative(mine, expected) <= TOLERANCE


@pytest.fixture(params=range(3))
def plain(request) -> BothSides:
    """Tissue alone, on several meshes."""
    return BothSides(ReportTissue(), seed=10 + request.param)


def test_masses_agree(plain):
    inertia = plain.residual(inertia=True) - plain.residual()
    expected = plain.system.displacement(inertia)
    assert relative(plain.model.mass @ plain.acceleration, expected) <= TOLERANCE


def test_volume_constraints_agree(plain):
    change, _ = plain.model.constraints.evaluate(plain.u)
    expected = -plain.system.numbering.cell_pressure(plain.residual())
    assert np.abs(change - expected).max() <= TOLERANCE * plain.model.body.volumes.max()


def test_constraint_gradients_and_pressure_forces_agree(plain):
    gradients = plain.model.constraints.gradients(plain.u)
    force = np.zeros_like(plain.u)
    plain.model.constraints.add_force(gradients, plain.pressure, force)
    expected = -plain.system.displacement(plain.residual(pressure=True) - plain.residual())
    assert relative(force, expected) <= TOLERANCE
    rate = plain.model.constraints.rate(gradients, plain.v)
    image = plain.tangent(False, 0.0, plain.v, np.zeros_like(plain.pressure))
    assert relative(rate, -plain.system.numbering.cell_pressure(image)) <= TOLERANCE


def test_volume_hessians_agree(plain):
    direction = np.random.default_rng(5).uniform(-1, 1, plain.u.shape)
    zero = np.zeros(plain.model.body.cell_count)
    with_pressure = plain.tangent(True, 0.0, direction, zero)
    without = plain.tangent(False, 0.0, direction, zero)
    count = 3 * plain.model.body.blocks[0].cells.shape[1]
    matrices = [np.zeros((plain.model.body.cell_count, count, count))]
    plain.model.constraints.add_hessians(plain.u, -plain.pressure, matrices)
    mine = apply_matrices(plain.model, matrices, direction)
    expected = plain.system.displacement(with_pressure - without)
    # The difference of two tangents loses the digits by which they exceed it.
    lost = np.abs(with_pressure).max() / np.abs(expected).max()
    assert relative(mine, expected) <= TOLERANCE * max(1.0, lost)


def test_curvature_is_the_hessian_in_the_velocity(plain):
    count = 3 * plain.model.body.blocks[0].cells.shape[1]
    curvature = plain.model.constraints.curvature(plain.u, plain.v)
    for cell in range(plain.model.body.cell_count):
        matrices = [np.zeros((plain.model.body.cell_count, count, count))]
        one = np.zeros(plain.model.body.cell_count)
        one[cell] = 1.0
        plain.model.constraints.add_hessians(plain.u, one, matrices)
        expected = np.sum(plain.v * apply_matrices(plain.model, matrices, plain.v))
        assert abs(curvature[cell] - expected) <= 1e-12 * np.abs(curvature).max()


def concrete_terms() -> set[type[Term]]:
    """Every concrete term class in the package."""
    found = set()
    for module in pkgutil.walk_packages(dolfin_tongue.__path__, "dolfin_tongue."):
        if module.name.endswith("__main__"):
            continue  # a command, which importing would run
        for _, item in inspect.getmembers(importlib.import_module(module.name), inspect.isclass):
            if issubclass(item, Term) and item is not Term and not inspect.isabstract(item):
                if item.__module__.startswith("dolfin_tongue"):
                    found.add(item)
    return found


def test_every_term_has_a_direct_counterpart_and_is_checked_here():
    terms = concrete_terms()
    assert terms, "no terms found"
    missing = {item.__name__ for item in terms - {*LAWS, *PARTS}}
    assert not missing, f"terms without a force in the direct solver: {missing}"
    unchecked = {item.__name__ for item in terms - {type(term) for term in TERMS} - {Contact}}
    # Contact: see test_cross_boundaries.py
    assert not unchecked, f"terms that the cross-check leaves out: {unchecked}"


#: What only the FEniCSx solver, its meshes and the pictures need.
LIBRARIES = (
    "ufl", "basix", "dolfinx", "ffcx", "petsc4py", "mpi4py", "gmsh", "pyvista", "vtkmodules"
)  # fmt: skip


def test_the_direct_solver_imports_no_finite_element_library():
    command = "import dolfin_tongue.direct, sys; print(*sys.modules)"
    run = subprocess.run(
        [sys.executable, "-c", command], capture_output=True, text=True, check=True
    )
    loaded = set(run.stdout.split())
    assert "dolfin_tongue.direct.tr_bdf2" in loaded
    assert not loaded & set(LIBRARIES)
