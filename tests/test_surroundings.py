"""Pictures of what surrounds the tissue: walls, bones, pressures of contact."""

import os
import shutil
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("pyvista")
from PIL import Image

from dolfin_tongue import view
from dolfin_tongue.app import pictures
from dolfin_tongue.body.state import State
from dolfin_tongue.boundary import Attached, Contact, Sliding
from dolfin_tongue.constitutive import ReportTissue
from dolfin_tongue.control import Ramp
from dolfin_tongue.control.motion import SmoothMove, Still
from dolfin_tongue.direct import TrBdf2
from dolfin_tongue.geometry.palate import report_palate
from dolfin_tongue.geometry.preliminary import preliminary_tongue
from dolfin_tongue.geometry.simple import block_body
from dolfin_tongue.record.frames import Frames
from dolfin_tongue.record.run import Run
from dolfin_tongue.rigid import LineMuscle, RigidBody, Spring, plane
from dolfin_tongue.scene.scene import Scene
from dolfin_tongue.surfaces import Implicit, Plane, Sphere
from dolfin_tongue.view import contact as contact_view
from dolfin_tongue.view.bones import Skeleton, best_fit, hull, zigzag
from dolfin_tongue.view.camera import SIDE
from dolfin_tongue.view.film import Film
from dolfin_tongue.view.palette import MUSCLE
from dolfin_tongue.view.plots import contact_names, rigid_names
from dolfin_tongue.view.surroundings import Surroundings
from dolfin_tongue.view.walls import Wall

pytestmark = pytest.mark.skipif(
    not os.environ.get("DISPLAY") and shutil.which("Xvfb") is None,
    reason="neither a display nor Xvfb",
)


@pytest.fixture(scope="module")
def tongue():
    return preliminary_tongue()


@pytest.fixture(scope="module")
def palate():
    return report_palate(mesh_size=3e-3)


@pytest.fixture(scope="module")
def block():
    return block_body()


def state_of(body, time=0.0, displacement=0.0, rigid=()):
    moved = displacement + 0 * body.points
    q = np.reshape(np.asarray(rigid, dtype=float), (-1, 3))
    return State(time, moved, 0 * moved, np.zeros(len(body.cells)), rigid=q, rigid_rate=0 * q)


def scene_of(body, *terms, supports=()):
    return Scene(body, (ReportTissue(), *terms), supports)


def drawn(body, states, surroundings, **options):
    """Frames as whole numbers, shape (k, h, w, 3)."""
    with Film(body, states, 240, whiskers=False, surroundings=surroundings, **options) as film:
        return np.array([np.asarray(film.draw(state)) for state in states]).astype(int)


def ivory(image):
    """Pixels of walls: neither white nor red, more yellow than grey."""
    red, green, blue = np.moveaxis(image, -1, 0)
    return (red - blue > 15) & (red - green < 25) & (green - blue > 8)


# -- which surroundings ------------------------------------------------------------------------


def test_a_scene_without_surroundings_costs_nothing(block, monkeypatch):
    around = Surroundings.of(scene_of(block, supports=(Attached("x0"),)))
    assert not around and around == Surroundings()
    monkeypatch.setattr(Surroundings, "near", lambda *_: pytest.fail("nothing to look for"))
    monkeypatch.setattr(Wall, "sheet", lambda *_: pytest.fail("nothing to cut out"))
    states = [state_of(block)]
    np.testing.assert_array_equal(drawn(block, states, around), drawn(block, states, None))


def test_one_obstacle_of_two_laws_is_drawn_once(block):
    ball = Sphere((0.02, 0.01, -0.012), 0.01)
    move = (Still(), Still(), SmoothMove(-0.01))
    moving, other = Contact(ball, motion=move), Contact(Plane((0, 0, -0.001)))
    around = Surroundings.of(scene_of(block, Contact(ball), Contact(ball), moving, other))
    assert len(around.walls) == 3 and around.skeleton is None
    slid = Surroundings.of(scene_of(block, supports=(Sliding(Plane(), "z0"),)))
    assert len(slid.walls) == 1 and slid.walls[0].colour != around.walls[0].colour


def test_importing_needs_neither_vtk_nor_compiled_code():
    code = (
        "import sys, dolfin_tongue.view; "
        "print([m for m in ('pyvista', 'vtkmodules', 'matplotlib', 'dolfinx') if m in sys.modules])"
    )
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert answer.stdout.strip() == "[]", answer.stderr


# -- walls -------------------------------------------------------------------------------------

LOW, HIGH = np.array([-0.01, -0.02, -0.03]), np.array([0.05, 0.02, 0.01])


