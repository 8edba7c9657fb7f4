"""The exact distance of triangles: nearest points, the side, what has none."""

import numpy as np
import pytest
from scipy.spatial import cKDTree
from shapes import cube, cube_distance, exact, sheet

from dolfin_tongue.surfaces.nearest import tree_of

RANDOM = np.random.default_rng(4)


def test_nearest_points_are_the_nearest_of_all():
    corners = RANDOM.normal(size=(157, 3, 3))
    places = RANDOM.normal(size=(300, 3)) * 2
    triangle, feature, nearest = tree_of(corners).nearest(places)
    weights = RANDOM.dirichlet((0.5, 0.5, 0.5), 4000)
    cloud = np.einsum("wc,tci->twi", weights, corners).reshape(-1, 3)
    bound, _ = cKDTree(cloud).query(places)
    distance = np.linalg.norm(places - nearest, axis=1)
    assert (distance <= bound + 1e-14).all()
    assert np.median(bound - distance) <= 0.01  # the cloud is dense enough to be a bound
    # and each nearest point is on its triangle, at the corner or edge that is named
    a, b, c = np.moveaxis(corners[triangle], 1, 0)
    shares = np.linalg.solve(np.stack([a, b, c], axis=2), nearest[:, :, None])[:, :, 0]
    assert shares.min() >= -1e-9
    assert shares.sum(axis=1) == pytest.approx(1.0, abs=1e-9)
    zeros = {0: [1, 2], 1: [0, 2], 2: [0, 1], 3: [2], 4: [0], 5: [1], 6: []}
    assert set(feature) == set(zeros)
    for kind, none in zeros.items():
        assert np.abs(shares[feature == kind][:, none]).max(initial=0.0) <= 1e-9


def test_one_triangle_makes_a_tree():
    _, feature, nearest = tree_of(np.eye(3)[None]).nearest(np.array([[1.0, 1.0, 1.0], [2, 0, 0]]))
    assert nearest == pytest.approx(np.array([[1 / 3, 1 / 3, 1 / 3], [1, 0, 0]]))
    assert feature.tolist() == [6, 0]


def test_signed_distance_of_a_cube():
    """Most points outside are nearest to an edge or a corner, where triangles' normals disagree."""
    places = RANDOM.uniform(-0.03, 0.03, (3000, 3))
    distance, inner = exact(*cube(), places)
    assert inner.all()
    assert np.abs(distance - cube_distance(places)).max() <= 1e-16


def test_the_side_is_right_at_a_sharp_fold():
    """A roof of two planes, 20 degrees wide: near its ridge one plane's normal misleads."""
    points, triangles = sheet(count=5, height=lambda x, y: -np.abs(x) / np.tan(np.radians(10)))
    places = RANDOM.uniform(-0.004, 0.004, (2000, 3))
    distance, inner = exact(points, triangles, places)
    above = places[:, 2] > -np.abs(places[:, 0]) / np.tan(np.radians(10))
    assert inner.all()
    assert ((distance > 0) == above).all()


def test_the_side_is_right_at_a_tip_of_many_triangles():
    """A sharp pyramid, one side of it cut into fifty: they must not outvote the two others."""
    corners = np.array([[0.15, 0.0, -1.0], [-0.075, 0.13, -1.0], [-0.075, -0.13, -1.0]])
    share = np.linspace(0.0, 1.0, 51)[:, None]
    points = np.concatenate([np.zeros((1, 3)), (1 - share) * corners[0] + share * corners[1]])
    points = np.concatenate([points, corners[2:]])
    fan = np.stack([np.zeros(50, int), np.arange(1, 51), np.arange(2, 52)], axis=1)
    triangles = np.concatenate([fan, [[0, 51, 52], [0, 52, 1]]])
    places = RANDOM.normal(size=(2000, 3)) * 0.1
    normals = np.cross(corners, np.roll(corners, -1, axis=0))
    outside = (places @ normals.T).max(axis=1) > 0
    distance, inner = exact(points, triangles, places)
    assert inner.all()
    assert ((distance > 0) == outside).all()


def test_beyond_a_rim_there_is_no_side():
    places = np.array([[0.0, 0.0, 0.002], [0.021, 0.0, 0.002], [0.021, 0.021, -0.002]])
    distance, inner = exact(*sheet(), places)
    assert inner.tolist() == [True, False, False]
    assert distance == pytest.approx([0.002, 0.002, -0.002])  # of the sheet continued
