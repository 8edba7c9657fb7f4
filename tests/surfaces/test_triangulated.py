"""Triangulated surfaces: smooth distance, rims, dents, bad triangles, a published palate.

Worth reading: the convergence on a sphere (the smooth distance is the right one) and the
differences (gap, normal and curvature belong to one function).
"""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from shapes import CORNERS, ball, cube, exact, hull, sheet

from dolfin_tongue.base.errors import BadMesh, OutOfRange
from dolfin_tongue.geometry.published import published_tongue
from dolfin_tongue.record.fingerprint import fingerprint
from dolfin_tongue.surfaces import Triangulated, overlap, read_surface
from dolfin_tongue.surfaces.triangles import volume

RANDOM = np.random.default_rng(4)
FLAT = Triangulated(*sheet(), sheet=True)


# -- the smooth distance --------------------------------------------------------------------------


def around(count, radius=0.03, band=0.004):
    away = RANDOM.normal(size=(count, 3))
    away /= np.linalg.norm(away, axis=1, keepdims=True)
    distance = RANDOM.uniform(-band, band, count)
    return (radius + distance)[:, None] * away, away, distance


def sphere_errors(count):
    """Largest errors of gap, normal and curvature (times the radius) around a sphere."""
    surface = Triangulated(*ball(count), band=0.005)
    points, away, distance = around(2000, band=0.002)
    gap = surface.gap(points)
    across = np.eye(3) - away[:, :, None] * away[:, None, :]
    curvature = across / (0.03 + distance)[:, None, None]
    return np.array(
        [
            np.abs(gap.distance - distance).max(),
            np.abs(gap.normal - away).max(),
            np.abs(gap.curvature - curvature).max() * 0.03,
        ]
    )


def test_convergence_to_a_sphere():
    """Gap of second order in the edges (chords), normal of first or better; curvature stays."""
    coarse, fine = sphere_errors(700), sphere_errors(2800)
    assert fine[0] <= 0.3 * coarse[0]
    assert fine[1] <= 0.55 * coarse[1]
    assert fine[0] <= 3e-5
    assert fine[1] <= 3e-3
    assert fine[2] <= 0.08
    assert coarse[2] <= 0.25


BALL = Triangulated(*ball(700), spacing=2e-3, band=6e-3)
DENTED = BALL.with_clearance(np.array([[0.0, 0.0, 0.0295], [0.01, 0.0, 0.028]]), 2e-4)


@pytest.mark.parametrize("surface", [BALL, BALL.reversed(), DENTED, replace(BALL, offset=1e-3)])
def test_derivatives_are_those_of_the_gap(surface):
    points, step = around(300, band=0.003)[0], 1e-7
    gap = surface.gap(points)
    forward = [surface.gap(points + step * e) for e in np.eye(3)]
    back = [surface.gap(points - step * e) for e in np.eye(3)]
    pairs = list(zip(forward, back, strict=True))
    normal = np.stack([(f.distance - b.distance) / (2 * step) for f, b in pairs], axis=-1)
    curvature = np.stack([(f.normal - b.normal) / (2 * step) for f, b in pairs], axis=-1)
    assert np.abs(gap.normal - normal).max() <= 1e-7
    # the curvature is continuous with kinks at the planes of the grid
    assert np.abs(gap.curvature - curvature).max() <= 1e-3 * np.abs(curvature).max()
    assert gap.curvature == pytest.approx(gap.curvature.transpose(0, 2, 1), abs=1e-12)
    assert (surface.value(points) == gap.distance).all()
    assert (surface.gradient(points) == gap.normal).all()
    assert (surface.hessian(points) == gap.curvature).all()


def test_a_flat_sheet_is_exact():
    points = RANDOM.uniform(-1, 1, (200, 3)) * [0.017, 0.017, 0.003]
    gap = FLAT.gap(points)
    assert np.abs(gap.distance - points[:, 2]).max() <= 1e-9
    assert np.abs(gap.normal - [0, 0, 1]).max() <= 1e-6
    assert np.abs(gap.curvature).max() <= 1e-2
    assert FLAT.smoothing_error <= 1e-12