@pytest.mark.parametrize(
    "surface",
    [
        Plane((0, 0, -0.01), (0.2, 0.1, 1.0)),
        Sphere((0.02, 0.0, -0.01), 0.012),
        Sphere((0.02, 0.0, 0.0), 0.025, inside=True),
        Implicit(lambda x: x[:, 2] + 0.01 - 0.004 * np.sin(200 * x[:, 0])),
    ],
)
def test_sheets_lie_on_their_surface(surface):
    sheet = Wall(surface, lambda t: (np.zeros(3), np.zeros(3))).sheet(LOW, HIGH)
    assert np.abs(surface.gap(sheet.points).distance).max() < 1e-4
    assert (sheet.points >= LOW - 1e-9).all() and (sheet.points <= HIGH + 1e-9).all()
    free = surface.gap(sheet.points + 1e-3 * sheet.normals).distance
    assert (free > 5e-4).all()
    section = sheet.section.reshape(-1, 3)
    assert len(section) and np.abs(section[:, 1]).max() < 1e-12
    assert np.abs(surface.gap(section).distance).max() < 2e-4


def test_sheet_of_a_palate(palate):
    low, high = palate.points.min(axis=0), palate.points.max(axis=0)
    whole = Wall(palate).sheet(low - 1e-3, high + 1e-3)
    assert len(whole.triangles) == len(palate.triangles)
    places = whole.points + 1e-3 * whole.normals
    gap = palate.gap(places).distance
    assert (gap[np.isfinite(gap)] > 0).all()
    assert np.ptp(whole.section[:, :, 0]) == pytest.approx(high[0] - low[0], abs=1e-3)
    half = Wall(palate).sheet(low, np.array([*((low + high) / 2)[:1], *high[1:]]))
    assert half.points[:, 0].max() < (low + high)[0] / 2 + 1e-9
    assert Wall(palate).sheet(low - 1.0, low - 0.5) is None
    assert Wall(Plane((0, 0, 9.0))).sheet(low, high) is None


def test_a_palate_is_seen_over_the_tongue(tongue, palate):
    around = Surroundings.of(scene_of(tongue, Contact(palate)))
    states = [state_of(tongue)]
    plain, walled = drawn(tongue, states, None)[0], drawn(tongue, states, around)[0]
    assert ivory(plain).sum() < 20 and ivory(walled).sum() > 300
    # It veils the tongue at most: most of the tissue keeps its colour.
    reddish = [((image[..., 0] - image[..., 2]) > 50).sum() for image in (plain, walled)]
    scale = plain.shape[1] * plain.shape[0] / walled.shape[0] / walled.shape[1]
    assert reddish[1] > 0.6 * reddish[0] / max(scale, 1)
    rows = np.flatnonzero(ivory(walled).any(axis=1))
    tissue = np.flatnonzero(((walled[..., 0] - walled[..., 2]) > 60).any(axis=1))
    assert rows.min() < tissue.min()


def test_an_obstacle_moves_before_a_camera_that_does_not(block):
    move = (Still(), Still(), SmoothMove(-0.006, duration=0.1))
    term = Contact(Plane((0, 0, -0.001)), motion=move)
    states = [state_of(block, time) for time in (0.0, 0.05, 0.1)]
    frames = drawn(block, states, Surroundings.of(scene_of(block, term)))
    heights = [np.flatnonzero(ivory(frame).any(axis=1)).mean() for frame in frames]
    assert heights[0] + 3 < heights[1] < heights[2] - 3
    places = [((frame[..., 0] - frame[..., 2]) > 60) for frame in frames]
    tissue = [np.flatnonzero(place.any(axis=0))[[0, -1]] for place in places]
    np.testing.assert_array_equal(tissue[0], tissue[2])


def test_an_obstacle_far_away_is_left_out(block):
    around = Surroundings.of(scene_of(block, Contact(Plane((0, 0, -0.5)))))
    states = [state_of(block)]
    np.testing.assert_array_equal(drawn(block, states, around), drawn(block, states, None))


# -- bones -------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def jaw():
    muscle = LineMuscle(
        (0.08, 0, 0.06), (0.09, 0, 0.04), 10.0, activation=Ramp(1.0, duration=0.1), to="hyoid"
    )
    spring = Spring((0.06, 0, 0.06), (0.06, 0, 0.03), stiffness=50.0)
    return RigidBody(
        "mandible", ("genioglossus_origin",), 0.2, 1e-4, (0.066, 0, 0.06), (spring, muscle),
        pivot=(0.135, 0, 0.105),
    )  # fmt: skip


@pytest.fixture(scope="module")
def hyoid():
    return RigidBody("hyoid", ("base",), 0.02, 1e-6, (0.12, 0, 0.056))


