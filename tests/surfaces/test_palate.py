"""The parametric palate: its measures, its room for the tongue at rest, its mesh, bad measures."""

import gmsh
import numpy as np
import pytest

from dolfin_tongue.base.errors import OutOfRange
from dolfin_tongue.geometry.palate import Palate, quarter_ellipse, report_palate
from dolfin_tongue.geometry.preliminary import preliminary_tongue
from dolfin_tongue.surfaces.triangles import area_vectors, edge_table

PALATE = Palate()
POINTS, TRIANGLES = PALATE.triangles()
SURFACE = report_palate(2e-3)


def test_room_for_the_tongue_at_rest():
    """What the docstring of `report_palate` states."""
    tongue = preliminary_tongue((4, 4, 2))
    assert tongue.points[tongue.landmark("tip"), 2] < POINTS[POINTS[:, 0] < 0.06, 2].min()
    gap = SURFACE.value(tongue.points[np.unique(tongue.boundary)])
    assert np.isfinite(gap).sum() > 100
    assert 1.8e-3 <= gap.min() <= 2.2e-3
    line = tongue.points[tongue.nodes("dorsum")]
    over = SURFACE.value(line[(line[:, 0] > 0.08) & (line[:, 0] < 0.12)])
    assert over.min() == pytest.approx(2.2e-3, abs=0.05e-3)
    assert over.max() == pytest.approx(3.9e-3, abs=0.05e-3)
    surface = tongue.points[tongue.nodes("upper_surface")]
    front = SURFACE.value(surface[surface[:, 0] < 0.062])
    assert 2.5e-3 <= front.min() <= front[np.isfinite(front)].max() <= 7e-3


def test_measures():
    """Highest point, gum line, teeth and velum are where they are said to be."""
    zero = np.zeros(1)
    assert PALATE.surface(zero, zero) == pytest.approx(np.array([[0.09, 0.0, 0.1155]]))
    assert POINTS[:, 2].max() == pytest.approx(0.1155, abs=2e-5)
    middle = POINTS[POINTS[:, 1] == 0]
    assert middle[:, 0].max() == pytest.approx(0.133, abs=1e-9)
    assert middle[middle[:, 0].argmax(), 2] == pytest.approx(0.099, abs=1e-9)
    assert POINTS[:, 0].min() == pytest.approx(0.046, abs=3e-4)  # 8 mm beyond the teeth
    assert POINTS[:, 1].max() == pytest.approx(0.031, abs=1e-9)
    flat = POINTS[POINTS[:, 0] < 0.0535]
    assert flat[:, 2] == pytest.approx(np.full(len(flat), 0.0995))  # along the incisors' edges
    beside = POINTS[np.isclose(POINTS[:, 1], 0.023) & (np.abs(POINTS[:, 0] - 0.092) < 2e-3)]
    assert beside[:, 2].max() == pytest.approx(0.1045, abs=1.5e-3)  # gum line, to a mesh size
    assert beside[:, 2].min() == pytest.approx(0.0995, abs=1.5e-3)


def test_the_ridge_stands_out_behind_the_incisors_only():
    flat = Palate(ridge=0.0)
    along, out = -np.linspace(0.0, 1.0, 201), np.zeros(201)
    lower = np.linalg.norm(flat.surface(along, out) - PALATE.surface(along, out), axis=1)
    assert lower.max() == pytest.approx(2e-3, rel=1e-3)
    crest = PALATE.surface(along, out)[lower.argmax()]
    assert 0.056 <= crest[0] <= 0.064
    beside = flat.surface(0 * along, -along) - PALATE.surface(0 * along, -along)
    assert np.abs(beside).max() <= 1e-15


def test_the_surface_is_smooth_over_the_top_of_the_vault():
    """The plan changes from half disc to strip there; the tangents do not."""
    out = np.linspace(0.05, 0.75, 8)
    step = 1e-6
    middle = PALATE.surface(0 * out, out)
    ahead = PALATE.surface(0 * out - step, out) - middle
    behind = PALATE.surface(0 * out + step, out) - middle
    for tangent in (ahead, behind):
        tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    assert np.abs(ahead + behind).max() <= 1e-4


