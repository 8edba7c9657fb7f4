"""Surfaces by formulas: derivatives by differences, closed forms, UFL and NumPy alike, errors.

Worth reading: the differences of every surface (contact energy, force and stiffness are consistent
because of them), and the ellipsoid, whose points at a known distance are built outward from it.
"""

import numpy as np
import pytest
import ufl

from dolfin_tongue.base.errors import BadScene, OutOfRange
from dolfin_tongue.surfaces import Cylinder, Ellipsoid, Implicit, Plane, Sphere, overlap

CENTRE, AXES = np.array([0.01, -0.02, 0.05]), np.array([0.03, 0.02, 0.012])


def numpy_egg(x):
    return (((x - CENTRE) / AXES) ** 2).sum(axis=1) - 1


def ufl_egg(x):
    return sum(((x[i] - CENTRE[i]) / AXES[i]) ** 2 for i in range(3)) - 1


def ufl_waves(x):
    return x[2] - 0.004 * ufl.sin(x[0] / 0.01) * ufl.cos(x[1] / 0.013)


def around_egg(count=200, lowest=-0.003, highest=0.01):
    """Points at a known distance from the ellipsoid: foot points, normals and distances."""
    random = np.random.default_rng(1)
    away = random.normal(size=(count, 3))
    foot = AXES * away / np.linalg.norm(away, axis=1, keepdims=True)
    normal = foot / AXES**2
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    distance = random.uniform(lowest, highest, count)
    return CENTRE + foot + distance[:, None] * normal, normal, distance


def differences(function, points, step=1e-6):
    """Central differences of a function of points; the last axis is that of the derivative."""
    moves = step * np.eye(3)
    return np.stack(
        [(function(points + e) - function(points - e)) / (2 * step) for e in moves], axis=-1
    )


def points_of(name):
    """Points around a surface, not beyond its centres of curvature."""
    if name != "waves":
        return around_egg()[0]
    return np.random.default_rng(3).uniform([-0.05, -0.05, -0.006], [0.05, 0.05, 0.006], (200, 3))


SURFACES = {
    "plane": Plane((0.01, 0.0, 0.04), (1.0, 2.0, 3.0)),
    "ball": Sphere(tuple(CENTRE), 0.02),
    "bowl": Sphere(tuple(CENTRE), 0.04, inside=True),
    "pipe": Cylinder(tuple(CENTRE), (1.0, 1.0, 0.0), 0.04, inside=True),
    "egg": Ellipsoid(tuple(CENTRE), tuple(AXES)),
    "vault": Ellipsoid(tuple(CENTRE), tuple(AXES), inside=True),
    "function": Implicit(numpy_egg),
    "function with gradient": Implicit(numpy_egg, lambda x: 2 * (x - CENTRE) / AXES**2),
    "ufl": Implicit(ufl_egg),
    "waves": Implicit(ufl_waves),
}


@pytest.mark.parametrize("name", SURFACES)
def test_derivatives_are_those_of_the_value(name):
    surface, points = SURFACES[name], points_of(name)
    gap = surface.gap(points)
    normal = differences(lambda x: surface.gap(x).distance, points)
    curvature = differences(lambda x: surface.gap(x).normal, points)
    assert np.abs(gap.normal - normal).max() <= 1e-7
    assert np.abs(gap.curvature - curvature).max() <= 1e-6 * max(1.0, np.abs(curvature).max())
    assert np.linalg.norm(gap.normal, axis=1) == pytest.approx(1.0, abs=1e-12)
    slope = differences(surface.value, points)
    bend = differences(surface.gradient, points)
    assert np.abs(surface.gradient(points) - slope).max() <= 1e-6 * np.abs(slope).max()
    scale = max(np.abs(bend).max(), 1.0)
    assert np.abs(surface.hessian(points) - bend).max() <= 1e-6 * scale