def test_coordinates_follow_from_attached_nodes(tongue, jaw, hyoid):
    q = np.array([[1e-3, -2e-3, -0.2], [3e-4, 2e-3, 0.05]])
    displacement = np.zeros_like(tongue.points)
    for bone, coordinates in zip((jaw, hyoid), q, strict=True):
        nodes = bone.nodes(tongue)
        arms = bone.arms(tongue.points[nodes])
        displacement[nodes] = plane.displacement(arms, coordinates)
        np.testing.assert_allclose(best_fit(arms, displacement[nodes]), coordinates, atol=1e-12)
    skeleton = Skeleton(tongue, (jaw, hyoid))
    bare, told = state_of(tongue, 0.0, displacement), state_of(tongue, 0.0, displacement, q)
    np.testing.assert_allclose(skeleton.coordinates(bare), skeleton.coordinates(told), atol=1e-12)


def test_lines_end_at_their_bodies(tongue, jaw, hyoid):
    skeleton = Skeleton(tongue, (jaw, hyoid))
    lines = skeleton.lines(state_of(tongue, rigid=[[0, 0, -0.1], [0, 5e-3, 0]]))
    (_, _, spring), (_, _, muscle) = lines
    np.testing.assert_array_equal(spring[1], [0.06, 0, 0.03])  # the skull stays
    np.testing.assert_allclose(muscle[1], [0.09, 0, 0.045])  # the hyoid rises
    arm = muscle[0] - jaw.pivot
    assert np.linalg.norm(arm) == pytest.approx(
        np.linalg.norm(np.subtract((0.08, 0, 0.06), jaw.pivot))
    )
    assert spring[0, 2] < 0.06  # a negative angle opens the jaw


def test_hulls():
    corner = np.array([[0.0, 0, 0], [1, 0, 0], [1, 0, 1], [0.5, 0, 0.4]])
    assert len(hull(corner)) == 3
    np.testing.assert_array_equal(np.sort(hull(corner[[0, 0, 1]])[:, 0]), [0.0, 1.0])
    assert len(hull(corner[:1])) == 2
    path = zigzag(np.array([[0.0, 0], [100, 0]]), 5.0, 5.0)
    np.testing.assert_array_equal(path[[0, -1]], [[0, 0], [100, 0]])
    assert np.abs(path[:, 1]).max() == 5.0


def test_bones_are_drawn_and_move(tongue, jaw, hyoid):
    around = Surroundings.of(scene_of(tongue, supports=(jaw, hyoid)))
    rest, opened = np.zeros((2, 3)), np.array([[0, 0, -0.2], [0, 0, 0]])
    states = [state_of(tongue, 0.0, rigid=rest), state_of(tongue, 0.1, rigid=opened)]
    frames = drawn(tongue, states, around, view=SIDE)
    changed = np.abs(frames[1] - frames[0]).max(axis=-1) > 40
    assert 200 < changed.sum() < 0.3 * changed.size
    red = [(np.abs(frame - MUSCLE).max(axis=-1) < 25).sum() for frame in frames]
    assert red[0] == 0 and red[1] > 30  # not active, then active
    plain = drawn(tongue, states[:1], None)[0]
    assert plain.shape[0] < frames.shape[1]  # room for the springs


def test_an_animation_shows_walls_and_bones(tongue, palate, jaw, tmp_path):
    lone = replace(jaw, forces=jaw.forces[:1])
    around = Surroundings.of(scene_of(tongue, Contact(palate), supports=(lone,)))
    states = [state_of(tongue, 0.05 * k, rigid=[[0, 0, -0.1 * k]]) for k in range(3)]
    path = view.animation(tongue, states, tmp_path / "a.gif", fps=20, surroundings=around)
    with Image.open(path) as gif:
        assert gif.n_frames == 3
        gif.seek(2)
        assert ivory(np.asarray(gif.convert("RGB")).astype(int)).sum() > 500


def test_shape_with_surroundings(tongue, palate, jaw, tmp_path):
    lone = replace(jaw, forces=jaw.forces[:1])
    around = Surroundings.of(scene_of(tongue, Contact(palate), supports=(lone,)))
    for muscles in ((), tongue.fibres.names[:1]):
        path = view.shape_picture(
            tongue, state_of(tongue), tmp_path / "s.png", width=300, muscles=muscles,
            surroundings=around,
        )  # fmt: skip
        with Image.open(path) as image:
            assert ivory(np.asarray(image.convert("RGB")).astype(int)).sum() > 200


# -- pressure of contact -----------------------------------------------------------------------


def bluish(image):
    return (image[..., 2] - image[..., 0]) > 40


