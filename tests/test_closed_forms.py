"""Stresses, pressure, volumes and inertia against closed forms and node positions."""

import numpy as np
import pytest
from term_cases import MUSCLES, TERMS, arguments, random_states, residual, system_of

from dolfin_tongue.body.shape import volume_changes, volume_ratios
from dolfin_tongue.boundary import Attached
from dolfin_tongue.constitutive import (
    ActiveMuscles,
    ConstantFibreStress,
    MooneyRivlin,
    ReportTissue,
    Viscosity,
)
from dolfin_tongue.control import Constant
from dolfin_tongue.fenicsx import System
from dolfin_tongue.fenicsx.compile import compile_expression
from dolfin_tongue.geometry.simple import block_body
from dolfin_tongue.scene.scene import Scene


def homogeneous(system, F):
    """Mixed state with the deformation gradient F everywhere."""
    body = system.scene.body
    return system.vector(body.points @ (F - np.eye(3)).T)


def cauchy(term, F):
    """Mean first Piola-Kirchhoff stress times F^T / J of a term under homogeneous deformation."""
    system = System(Scene(block_body((1.0, 1.0, 1.0), (1, 1, 1), muscles=MUSCLES), (term,)), True)
    y = homogeneous(system, F)
    force = system.displacement(residual(system, y))
    # sum over nodes of f x X is the volume integral of P
    piola = np.einsum("ki,kj->ij", force, system.scene.body.points)
    return piola @ F.T / np.linalg.det(F)


def deviator(T):
    return T - np.trace(T) / 3 * np.eye(3)


@pytest.mark.parametrize("stretch", [0.7, 0.9, 1.2, 1.5])
def test_uniaxial_closed_form(stretch):
    """Simple stretch at constant volume: stress differences from W as a function of the stretch.

    For isochoric uniaxial stretch, T11 - T22 = stretch dW/dstretch.
    """
    F = np.diag([stretch, stretch**-0.5, stretch**-0.5])

    def report(s):
        e1, e2 = (s**2 - 1) / 2, (1 / s - 1) / 2
        j1 = e1 + 2 * e2
        j2 = (e1**2 + 2 * e2**2 - j1**2) / 2
        return 500 * (np.exp(3 * j1**2 + 6 * j2) - 1)

    def yeoh(s):
        i1 = s**2 + 2 / s
        return 1037 * (i1 - 3) + 486 * (i1 - 3) ** 2

    for term, energy in ((ReportTissue(), report), (MooneyRivlin(), yeoh)):
        T = cauchy(term, F)
        h = 1e-6
        expected = stretch * (energy(stretch + h) - energy(stretch - h)) / (2 * h)
        assert T[0, 0] - T[1, 1] == pytest.approx(expected, rel=1e-7)


@pytest.mark.parametrize(("stretch", "shear"), [(1.0, 0.3), (0.8, -0.4), (1.3, 0.2)])
def test_plane_stretch_and_shear(stretch, shear):
    """Deformation (72) of fig. 4: S of the report by hand, (70), (71), and its deviator (36)."""
    C = np.array([[stretch**2, stretch * shear, 0], [stretch * shear, 1 / stretch + shear**2, 0],
                  [0, 0, 1 / stretch]])  # fmt: skip
    assert np.linalg.det(C) == pytest.approx(1.0)
    F = np.array([[stretch, shear, 0], [0, stretch**-0.5, 0], [0, 0, stretch**-0.5]])
    assert pytest.approx(C) == F.T @ F
    E = (C - np.eye(3)) / 2
    j1 = np.trace(E)
    j2 = (np.sum(E * E) - j1**2) / 2
    W = 500 * np.exp(3 * j1**2 + 6 * j2)
    S = W * (6 * j1 * np.eye(3) + 6 * (E - j1 * np.eye(3)))
    T = F @ S @ F.T
    assert cauchy(ReportTissue(), F) == pytest.approx(deviator(T), abs=1e-9 * np.abs(T).max())


def test_shear_modulus_at_rest():
    """a0 a2 / 2 = 1.5 kPa for the report's constants, 2 c10 for the published tongue."""
    g = 1e-6
    F = np.eye(3)
    F[0, 1] = g
    assert cauchy(ReportTissue(), F)[0, 1] / g == pytest.approx(1500, rel=1e-5)
    assert cauchy(MooneyRivlin(), F)[0, 1] / g == pytest.approx(2 * 1037, rel=1e-5)