def test_no_contact_beyond_the_band_and_the_rim():
    points = np.array(
        [[0, 0, 0.0079], [0, 0, -0.0081], [0.0215, 0, 0], [9, 9, 9], [np.nan, 0, 0], [0, 0, 0.001]]
    )
    gap = FLAT.gap(points)
    assert np.isposinf(gap.distance).tolist() == [True] * 5 + [False]
    assert (gap.normal[:5] == 0).all()
    assert (gap.curvature[:5] == 0).all()
    assert np.isfinite(FLAT.gap(np.array([[0.0, 0.0, 0.0039], [0.0, 0.0, -0.0039]])).distance).all()


def test_all_of_the_band_is_known():
    places = RANDOM.uniform(-1, 1, (5000, 3)) * 0.04
    near = np.abs(np.linalg.norm(places, axis=1) - 0.03) <= BALL.band - 2e-4  # chords
    assert near.sum() > 500
    assert np.isfinite(BALL.value(places[near])).all()


def test_inside_offset_and_reversed():
    points = around(50, band=0.003)[0]
    outside = BALL.value(points)
    assert replace(BALL, inside=True).value(points) == pytest.approx(-outside, abs=1e-15)
    assert BALL.reversed().value(points) == pytest.approx(-outside, abs=1e-15)
    assert replace(BALL, offset=2e-4).value(points) == pytest.approx(outside - 2e-4, abs=1e-15)
    thick = replace(BALL, inside=True, offset=2e-4)
    assert thick.value(points) == pytest.approx(-outside - 2e-4, abs=1e-15)
    up = np.array([[0.0, 0.0, 0.001]])
    assert FLAT.reversed().value(up) == pytest.approx([-0.001])


def test_project():
    points = around(100, band=0.01)[0]
    found = BALL.project(points)
    assert np.abs(BALL.value(found)).max() <= 1e-14
    assert np.linalg.norm(found, axis=1) == pytest.approx(0.03, abs=3e-4)
    beyond = FLAT.project(np.array([[0.03, 0.0, 0.01]]))
    assert beyond == pytest.approx(np.array([[0.02, 0.0, 0.0]]))


def test_sharp_edges_are_rounded_and_it_is_said_by_how_much():
    surface = Triangulated(*cube(), spacing=5e-4, smoothing=5e-4)
    assert 0.2 * 5e-4 <= surface.smoothing_error <= 5e-4
    middle = np.array([[0.01, 0.0, 0.0], [0.0, -0.01, 0.002]])
    assert np.abs(surface.value(middle)).max() <= 1e-6
    finer = Triangulated(*cube(), spacing=2.5e-4, smoothing=2.5e-4)
    assert finer.smoothing_error == pytest.approx(surface.smoothing_error / 2, rel=0.1)


def test_smoothing_takes_the_kinks_out_of_the_curvature():
    rough, smooth = replace(BALL, smoothing=0.0), BALL
    points = around(1000, band=0.002)[0]
    bend = [np.linalg.eigvalsh(s.gap(points).curvature)[:, -1] * 0.03 for s in (rough, smooth)]
    assert np.ptp(bend[0]) >= 3 * np.ptp(bend[1])


# -- dents ----------------------------------------------------------------------------------------


def test_a_wall_yields_just_where_it_must():
    inside = np.array([[0.0, 0.0, -5e-4], [0.001, 0.0, -3e-4], [-0.015, 0.0, 1e-4]])
    assert overlap(FLAT, inside) == pytest.approx([5e-4, 3e-4, 0.0], abs=1e-12)
    surface = FLAT.with_clearance(inside)
    assert overlap(surface, inside).max() == 0
    assert surface.value(inside)[0] <= 1e-6  # not more than needed at the worst point
    assert surface.largest_retraction == pytest.approx(5e-4, rel=2e-3)
    far = np.array([[0.015, 0.015, 0.001], [-0.015, 0.0, 1e-4]])
    assert surface.value(far) == pytest.approx(FLAT.value(far), abs=1e-7)
    slope = np.abs(np.linalg.norm(surface.gradient(inside), axis=1) - 1)
    assert slope.max() <= 0.15
    assert FLAT.largest_retraction == 0
    assert surface.smoothing_error <= 1e-12