def test_a_growing_patch_of_contact(block, tmp_path):
    top = block.points[:, 2] > 0.0099
    near = top & (block.points[:, 0] < 0.015)
    maps = [0.0 * top, 3e3 * near, np.where(top, 3e3, np.nan)]
    states = [state_of(block, 0.01 * k) for k in range(3)]
    path = view.contact_picture(block, states, maps, tmp_path / "c.png", columns=3)
    with Image.open(path) as image:
        tiles = np.array_split(np.asarray(image.convert("RGB")).astype(int)[:-60], 3, axis=1)
    blue = [bluish(tile).sum() for tile in tiles]
    assert blue[0] == 0 and 200 < blue[1] < 0.8 * blue[2]
    columns = np.flatnonzero(bluish(tiles[1]).any(axis=0))
    assert columns.mean() < tiles[1].shape[1] / 2  # the tip is to the left


def test_colours_of_pressure():
    scale = contact_view.PressureScale("p", lambda *_: np.zeros(0), "YlGnBu")
    colours = scale.paint(np.array([0.0, -1.0, 0.5, 1.0, 2.0]), (0.0, 1.0)).astype(int)
    np.testing.assert_array_equal(colours[:2], [contact_view.PALE] * 2)
    np.testing.assert_array_equal(colours[3], colours[4])
    assert colours[3].sum() < colours[2].sum() < colours[0].sum()
    assert contact_view.scale_end([np.zeros(3), np.array([0, 5.0, 2.0])]) == 5.0
    assert contact_view.scale_end([np.zeros(3)]) == 1e3


def test_contact_pictures_that_cannot_be_drawn(block, tmp_path):
    states, none = [state_of(block)], np.zeros(len(block.points))
    for maps, words in (([none[:3]], r"nodes: it must be"), ([none] * 2, "2 pressure maps")):
        with pytest.raises(ValueError, match=words):
            view.contact_picture(block, states, maps, tmp_path / "no.png")
    with pytest.raises(ValueError, match="highest = 0"):
        view.contact_picture(block, states, [none], tmp_path / "no.png", highest=0)
    with pytest.raises(ValueError, match="columns = 0"):
        view.contact_picture(block, states, [none], tmp_path / "no.png", columns=0)
    assert not list(tmp_path.iterdir())


# -- curves, and all pictures of a run ---------------------------------------------------------

TIME = np.linspace(0, 0.1, 5)
CONTACT = {"contact_area_m2": 1e-4 * TIME} | {
    f"contact_force_{axis}_N": share * TIME for axis, share in zip("xyz", (1, 0, -5), strict=True)
}
RIGID = {"jaw_x_m": 0 * TIME, "jaw_z_m": -0.01 * TIME, "jaw_angle_rad": -TIME}


def test_plots(tmp_path):
    table = {"time_s": TIME, "tip_x_m": TIME, "skin_area_m2": TIME} | CONTACT | RIGID
    assert contact_names(table) == ["contact"] and rigid_names(table) == ["jaw"]
    for plot in (view.contact_plot, view.rigid_plot):
        with Image.open(plot(table, tmp_path / "p.png")) as image:
            assert 0.005 < (np.asarray(image.convert("L")) < 245).mean() < 0.5
        with pytest.raises(ValueError, match="need a column time_s"):
            plot({"time_s": TIME}, tmp_path / "no.png")


def test_pictures_of_a_run(tongue, palate, jaw, tmp_path):
    lone = replace(jaw, forces=jaw.forces[:1])
    scene = scene_of(tongue, Contact(palate), supports=(lone,))
    bare = replace(scene, body=replace(tongue, fibres=type(tongue.fibres)()))
    frames = Frames(tmp_path, bare.body)
    for time in TIME:
        frames.append(state_of(tongue, time, rigid=[[0, 0, -time]]))
    tip = {f"tip_{axis}_m": TIME for axis in "xyz"}
    for name, columns in (("trajectories", tip | RIGID), ("steps", CONTACT | {"kinetic_J": TIME})):
        table = {"time_s": TIME} | columns
        np.savetxt(
            tmp_path / f"{name}.csv", np.stack(list(table.values()), axis=1), delimiter=",",
            header=",".join(table), comments="",
        )  # fmt: skip
    run = Run(bare, TrBdf2(), tmp_path, frames, frames[-1])
    pictures.picture_run(run, "palate")
    made = {path.name for path in tmp_path.glob("*.*") if path.suffix in (".png", ".gif")}
    assert made >= {"sheet.png", "animation.gif", "shape.png", "pressure.png"}
    assert made >= {"contact.png", "rigid.png", "trajectories.png", "energy.png"}
    with Image.open(tmp_path / "sheet.png") as image:
        assert ivory(np.asarray(image.convert("RGB")).astype(int)).sum() > 1000
