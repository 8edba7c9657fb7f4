"""Elements: kappa against the report's tables, volumes against finite differences, patches."""

from __future__ import annotations

import numpy as np
import pytest
from cases import (
    CENTIMETRE,
    body_model,
    body_of,
    distorted_element,
    element_model,
    mixed_body,
    random_state,
    relative,
)

from dolfin_tongue.base.errors import BadMesh, UnknownName
from dolfin_tongue.body.body import Body
from dolfin_tongue.body.cells import HEXAHEDRON8, KINDS
from dolfin_tongue.constitutive import ReportTissue
from dolfin_tongue.control import Instant
from dolfin_tongue.direct.volume import element_gradient, element_hessian, element_volume

NAMES = sorted(KINDS)

#: Tables (98), (99) of the report: rows K, L, M; nodes counted from 1.
POSITIVE = """1 1 1 2 2 3 3 4 5 5 5 6
              2 2 5 3 3 4 4 5 6 6 7 7
              5 6 8 6 7 7 8 8 7 8 8 8"""
NEGATIVE = """1 1 1 1 1 1 2 2 2 3 3 4
              2 2 3 4 4 5 3 5 6 6 7 7
              3 4 4 5 8 6 4 6 7 7 8 8"""


def table(text: str) -> np.ndarray:
    """Index triples of a printed table, counted from 0, shape (12, 3)."""
    return np.array([line.split() for line in text.splitlines()], dtype=int).T - 1


def test_kappa_of_the_brick_is_the_report_s_table():
    expected = np.zeros((8, 8, 8))
    for triples, value in ((table(POSITIVE), 1 / 12), (table(NEGATIVE), -1 / 12)):
        for k, m, n in triples:
            for a, b, c in ((k, m, n), (m, n, k), (n, k, m)):
                expected[a, b, c], expected[b, a, c] = value, -value
    np.testing.assert_allclose(HEXAHEDRON8.kappa, expected, rtol=0, atol=1e-15)


@pytest.mark.parametrize("name", NAMES)
def test_kappa_is_antisymmetric_and_does_not_see_shifts(name):
    kappa = KINDS[name].kappa
    np.testing.assert_allclose(kappa, -kappa.transpose(1, 0, 2), atol=1e-14)
    np.testing.assert_allclose(kappa, kappa.transpose(1, 2, 0), atol=1e-14)
    np.testing.assert_allclose(kappa.sum(axis=0), 0.0, atol=1e-13)


@pytest.mark.parametrize("name", NAMES)
def test_kappa_does_not_depend_on_node_positions(name):
    kind, corners = KINDS[name], distorted_element(name)
    gradient, weights = kind.reference_gradients(corners[None])
    wedge = np.cross(gradient[0][:, :, None], gradient[0][:, None])
    kappa = np.einsum("q,qKi,qLMi->KLM", weights[0], gradient[0], wedge)
    np.testing.assert_allclose(kappa, kind.kappa, atol=1e-13)


