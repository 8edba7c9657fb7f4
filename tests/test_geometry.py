"""Unit block, Bezier solid, fibres along a bar, boxes.

What carries the weight: the Jacobian (66) against finite differences (its printed sign is wrong)
and the parents of refined cells (muscles hang on them).
"""

import gmsh
import numpy as np
import pytest

from dolfin_tongue.base.errors import BadMesh, OutOfRange
from dolfin_tongue.body.block import blocks_of
from dolfin_tongue.geometry.bezier import BezierSolid, bernstein
from dolfin_tongue.geometry.block import DIVISIONS, unit_block
from dolfin_tongue.geometry.muscles import fibre_length, mesh_cross_section
from dolfin_tongue.geometry.preliminary import default_control_points
from dolfin_tongue.geometry.simple import block_body, distort, surface_nodes


def lattice_control_points(shape: tuple[int, int, int]) -> np.ndarray:
    """Control points at even distances: the solid is then the unit cube itself."""
    axes = [np.linspace(0.0, 1.0, count) for count in shape]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)


@pytest.fixture
def rst() -> np.ndarray:
    return np.random.default_rng(3).uniform(size=(20, 3))


# Bezier solid


@pytest.mark.parametrize("degree", [0, 1, 5])
def test_bernstein_is_a_partition_of_unity(degree):
    t = np.linspace(0.0, 1.0, 11)
    values = bernstein(degree, t)
    assert values.shape == (11, degree + 1)
    assert (values >= 0).all()
    np.testing.assert_allclose(values.sum(axis=1), 1.0, rtol=1e-14)
    np.testing.assert_allclose(values[[0, -1]], np.eye(degree + 1)[[0, -1]])


def test_even_control_points_give_the_identity(rst):
    solid = BezierSolid(lattice_control_points((6, 4, 3)))
    np.testing.assert_allclose(solid.map(rst), rst, atol=1e-14)
    np.testing.assert_allclose(solid.jacobian(rst), np.tile(np.eye(3), (20, 1, 1)), atol=1e-13)


def test_jacobian_agrees_with_finite_differences(rst):
    random = np.random.default_rng(5).normal(size=(6, 4, 3, 3))
    solid, step = BezierSolid(lattice_control_points((6, 4, 3)) + 0.1 * random), 1e-6
    inside = 0.01 + 0.98 * rst
    for axis in range(3):
        shift = step * np.eye(3)[axis]
        difference = (solid.map(inside + shift) - solid.map(inside - shift)) / (2 * step)
        # truncation step**2 and rounding 1e-16 / step: both below 1e-9
        np.testing.assert_allclose(solid.jacobian(inside)[:, :, axis], difference, atol=1e-8)


def test_fibres_follow_material_lines(rst):
    solid = BezierSolid(default_control_points())
    inside, direction = 0.01 + 0.98 * rst, np.tile([0.3, -0.2, 0.5], (20, 1))
    chord = solid.map(inside + 1e-6 * direction) - solid.map(inside)
    pushed = solid.push_forward(inside, direction)
    np.testing.assert_allclose(np.linalg.norm(pushed, axis=1), 1.0, rtol=1e-14)
    np.testing.assert_allclose(
        pushed, chord / np.linalg.norm(chord, axis=1, keepdims=True), atol=1e-4
    )


@pytest.mark.parametrize("shape", [(6, 4, 3), (6, 4, 1, 3), (6, 4, 3, 2)])
def test_wrong_control_points_are_refused(shape):
    with pytest.raises(BadMesh, match="control points must have shape"):
        BezierSolid(np.zeros(shape))


def test_zero_direction_is_refused(rst):
    with pytest.raises(BadMesh, match="direction in the block is zero"):
        BezierSolid(lattice_control_points((2, 2, 2))).push_forward(rst, np.zeros((20, 3)))


# unit block


@pytest.mark.parametrize("refinement", [1, 2, (2, 1, 3)])
def test_block_fills_the_unit_cube(refinement):
    block = unit_block(refinement)
    counts = np.multiply(DIVISIONS, refinement)
    assert len(block.cells) == counts.prod()
    assert len(block.rst) == (counts + 1).prod()
    (cells,) = blocks_of(block.rst, {"hexahedron8": block.cells})
    np.testing.assert_allclose(cells.weights * 8, 1.0 / counts.prod(), rtol=1e-10)


def test_parents_are_where_their_cells_are():
    block = unit_block((2, 3, 1))
    np.testing.assert_array_equal(np.floor(block.centres * DIVISIONS), block.parents)
    _, count = np.unique(block.parents, axis=0, return_counts=True)
    assert count.tolist() == [6] * 42


