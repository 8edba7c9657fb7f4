"""Both solvers at the same random states: forces, mass, volumes, gradients, tangents.

The two sides share no code but the dataclasses of the terms. Everything agrees to round-off: 1e-12
of the largest entry, for sums of some hundred products.
"""

from __future__ import annotations

import importlib
import inspect
import pkgutil

import numpy as np
import pytest
from cases import TERMS, apply_matrices, name_of, random_body, random_state, relative

import dolfin_tongue
from dolfin_tongue.boundary import Contact
from dolfin_tongue.constitutive import ReportTissue
from dolfin_tongue.direct import Model, problem_of
from dolfin_tongue.direct.forces import CONTACTS, LAWS, LOADS, MEMBRANES
from dolfin_tongue.scene.scene import Scene
from dolfin_tongue.terms.term import Term

pytest.importorskip("dolfinx")
TOLERANCE = 1e-12
TIME = 0.03


class BothSides:
    """One scene in both solvers at one state."""

    def __init__(self, term: Term, seed: int):
        from dolfin_tongue.fenicsx.system import System

        scene = Scene(random_body(seed), (term,))
        self.model = Model(problem_of(scene))
        self.system = System(scene, dynamic=True)
        self.u, self.v = random_state(scene.body.points, seed)
        self.pressure = np.random.default_rng(seed).uniform(-2e3, 2e3, len(scene.body.cells))
        self.acceleration = np.random.default_rng(seed).uniform(-5, 5, self.u.shape)

    def residual(self, pressure: bool = False, inertia: bool = False) -> np.ndarray:
        """Mixed residual of the FEniCSx side, with pressures and inertia on request."""
        system = self.system
        state = system.mixed(self.u, self.pressure if pressure else 0.0)
        acceleration = system.mixed(self.acceleration if inertia else 0 * self.u)
        system.set_state(TIME, state, system.mixed(self.v), acceleration, state)
        out = np.zeros(system.space.size)
        system.residual(TIME, out)
        return out

    def tangent(self, pressure: bool, shift: float, du: np.ndarray, dp: np.ndarray) -> np.ndarray:
        """Product of the FEniCSx Jacobian (shift on the rate, 1 on the end state)."""
        from petsc4py import PETSc

        self.residual(pressure)
        matrix = self.system.new_matrix()
        self.system.jacobian(matrix, (shift, 0.0, 1.0))
        x = PETSc.Vec().createWithArray(self.system.mixed(du, dp))
        y = x.duplicate()
        matrix.mult(x, y)
        return y.array_r.copy()


@pytest.fixture(params=TERMS, ids=name_of)
def both(request) -> BothSides:
    """Each term in turn."""
    return BothSides(request.param, seed=TERMS.index(request.param))


def test_nodal_forces_agree(both):
    expected = -both.system.displacement(both.residual())
    assert relative(both.model.force(TIME, both.u, both.v), expected) <= TOLERANCE


def test_tangent_actions_agree(both):
    direction = np.random.default_rng(5).uniform(-1, 1, both.u.shape)
    zero = np.zeros(both.model.cell_count)
    for shift in (0.0, 130.0):
        image = both.tangent(False, shift, direction, zero)
        matrices = both.model.element_tangents(TIME, both.u, both.v, 1.0, shift)
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
    change, _ = plain.model.constraint(plain.u)
    expected = -plain.system.pressure(plain.residual())
    assert np.abs(change - expected).max() <= TOLERANCE * plain.model.rest_volumes.max()


def test_constraint_gradients_and_pressure_forces_agree(plain):
    gradients = plain.model.volume_gradients(plain.u)
    force = np.zeros_like(plain.u)
    plain.model.add_constraint_force(gradients, plain.pressure, force)
    expected = -plain.system.displacement(plain.residual(pressure=True) - plain.residual())
    assert relative(force, expected) <= TOLERANCE
    rate = plain.model.constraint_rate(gradients, plain.v)
    image = plain.tangent(False, 0.0, plain.v, np.zeros_like(plain.pressure))
    assert relative(rate, -plain.system.pressure(image)) <= TOLERANCE


def test_volume_hessians_agree(plain):
    direction = np.random.default_rng(5).uniform(-1, 1, plain.u.shape)
    zero = np.zeros(plain.model.cell_count)
    with_pressure = plain.tangent(True, 0.0, direction, zero)
    without = plain.tangent(False, 0.0, direction, zero)
    count = 3 * plain.model.blocks[0].cells.shape[1]
    matrices = [np.zeros((plain.model.cell_count, count, count))]
    plain.model.add_constraint_hessians(plain.u, -plain.pressure, matrices)
    mine = apply_matrices(plain.model, matrices, direction)
    expected = plain.system.displacement(with_pressure - without)
    # The difference of two tangents loses the digits by which they exceed it.
    lost = np.abs(with_pressure).max() / np.abs(expected).max()
    assert relative(mine, expected) <= TOLERANCE * max(1.0, lost)


def test_curvature_is_the_hessian_in_the_velocity(plain):
    count = 3 * plain.model.blocks[0].cells.shape[1]
    curvature = plain.model.constraint_curvature(plain.u, plain.v)
    for cell in range(plain.model.cell_count):
        matrices = [np.zeros((plain.model.cell_count, count, count))]
        one = np.zeros(plain.model.cell_count)
        one[cell] = 1.0
        plain.model.add_constraint_hessians(plain.u, one, matrices)
        expected = np.sum(plain.v * apply_matrices(plain.model, matrices, plain.v))
        assert abs(curvature[cell] - expected) <= 1e-12 * np.abs(curvature).max()


def concrete_terms() -> set[type[Term]]:
    """Every concrete term class in the package."""
    found = set()
    for module in pkgutil.walk_packages(dolfin_tongue.__path__, "dolfin_tongue."):
        if module.name.endswith("__main__"):
            continue  # a command, which importing would run
        for _, item in inspect.getmembers(importlib.import_module(module.name), inspect.isclass):
            if issubclass(item, Term) and not inspect.isabstract(item):
                if item.__module__.startswith("dolfin_tongue"):
                    found.add(item)
    return found


def test_every_term_has_a_direct_counterpart_and_is_checked_here():
    terms = concrete_terms()
    assert terms, "no terms found"
    missing = {item.__name__ for item in terms - {*LAWS, *LOADS, *MEMBRANES, *CONTACTS}}
    assert not missing, f"terms without a force in the direct solver: {missing}"
    unchecked = {item.__name__ for item in terms - {type(term) for term in TERMS} - {Contact}}
    # Contact: see test_cross_boundaries.py
    assert not unchecked, f"terms that the cross-check leaves out: {unchecked}"


def test_the_direct_solver_imports_no_finite_element_library():
    import dolfin_tongue.direct as package

    for module in pkgutil.walk_packages(package.__path__, "dolfin_tongue.direct."):
        source = inspect.getsource(importlib.import_module(module.name))
        for library in ("ufl", "basix", "dolfinx", "petsc4py"):
            assert f"import {library}" not in source and f"from {library}" not in source