@pytest.mark.parametrize("name", NAMES)
def test_shape_functions(name):
    kind = KINDS[name]
    np.testing.assert_allclose(kind.shapes(kind.nodes), np.eye(kind.node_count), atol=1e-14)
    points = 0.3 * np.random.default_rng(1).uniform(size=(5, 3))
    np.testing.assert_allclose(kind.shapes(points).sum(axis=1), 1.0, rtol=1e-14)
    step = 1e-6
    for axis in range(3):
        shift = step * np.eye(3)[axis]
        difference = (kind.shapes(points + shift) - kind.shapes(points - shift)) / (2 * step)
        np.testing.assert_allclose(kind.gradients(points)[..., axis], difference, atol=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_a_linear_field_has_its_gradient(name):
    kind, corners = KINDS[name], distorted_element(name)
    gradient, weights = kind.reference_gradients(corners[None])
    identity = np.einsum("ki,mqkj->mqij", corners, gradient)
    np.testing.assert_allclose(identity, np.broadcast_to(np.eye(3), identity.shape), atol=1e-12)
    np.testing.assert_allclose(weights.sum(), element_volume(kind, corners), rtol=1e-13)


@pytest.mark.parametrize("name", NAMES)
def test_the_rule_integrates_the_volume_exactly(name):
    kind, corners = KINDS[name], distorted_element(name)
    points, weights = np.polynomial.legendre.leggauss(6)
    points, weights = (points + 1) / 2, weights / 2
    total = 0.0
    for x, wx in zip(points, weights, strict=True):
        for y, wy in zip(points, weights, strict=True):
            for z, wz in zip(points, weights, strict=True):
                xi, scale = _to_master(name, x, y, z)
                jacobian = corners.T @ kind.gradients(xi[None])[0]
                total += wx * wy * wz * scale * np.linalg.det(jacobian)
    np.testing.assert_allclose(element_volume(kind, corners), total, rtol=1e-12)


def _to_master(name: str, x: float, y: float, z: float) -> tuple[np.ndarray, float]:
    """Point of the master element from the unit cube (collapsed for simplices), its factor."""
    if name.startswith("hexahedron"):
        return 2 * np.array([x, y, z]) - 1, 8.0
    if name == "prism6":
        return np.array([x, y * (1 - x), 2 * z - 1]), 2 * (1 - x)
    return np.array([x, y * (1 - x), z * (1 - x) * (1 - y)]), (1 - x) ** 2 * (1 - y)


@pytest.mark.parametrize("name", NAMES)
def test_volume_gradient_and_hessian_against_finite_differences(name):
    kind, corners = KINDS[name], distorted_element(name)
    gradient, hessian = element_gradient(kind, corners), element_hessian(kind, corners)
    # The volume is cubic: central differences of a step h err by h^2, of its gradient by nothing.
    step = 1e-4 * CENTIMETRE
    for node in range(kind.node_count):
        for i in range(3):
            shift = np.zeros_like(corners)
            shift[node, i] = step
            up, down = corners + shift, corners - shift
            slope = (element_volume(kind, up) - element_volume(kind, down)) / (2 * step)
            assert abs(slope - gradient[node, i]) <= 1e-7 * np.abs(gradient).max()
            row = (element_gradient(kind, up) - element_gradient(kind, down)) / (2 * step)
            assert np.abs(row - hessian[node, i]).max() <= 1e-9 * np.abs(hessian).max()


@pytest.mark.parametrize("name", NAMES)
def test_mass_of_an_element(name):
    kind = KINDS[name]
    corners = CENTIMETRE * kind.nodes @ np.array([[1.0, 0.2, 0], [0, 1.1, 0.3], [0.1, 0, 0.9]])
    mass = kind.masses(corners[None], 1040.0)[0]
    volume = element_volume(kind, corners)
    np.testing.assert_allclose(mass.sum(), 1040.0 * volume, rtol=1e-13)
    assert np.linalg.eigvalsh(mass).min() > 0
    # Kinetic energy of a linear velocity field: the moments of inertia are exact.
    x = corners - corners.mean(axis=0)
    exact = _second_moment(name, corners)
    np.testing.assert_allclose(x.T @ mass @ x / 1040.0, exact, atol=1e-12 * exact.max())


def _second_moment(name: str, corners: np.ndarray) -> np.ndarray:
    """Integral of x x^T over an affine element, from a fine rule on the master element."""
    kind = KINDS[name]
    points, weights = np.polynomial.legendre.leggauss(5)
    points, weights = (points + 1) / 2, weights / 2
    total = np.zeros((3, 3))
    for i, j, k in np.ndindex(5, 5, 5):
        xi, scale = _to_master(name, points[i], points[j], points[k])
        x = kind.shapes(xi[None])[0] @ (corners - corners.mean(axis=0))
        volume = np.linalg.det(corners.T @ kind.gradients(xi[None])[0])
        total += weights[i] * weights[j] * weights[k] * scale * volume * np.outer(x, x)
    return total


@pytest.mark.parametrize("mass", ["consistent", "lumped"])
def test_lumped_mass_is_positive_and_complete(mass):
    corners = distorted_element("hexahedron20")
    matrix = element_model("hexahedron20", ReportTissue(), mass=mass).mass
    volume = element_volume(KINDS["hexahedron20"], corners)
    np.testing.assert_allclose(matrix.sum(), 1000.0 * volume, rtol=1e-12)
    assert matrix.diagonal().min() > 0
    assert (matrix.nnz == 20) == (mass == "lumped")


def test_mixed_mesh_volume_and_gradient():
    model = body_model(mixed_body(0.1), ReportTissue())
    displacement, _ = random_state(model.body.points)
    change, gradients = model.constraints.evaluate(displacement)
    volumes = body_of(model.body.points + displacement, model.body.cells).volumes
    np.testing.assert_allclose(change, volumes - model.body.volumes, atol=1e-12 * volumes.max())
    # A conforming mesh: the volumes add up to a function of the surface, inner nodes have no part.
    total = np.zeros_like(displacement)
    model.constraints.add_force(gradients, np.ones(model.body.cell_count), total)
    np.testing.assert_allclose(total.sum(axis=0), 0.0, atol=1e-15)


def test_patch_of_mixed_elements_is_in_equilibrium():
    points = inner_node_body().points
    model = body_model(inner_node_body(), ReportTissue())
    gradient = np.array([[0.1, 0.2, 0.0], [0.0, -0.1, 0.1], [0.05, 0.0, 0.15]])
    force = model.force(Instant(0.0), points @ gradient.T, np.zeros_like(points))
    assert np.abs(force[-1]).max() <= 1e-13 * np.abs(force).max()
    np.testing.assert_allclose(force.sum(axis=0), 0.0, atol=1e-13 * np.abs(force).max())


def inner_node_body() -> Body:
    """Four tetrahedra around an inner node, and a prism on one outer face."""
    corner = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
    below = corner[[0, 1, 2]] - [0.1, 0.0, 0.8]
    points = np.concatenate([corner, below, [[0.3, 0.2, 0.25]]])
    tetrahedra = np.array([[7, 1, 2, 3], [0, 7, 2, 3], [0, 1, 7, 3], [0, 1, 2, 7]])
    return body_of(
        CENTIMETRE * points,
        {"tetrahedron4": tetrahedra, "prism6": np.array([[4, 5, 6, 0, 1, 2]])},
    )


def test_wrong_cells_are_refused():
    points, cells = CENTIMETRE * HEXAHEDRON8.nodes, np.arange(8)[None]
    with pytest.raises(UnknownName, match=r"unknown kind of cells 'hexahedron'.*hexahedron20"):
        Body(points, {"hexahedron": cells})
    with pytest.raises(BadMesh, match=r"cells of hexahedron8 must have shape \(m, 8\)"):
        Body(points, {"hexahedron8": cells[:, :6]})
    with pytest.raises(BadMesh, match=r"node\(s\) 8 belong to no cell"):
        Body(np.concatenate([points, [[0.05, 0.05, 0.05]]]), {"hexahedron8": cells})
    with pytest.raises(BadMesh, match=r"inverted hexahedron8 cell\(s\).*: 0"):
        Body(points, {"hexahedron8": cells[:, [0, 3, 2, 1, 4, 7, 6, 5]]})


def test_relative_is_a_measure_of_error():
    assert relative(np.array([1.0, 2.0]), np.array([1.0, 4.0])) == 0.5