def test_regions_are_physical_groups_of_any_dimension():
    regions = {
        "face": [((0, 0), (0, 3), (0, 2))],
        "edges": [((1, 2), (j, j), (2, 2)) for j in (0, 3)],
        "corner": [((7, 7), (0, 0), (0, 0))],
    }
    block = unit_block(2, regions)
    np.testing.assert_array_equal(block.regions["face"], np.flatnonzero(block.rst[:, 0] == 0))
    assert len(block.regions["edges"]) == 2 * 3
    assert block.regions["corner"].tolist() == [block.node_at((1, 0, 0))]


def test_a_region_needs_one_dimension_inside_the_block():
    for boxes in ([((0, 8), (0, 0), (0, 0))], [((0, 1),) * 3, ((0, 0),) * 3]):
        with pytest.raises(BadMesh, match="region 'wrong'"):
            unit_block(1, {"wrong": boxes})
    assert not gmsh.isInitialized()


@pytest.mark.parametrize("refinement", [0, -1, 1.5, (1, 0, 1), (1, 2)])
def test_refinement_must_be_whole_and_positive(refinement):
    with pytest.raises(OutOfRange, match="refinement"):
        unit_block(refinement)


def test_a_running_gmsh_session_is_left_alone(capfd):
    gmsh.initialize(["-noenv"], readConfigFiles=False)
    try:
        gmsh.model.add("mine")
        loud = gmsh.option.getNumber("General.Terminal")
        unit_block(1)
        assert gmsh.model.getCurrent() == "mine"
        assert "unit_block" not in gmsh.model.list()
        assert gmsh.option.getNumber("General.Terminal") == loud
    finally:
        gmsh.finalize()
    unit_block(1)
    assert not gmsh.isInitialized()
    assert capfd.readouterr().out == ""


# muscles


def test_density_of_a_brick_muscle_in_closed_form():
    """Fibres along a straight bar: cross-section and length are those of the bar."""
    scale = np.array([0.07, 0.03, 0.02])
    solid = BezierSolid(lattice_control_points((2, 2, 2)) * scale)
    volumes = {(i, j, k): 1e-6 for i in range(7) for j in range(3) for k in range(2)}
    steps = {(i, 1, 0): np.array([1.0, 0.0, 0.0]) for i in range(2, 6)}
    assert fibre_length((3, 1, 0), steps, solid) == pytest.approx(0.04, rel=1e-12)
    shares = dict.fromkeys(steps, 1.0)
    assert mesh_cross_section(steps, shares, solid, volumes) == pytest.approx(1e-4, rel=1e-12)
    oblique = {(i, 1, k): np.array([1.0, 0.0, 1.0]) for i in range(2, 6) for k in range(2)}
    assert fibre_length((3, 1, 0), oblique, solid) == pytest.approx(0.02 * 2**0.5, rel=1e-12)


# boxes


def test_box():
    body = block_body((0.3, 0.2, 0.1), (3, 2, 4), muscles={"along": (2, 0, 0)}, density=1000.0)
    assert body.points.shape == (4 * 3 * 5, 3)
    assert body.volumes.sum() == pytest.approx(0.006, rel=1e-12)
    assert body.scaled_jacobians.min() == pytest.approx(1.0, rel=1e-12)
    assert {name: len(nodes) for name, nodes in body.node_sets.items()} == {
        "x0": 15, "x1": 15, "y0": 20, "y1": 20, "z0": 12, "z1": 12,
    }  # fmt: skip
    np.testing.assert_allclose(body.points[body.nodes("y1")][:, 1], 0.2)
    np.testing.assert_allclose(body.points[body.landmark("end")], [0.3, 0.1, 0.05])
    np.testing.assert_array_equal(body.fibres["along"].directions, np.tile([1.0, 0, 0], (24, 1)))


def test_distort_moves_the_inside_only():
    body = block_body(cells=(3, 3, 3))
    moved = distort(body, 0.3, seed=1)
    shift = np.abs(moved.points - body.points).max(axis=1)
    outside = surface_nodes(body)
    assert len(outside) == 64 - 8
    assert (shift[outside] == 0).all()
    assert (np.delete(shift, outside) > 0).all()
    assert shift.max() <= 0.3 * 0.01 / 3
    assert moved.volumes.sum() == pytest.approx(body.volumes.sum(), rel=1e-12)
    np.testing.assert_array_equal(distort(body, 0.3, seed=1).points, moved.points)


def test_bad_boxes():
    with pytest.raises(OutOfRange, match="size"):
        block_body(size=(1.0, 0.0, 1.0))
    with pytest.raises(OutOfRange, match="cells"):
        block_body(cells=(1, 0, 1))
    with pytest.raises(BadMesh, match="'m'"):
        block_body(muscles={"m": (0, 0, 0)})
    with pytest.raises(OutOfRange, match="amplitude"):
        distort(block_body(), 0.5)