def test_clearance_and_dents_add_up():
    points = np.array([[0.0, 0.0, 2e-4], [0.012, 0.0, -1e-4]])
    once = FLAT.with_clearance(points, 3e-4, radius=8e-3)
    assert (once.value(points) >= 3e-4).all()
    assert once.value(points) == pytest.approx(3e-4, abs=2e-6)
    assert once.retraction.radii == pytest.approx(8e-3)
    twice = once.with_clearance(points, 5e-4)
    assert (twice.value(points) >= 5e-4).all()
    assert len(twice.retraction.depths) == 4
    assert len(twice.with_clearance(points, 5e-4).retraction.depths) == 4  # nothing is lacking


def test_dents_work_on_the_inner_side_too():
    bowl = BALL.reversed()
    points = around(400, band=5e-4)[0]
    surface = bowl.with_clearance(points)
    assert overlap(bowl, points).max() >= 4e-4
    assert overlap(surface, points).max() <= 1e-18  # round-off of places of 3 cm
    assert surface.largest_retraction <= 2 * overlap(bowl, points).max()


# -- what is refused ------------------------------------------------------------------------------

P, T = cube()


def without(row):
    return np.delete(T, row, axis=0)


@pytest.mark.parametrize(
    ("points", "triangles", "options", "text"),
    [
        (P[:, :2], T, {}, r"points must have shape \(n, 3\)"),
        (P, T[:, :2], {}, r"triangles must have shape \(t, 3\)"),
        (P, T[:0], {}, r"triangles must have shape \(t, 3\)"),
        (P, T.astype(float), {}, "whole numbers"),
        (np.where(np.arange(8)[:, None] == 3, np.nan, P), T, {}, r"point\(s\) 3 are not finite"),
        (P, T + 1, {}, r"triangle\(s\) .* do not exist; the 8 points"),
        (P, np.where(T == T[0, 0], -1, T), {}, "do not exist"),
        (P * 1e3, T, {}, "20 m long; .*multiply by 1e-3"),
        (P, np.r_[T, [[0, 1, 1]]], {"sheet": True}, r"triangle\(s\) 12 are degenerate"),
        (P, without(5), {}, r"open: it has 3 border edge\(s\). Pass sheet=True .* close it"),
        (P, T[:, ::-1], {}, r"inside out.*triangles\[:, ::-1\]"),
        (P, np.r_[T[:1, ::-1], T[1:]], {}, r"triangle\(s\) 0, .* point to different sides"),
        (P, np.r_[T[:1, ::-1], T[1:]], {"sheet": True}, "point to different sides"),
        (
            np.r_[P, [[0.05, 0.03, 0.02]]],
            np.r_[T, [[T[0, 0], T[0, 1], 8]]],
            {},
            r"more than two triangles meet at an edge of triangle\(s\) 0, .*12",
        ),
    ],
)
def test_bad_triangles_are_refused(points, triangles, options, text):
    with pytest.raises(BadMesh, match=text):
        Triangulated(points, triangles, **options)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"spacing": 0.0}, "spacing = 0.0 m"),
        ({"spacing": np.nan}, "spacing = nan m"),
        ({"spacing": 1e-3, "band": 1e-3}, r"band = 0.001 m .* >= 2 spacings = 0.002"),
        ({"band": -1.0}, "band = -1.0 m"),
        ({"smoothing": -1e-3}, "smoothing = -0.001 m"),
        ({"smoothing": 5e-3, "band": 6e-3}, "smoothing = 0.005 m .* at most half the band"),
        ({"offset": 1.0}, "offset = 1.0 m .* smaller than the band"),
    ],
)
def test_bad_lengths_are_refused(options, text):
    with pytest.raises(OutOfRange, match=text):
        Triangulated(P, T, **options)


def test_too_fine_a_grid_is_refused():
    surface = Triangulated(P, T, spacing=2e-5)
    with pytest.raises(OutOfRange, match=r"spacing = 2e-05 .* the most are 4e"):
        surface.value(P)


@pytest.mark.parametrize(
    ("options", "text"),
    [({"clearance": 1.0}, "clearance = 1.0 m"), ({"radius": 0.0}, "radius = 0.0 m")],
)
def test_bad_dents_are_refused(options, text):
    with pytest.raises(OutOfRange, match=text):
        FLAT.with_clearance(np.zeros((1, 3)), **options)