@pytest.mark.parametrize("name", SURFACES)
def test_a_step_along_the_normal_leads_to_the_surface(name):
    surface, points = SURFACES[name], points_of(name)
    gap = surface.gap(points)
    foot = points - gap.distance[:, None] * gap.normal
    assert np.abs(surface.gap(foot).distance).max() <= 1e-15
    further = surface.gap(foot + 1e-3 * gap.normal).distance
    assert further == pytest.approx(1e-3, rel=1e-9)
    value = surface.value(surface.project(points))
    assert np.abs(value).max() <= 1e-12


@pytest.mark.parametrize("name", ["egg", "function", "function with gradient", "ufl"])
def test_distance_from_an_ellipsoid(name):
    points, normal, distance = around_egg()
    gap = SURFACES[name].gap(points)
    assert np.abs(gap.distance - distance).max() <= 1e-15
    assert np.abs(gap.normal - normal).max() <= 1e-12
    reference = SURFACES["egg"].gap(points).curvature
    assert np.abs(gap.curvature - reference).max() <= 1e-9 * np.abs(reference).max()


def test_an_ellipsoid_of_equal_axes_is_a_sphere():
    points = around_egg()[0]
    for inside in (False, True):
        ours = Ellipsoid(tuple(CENTRE), (0.02, 0.02, 0.02), inside).gap(points)
        theirs = Sphere(tuple(CENTRE), 0.02, inside).gap(points)
        assert np.abs(ours.distance - theirs.distance).max() <= 1e-16
        assert np.abs(ours.normal - theirs.normal).max() <= 1e-13
        assert np.abs(ours.curvature - theirs.curvature).max() <= 1e-9


def test_ellipsoid_where_the_nearest_point_is_not_unique():
    """From the centre and along the axes, the nearest point is the end of the shortest axis."""
    ellipsoid = SURFACES["egg"]
    points = CENTRE + np.array([[0, 0, 0], [0.004, 0, 0], [0, 0, 0.003], [0.08, 0, 0]])
    gap = ellipsoid.gap(points)
    height = AXES[2] * np.sqrt(1 - 0.004**2 * AXES[0] ** 2 / (AXES[0] ** 2 - AXES[2] ** 2) ** 2)
    sideways = 0.004 * AXES[2] ** 2 / (AXES[0] ** 2 - AXES[2] ** 2)
    expected = [-AXES[2], -np.hypot(height, sideways), -0.009, 0.05]
    assert gap.distance == pytest.approx(expected, rel=1e-9)
    assert np.isfinite(gap.normal).all()
    assert np.isfinite(gap.curvature).all()


def test_the_scale_of_g_does_not_matter():
    points = around_egg()[0]
    one, many = SURFACES["ufl"].gap(points), Implicit(lambda x: 1e9 * ufl_egg(x)).gap(points)
    assert np.abs(one.distance - many.distance).max() <= 1e-16
    assert np.abs(one.curvature - many.curvature).max() <= 1e-9


def test_beyond_a_centre_of_curvature_the_gap_is_of_first_order_or_a_nearest_point():
    """A trough z = 50 x^2 of radius 10 mm: from high above, the nearest points lie on its sides."""
    trough = Implicit(lambda x: x[2] - 50 * x[0] ** 2)
    gap = trough.gap(np.array([[0.0, 0.0, 0.03], [1e-5, 0.0, 0.03], [0.0, 0.0, 0.005]]))
    assert np.isfinite(gap.distance).all()
    assert gap.distance[2] == pytest.approx(0.005, rel=1e-12)
    # Straight down it is 30 mm; 0.03 = 50 x^2 + 1 / 100 gives nearest points at x = 20 mm.
    assert gap.distance[0] == pytest.approx(0.03, rel=1e-12)
    assert (gap.curvature[0] == 0).all()
    assert gap.distance[1] == pytest.approx(np.hypot(0.02, 0.01), rel=1e-3)