def test_mesh_is_a_symmetric_sheet_that_faces_the_tongue():
    _, count, _ = edge_table(TRIANGLES)
    assert set(count) == {1, 2}
    assert len(POINTS) - len(count) + len(TRIANGLES) == 1  # a disc
    normals = area_vectors(POINTS, TRIANGLES)
    middle = POINTS[TRIANGLES].mean(axis=1)
    roof = (np.abs(middle[:, 1]) < 0.01) & (middle[:, 0] > 0.06)
    assert (normals[roof, 2] < 0).all()
    beside = (middle[:, 0] > 0.09) & (middle[:, 0] < 0.11)
    wall = beside & (middle[:, 1] > 0.02) & (middle[:, 1] < 0.0229)
    assert (normals[wall, 1] < 0).all()
    edge = beside & (middle[:, 1] > 0.025)
    assert edge.any() and (normals[edge, 2] < 0).all()
    mirror = POINTS * [1.0, -1.0, 1.0]
    order, twin = np.lexsort(POINTS.T.round(9)), np.lexsort(mirror.T.round(9))
    assert np.abs(POINTS[order] - mirror[twin]).max() <= 1e-12


@pytest.mark.parametrize("size", [3e-3, 1e-3])
def test_mesh_size(size):
    points, triangles = PALATE.triangles(size)
    corners = points[triangles]
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    assert 0.6 * size <= np.median(edges) <= 1.4 * size
    assert edges.max() <= 2.5 * size


def test_other_measures_and_options():
    flat = Palate(height=8e-3, ridge=0.0, teeth=3e-3, half_width=0.04)
    surface = report_palate(3e-3, flat, band=5e-3)
    assert surface.sheet
    assert surface.band == 5e-3
    assert np.ptp(surface.points[:, 1]) == pytest.approx(0.096)


def test_a_callers_gmsh_model_stays():
    gmsh.initialize(interruptible=False)
    try:
        gmsh.model.add("mine")
        PALATE.triangles(4e-3)
        assert gmsh.model.getCurrent() == "mine"
    finally:
        gmsh.finalize()


def test_length_of_an_ellipse():
    assert quarter_ellipse(2.0, 2.0) == pytest.approx(np.pi)
    assert quarter_ellipse(1.0, 0.0) == quarter_ellipse(0.0, 1.0) == pytest.approx(1.0)
    angle = (np.arange(1000) + 0.5) * np.pi / 2000
    length = np.hypot(3 * np.sin(angle), np.cos(angle)).mean() * np.pi / 2
    assert quarter_ellipse(3.0, 1.0) == pytest.approx(length, rel=1e-6)


@pytest.mark.parametrize(
    ("measures", "text"),
    [
        ({"height": 0.0}, "Palate.height = 0.0 m"),
        ({"half_width": -1.0}, "Palate.half_width = -1.0 m"),
        ({"teeth": np.inf}, "Palate.teeth = inf m"),
        ({"ridge": -1e-3}, "Palate.ridge = -0.001 m"),
        ({"ridge": 5e-3}, "Palate.ridge = 0.005 m .* a quarter of the height"),
        ({"top": (0.09, 0.1, 0.11)}, "Palate.top .* two finite numbers, x and z"),
        ({"velum": (np.nan, 0.1)}, "Palate.velum .* two finite numbers"),
        ({"velum": (0.133, 0.12)}, "Palate.velum .* not above the top"),
        ({"front": 0.1}, "increasing: x of front, top, teeth_end and velum"),
        ({"teeth_end": 0.14}, "increasing"),
        ({"front": np.nan}, "increasing"),
    ],
)
def test_bad_measures_are_refused(measures, text):
    with pytest.raises(OutOfRange, match=text):
        Palate(**measures)


@pytest.mark.parametrize("size", [0.0, -1e-3, 0.01, np.nan])
def test_bad_mesh_sizes_are_refused(size):
    with pytest.raises(OutOfRange, match=r"mesh_size = .* at most 0\.00575 m"):
        PALATE.triangles(size)