def test_active_stress_is_tensile_along_the_fibre():
    """T = tau n x n with n = F N / stretch (31), (32), up to its spherical part."""
    F = np.array([[0.9, 0.1, 0.0], [0.05, 1.05, 0.2], [0.0, -0.1, 1.1]])
    F /= np.linalg.det(F) ** (1 / 3)
    term = ActiveMuscles({"across": Constant(0.5)}, 30e3)
    along = F @ np.array(MUSCLES["across"])
    stretch = np.linalg.norm(along)
    n = along / stretch
    tau = 30e3 * 0.5 * term.law.length_factor(stretch) * 0.7  # g(0) = y0
    assert cauchy(term, F) == pytest.approx(deviator(tau * np.outer(n, n)), rel=1e-9, abs=1e-6)


def test_constant_fibre_stress_is_what_it_says():
    """T = T0 (F N) x (F N) / J, spherical part included."""
    F = np.array([[0.9, 0.1, 0.0], [0.05, 1.05, 0.2], [0.0, -0.1, 1.1]])
    along = F @ np.array(MUSCLES["across"])
    term = ConstantFibreStress({"across": Constant(0.5)}, 30e3)
    expected = 15e3 * np.outer(along, along) / np.linalg.det(F)
    assert cauchy(term, F) == pytest.approx(expected, rel=1e-9, abs=1e-6)


def test_static_active_stress_is_that_of_a_standing_muscle():
    """Without rates the force-velocity factor is g(0) = y0, as in dynamics at rest."""
    body = block_body((0.03, 0.02, 0.02), (2, 2, 1), muscles=MUSCLES)
    scene = Scene(body, (TERMS["report"], TERMS["active"]), (Attached("x0"),))
    dynamic, static = System(scene, True), System(scene, False)
    y, _, _ = random_states(dynamic)
    first = residual(dynamic, y)
    pressure = dynamic.numbering.cell_pressure(y)
    second = residual(static, static.vector(dynamic.displacement(y), pressure))
    a, b = dynamic.displacement(first), static.displacement(second)
    assert np.abs(a - b).max() <= 1e-12 * np.abs(a).max()


def test_viscous_stress():
    """Cauchy stress 2 eta D for a shear flow of rate g."""
    term = Viscosity(10.0)
    system = System(Scene(block_body((1.0, 1.0, 1.0), (1, 1, 1)), (term,)), True)
    y = system.vector(np.zeros_like(system.scene.body.points))
    L = np.zeros((3, 3))
    L[0, 2] = 4.0
    v = system.vector(system.scene.body.points @ L.T)
    force = system.displacement(residual(system, y, v))
    stress = np.einsum("ki,kj->ij", force, system.scene.body.points)
    assert stress == pytest.approx(10.0 * (L + L.T), abs=1e-9)


def test_pressure_is_positive_in_compression():
    """A pressure pushes outwards: its virtual power of an expansion is negative internal power."""
    system = System(Scene(block_body((1.0, 1.0, 1.0), (1, 1, 1)), (ReportTissue(),)), True)
    y = system.vector(np.zeros_like(system.scene.body.points), 1.0)
    force = system.displacement(residual(system, y))
    stress = np.einsum("ki,kj->ij", force, system.scene.body.points)
    assert stress == pytest.approx(-np.eye(3), abs=1e-12)


def test_volume_rows_are_the_volume_changes():
    """Rows of p give minus the volume change of each cell (91), here from the node positions."""
    system = system_of("report")
    y, v, a = random_states(system)
    change = system.volume_change(residual(system, y, v, a))
    body = system.scene.body
    expected = volume_changes(body, system.displacement(y))
    assert np.abs(expected).max() > 1e-3
    assert change == pytest.approx(expected, rel=1e-10, abs=1e-13)


def test_det_f_by_ufl_is_that_of_the_node_positions():
    system = system_of("report")
    y, v, _ = random_states(system)
    body, block = system.scene.body, system.volume
    block.set_all(arguments(y, v))
    points = (body.blocks[0].kind.rule.points + 1) / 2  # from [-1, 1]^3 to the unit cube
    cells = np.arange(body.cell_count)
    found = compile_expression(block.kin.J, points).eval(block.domain.mesh, cells)
    ratios = np.empty_like(found)
    ratios[block.domain.owners] = found  # in the order of the body
    (expected,) = volume_ratios(body, system.displacement(y))
    assert ratios == pytest.approx(expected, rel=1e-10)


def test_inertia_is_the_consistent_mass():
    """M a for a constant acceleration sums up to the mass of the body (40)."""
    system = system_of("report")
    zero = system.vector(np.zeros_like(system.scene.body.points))
    a = system.vector(np.tile([0.0, 0.0, 2.0], (len(system.scene.body.points), 1)))
    force = system.displacement(residual(system, zero, zero, a)).sum(axis=0)
    assert force == pytest.approx([0, 0, 2 * system.scene.body.mass], abs=1e-12)