def test_two_cubes_and_a_cube_within_are_closed():
    beside = P + np.array([0.1, 0.0, 0.0])
    twin = np.r_[P, beside], np.r_[T, T + 8]
    assert np.isfinite(Triangulated(*twin).value(P)).all()
    shell = np.r_[P, 0.5 * P], np.r_[T, T[:, ::-1] + 8]
    assert volume(*shell) == pytest.approx(8e-6 - 1e-6)
    surface = Triangulated(*shell, spacing=5e-4)
    places = np.array([[0.0075, 0.0, 0.0], [0.004, 0.0, 0.0], [0.011, 0.0, 0.0]])
    assert np.sign(surface.value(places)).tolist() == [-1.0, 1.0, 1.0]


def test_what_a_run_is_known_by():
    """The fingerprint of a run depends on what a surface is, not on what was asked of it."""

    @dataclass(frozen=True)
    class Holder:
        surface: Triangulated

    key = fingerprint(Holder(Triangulated(P, T)))
    used = Triangulated(P.copy(), T.copy())
    used.value(P)
    assert fingerprint(Holder(used)) == key
    others = [{"inside": True}, {"band": 5e-3}, {"offset": 1e-4}, {"smoothing": 0.0}]
    keys = {fingerprint(Holder(Triangulated(P, T, **other))) for other in others}
    keys |= {fingerprint(Holder(Triangulated(1.001 * P, T))), key}
    keys.add(fingerprint(Holder(used.with_clearance(P, 1e-3))))
    assert len(keys) == len(others) + 3
    assert isinstance(hash(used), int)
    assert len(CORNERS) == 8
    assert len(hull(CORNERS)) == 12


# -- a published palate ---------------------------------------------------------------------------


def on_faces(body, cuts=8):
    """Points of the outer quadrilaterals, shape (k, 3)."""
    line = np.linspace(0.0, 1.0, cuts + 1)
    r, t = (grid.ravel() for grid in np.meshgrid(line, line))
    weights = np.stack([(1 - r) * (1 - t), r * (1 - t), r * t, (1 - r) * t], axis=1)
    return np.einsum("wc,qci->qwi", weights, body.points[body.boundary]).reshape(-1, 3)


def test_overlap_of_the_published_palate(published_folder):
    """Known of these data: 0.30 mm at the sides (x 94-101, |y| 15-20 mm), 0.72 mm at the velum
    (x 114, |y| 17 mm), and a gap of 8.2 mm over the top node."""
    body = published_tongue(published_folder)
    points = on_faces(body)
    # Beside the wall of the pharynx the sides of the sheet mean nothing.
    points = points[(points[:, 0] < 0.126) & (points[:, 2] > 0.09)]
    surface = read_surface(published_folder / "palate.obj", sheet=True)
    distance, inner = exact(surface.points, surface.triangles, points)
    side = (points[:, 0] < 0.105) & inner
    velum = (points[:, 0] > 0.105) & inner
    assert distance[side].min() == pytest.approx(-0.30e-3, abs=0.005e-3)
    assert distance[velum].min() == pytest.approx(-0.72e-3, abs=0.005e-3)
    touching = np.abs(points[side & (distance < 0)])
    assert touching.min(axis=0)[:2] == pytest.approx([0.094, 0.015], abs=1.5e-3)
    assert touching.max(axis=0)[:2] == pytest.approx([0.101, 0.020], abs=1.5e-3)
    worst = points[velum][distance[velum].argmin()]
    assert np.abs(worst)[:2] == pytest.approx([0.114, 0.017], abs=5e-4)
    top = body.points[[body.landmark("top")]]
    assert surface.value(top) == pytest.approx([8.2e-3], abs=0.05e-3)

    # The smooth surface, and its dents.
    assert surface.value(points[side]).min() == pytest.approx(-0.30e-3, abs=0.05e-3)
    assert surface.value(points[velum]).min() == pytest.approx(-0.72e-3, abs=0.02e-3)
    room = surface.with_clearance(points, 1e-4)
    assert room.value(points).min() >= 1e-4
    assert 0.81e-3 <= room.largest_retraction <= 1.0e-3