def test_numpy_and_ufl_operators_agree():
    def written(lib, x, larger, choose, less):
        return (
            lib.sin(x[0]) * lib.exp(-x[1]) + lib.sqrt(x[0] ** 2 + 1) * lib.tanh(x[2])
            + larger(x[0], x[1]) ** 3 - abs(x[2]) / (2 + lib.cos(x[1]))
            + choose(less(x[0], 0.1), x[1] ** 2, lib.cosh(x[2]))
        )  # fmt: skip

    from_ufl = Implicit(
        lambda x: written(ufl, x, ufl.max_value, ufl.conditional, ufl.lt), step=1e-3
    )
    from_numpy = Implicit(lambda x: written(np, x.T, np.maximum, np.where, np.less), step=1e-3)
    points = np.random.default_rng(2).uniform(-1.0, 1.0, (50, 3))
    # away from the kinks of max, abs and the condition, which differences would straddle
    smooth = (np.abs([points[:, 0] - points[:, 1], points[:, 2], points[:, 0] - 0.1]) > 0.01).all(0)
    points = points[smooth]
    assert len(points) > 30
    assert from_ufl.value(points) == pytest.approx(from_numpy.value(points), abs=1e-14)
    assert np.abs(from_ufl.gradient(points) - from_numpy.gradient(points)).max() <= 1e-10
    assert np.abs(from_ufl.hessian(points) - from_numpy.hessian(points)).max() <= 1e-8


def test_differences_are_as_accurate_as_stated():
    points = around_egg()[0]
    exact, approximate = SURFACES["waves"], Implicit(
        lambda x: x[:, 2] - 0.004 * np.sin(x[:, 0] / 0.01) * np.cos(x[:, 1] / 0.013)
    )  # fmt: skip
    error = np.abs(approximate.gradient(points) - exact.gradient(points)).max()
    bend = np.abs(approximate.hessian(points) - exact.hessian(points)).max()
    assert 1e-14 <= error <= 1e-9
    assert bend <= 1e-9 / 0.01


def test_overlap_is_the_depth_in_the_wall():
    points = np.array([[0.0, 0.0, 0.01], [0.0, 0.0, -0.002], [0.0, 0.0, 0.0]])
    assert overlap(Plane(), points) == pytest.approx([0.0, 0.002, 0.0], abs=1e-18)


def test_given_hessian_is_used():
    marked = Implicit(numpy_egg, hessian=lambda x: np.full((len(x), 3, 3), 7.0))
    assert (marked.hessian(around_egg(5)[0]) == 7.0).all()


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: Implicit(lambda x: np.asarray(x)), r"shape of Implicit.function .* \(4,\)"),
        (lambda: Implicit(lambda x: 1.0), "shape of Implicit.function"),
        (lambda: Implicit(lambda x: ufl.as_vector([x[0], x[1]])), "in UFL"),
        (lambda: Implicit(lambda x: x["here"]), "raises IndexError"),
        (lambda: Implicit(lambda x: np.full(len(np.asarray(x)), np.nan)), "finite"),
        (lambda: Implicit(lambda x: np.ones(x.shape[0])), "constant"),
        (lambda: Implicit(numpy_egg, lambda x: x[:, 0]), r"Implicit.gradient .* \(4, 3\)"),
        (lambda: Implicit(numpy_egg, hessian=lambda x: x), r"Implicit.hessian .* \(4, 3, 3\)"),
        (lambda: Implicit(numpy_egg, step=0.0), "Implicit.step = 0.0"),
        (lambda: Ellipsoid((0, 0, 0), (1.0, -1.0, 1.0)), "semi_axes_y = -1.0"),
        (lambda: Ellipsoid((0, 0, 0), (1.0, 1.0)), "Ellipsoid.semi_axes"),
        (lambda: Ellipsoid((0, 0, np.nan), (1.0, 1.0, 1.0)), "Ellipsoid.centre"),
    ],
)
def test_bad_surfaces_are_refused(make, text):
    with pytest.raises(OutOfRange, match=text):
        make()


def test_ufl_that_has_no_value_at_a_point_is_refused():
    import basix.ufl

    mesh = ufl.Mesh(basix.ufl.element("Lagrange", "tetrahedron", 1, shape=(3,)))
    space = ufl.FunctionSpace(mesh, basix.ufl.element("Lagrange", "tetrahedron", 1))
    with pytest.raises(BadScene, match="cannot contain Coefficient"):
        Implicit(lambda x: x[2] - ufl.Coefficient(space))
