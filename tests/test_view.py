"""Pictures: the right size, not blank, showing what moved; whole files or none."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pyvista")
from PIL import Image

from dolfin_tongue import view
from dolfin_tongue.base.errors import BadMesh, OutOfRange, UnknownName
from dolfin_tongue.body.state import State
from dolfin_tongue.geometry.preliminary import preliminary_tongue
from dolfin_tongue.geometry.simple import block_body
from dolfin_tongue.view import display
from dolfin_tongue.view.camera import Camera, View
from dolfin_tongue.view.canvas import nice_below, spoken
from dolfin_tongue.view.fibres import fibre_segments
from dolfin_tongue.view.fields import deformation_gradients, largest_stretch
from dolfin_tongue.view.skin import Skin

needs_display = pytest.mark.skipif(
    not os.environ.get("DISPLAY") and shutil.which("Xvfb") is None,
    reason="neither a display nor Xvfb",
)


@pytest.fixture(scope="module")
def body():
    return block_body(muscles={"along": (1, 0, 0), "across": (0, 1, 0)})


def state_of(body, time=0.0, lift=0.0, velocity=0.0):
    """End of the block lifted by `lift` (m) at x1, less towards x0; it rises at `velocity`."""
    share = body.points[:, :1] / body.points[:, 0].max() * [0.0, 0.0, 1.0]
    pressure = np.linspace(-1e3, 2e3, len(body.cells))
    return State(time, lift * share, velocity * share, pressure)


def pixels(path):
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB")).astype(int)


def inked(image):
    """Share of pixels that are not white."""
    return (image.min(axis=-1) < 245).mean()


def reddish(image):
    """Pixels in the colour of tissue."""
    return (image[..., 0] - image[..., 2]) > 40


# -- without a display -------------------------------------------------------------------------


def test_importing_needs_neither_vtk_nor_matplotlib():
    code = (
        "import sys, dolfin_tongue.view; "
        "print([m for m in ('pyvista', 'vtkmodules', 'matplotlib') if m in sys.modules])"
    )
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert answer.stdout.strip() == "[]", answer.stderr


@pytest.mark.parametrize("angles", [(0, 0), (18, 10), (38, 22), (0, 90)])
def test_views_have_the_tip_left_and_up_upwards(angles):
    right, up, toward = View(*angles).axes
    np.testing.assert_allclose(np.cross(right, up), toward, atol=1e-15)
    assert right[0] > 0 and up[2] >= -1e-15


def test_camera_fits_its_points(body):
    camera = Camera.fitting([body.points], 400)
    seen = camera.project(body.points)
    assert (seen > 0).all() and (seen < camera.size).all()
    tip, root = camera.project(np.array([[0.0, 0.01, 0.005], [0.04, 0.01, 0.005]]))
    assert tip[0] < root[0]
    lower, upper = camera.project(np.array([[0.02, 0.01, 0.0], [0.02, 0.01, 0.01]]))
    assert upper[1] < lower[1]


def test_surface_of_a_block(body):
    surface = Skin(body, cuts=3)
    assert len(surface.faces) == 2 * (4 * 2 + 4 * 2 + 2 * 2)
    normals = surface.normals(body.points)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0)
    outward = surface.points(body.points) - body.points.mean(axis=0)
    assert ((normals * outward).sum(axis=1) > 0).all()
    # The creases of a block stay sharp: each normal points along one axis.
    np.testing.assert_allclose(np.abs(normals).max(axis=1), 1.0)


def test_smooth_surface_shares_normals():
    surface = Skin(preliminary_tongue(), cuts=1)
    points = surface.points(preliminary_tongue().points)
    normals = surface.normals(preliminary_tongue().points)
    _, group = np.unique(points.round(9), axis=0, return_inverse=True)
    spread = [np.ptp(normals[group.ravel() == g], axis=0).max() for g in range(group.max() + 1)]
    assert np.median(spread) < 0.2


def test_fields_of_a_homogeneous_deformation(body):
    gradient = np.array([[1.25, 0.1, 0.0], [0.0, 0.8, 0.0], [0.0, 0.0, 1.0]])
    displacement = body.points @ (gradient - np.eye(3)).T
    found = deformation_gradients(body, displacement)
    np.testing.assert_allclose(found, np.broadcast_to(gradient, found.shape), atol=1e-12)
    largest = np.linalg.svd(gradient, compute_uv=False)[0]
    np.testing.assert_allclose(largest_stretch(body, displacement), largest)
    rest = fibre_segments(body, body.fibres["across"])
    np.testing.assert_allclose(rest[:, 1] - rest[:, 0], [[0, 0.75 * 0.01, 0]] * 16, atol=1e-12)
    moved = fibre_segments(body, body.fibres["across"], displacement)
    np.testing.assert_allclose(moved, rest @ gradient.T, atol=1e-12)


def test_words_and_numbers():
    assert [nice_below(x) for x in (0.1, 0.19, 0.5, 7.0)] == pytest.approx([0.1, 0.1, 0.5, 5.0])
    assert spoken("genioglossus_posterior") == "genioglossus posterior"
    assert spoken("GGP_L") == "genioglossus posterior (L)"


def test_key_frames_prefer_motion(body):
    lifts = np.concatenate([np.zeros(50), np.linspace(0, 0.01, 11), np.full(40, 0.01)])
    states = [state_of(body, 0.01 * k, lift) for k, lift in enumerate(lifts)]
    chosen = view.key_frames(states, 11)
    times = np.array([state.time for state in chosen])
    assert len(chosen) == 11 and times[0] == 0 and times[-1] == states[-1].time
    assert ((times > 0.49) & (times < 0.61)).sum() >= 5
    assert view.key_frames(states[:3], 11) == states[:3]
    assert len({id(state) for state in view.key_frames(states, 90)}) == 90


def test_no_display_is_said_clearly(monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.setattr(display.shutil, "which", lambda name: None)
    with pytest.raises(display.NoDisplay, match=r"\./tongue"):
        display.ensure_display.__wrapped__()


def test_a_display_that_does_not_answer_is_refused(monkeypatch):
    monkeypatch.setenv("DISPLAY", ":4095")
    with pytest.raises(display.NoDisplay, match=":4095"):
        display.ensure_display.__wrapped__()


@pytest.mark.skipif(shutil.which("Xvfb") is None, reason="no Xvfb")
def test_view_starts_its_own_display(tmp_path):
    code = (
        "import sys; sys.path.insert(0, 'tests'); from test_view import *; body = block_body(); "
        f"print(view.shape_picture(body, state_of(body), {str(tmp_path / 'own.png')!r}, width=200))"
    )
    environment = {name: value for name, value in os.environ.items() if name != "DISPLAY"}
    top = Path(__file__).parent.parent
    answer = subprocess.run(
        [sys.executable, "-c", code], env=environment, cwd=top, capture_output=True, text=True
    )
    assert answer.returncode == 0, answer.stderr
    assert inked(pixels(tmp_path / "own.png")) > 0.2


# -- three-dimensional pictures ----------------------------------------------------------------


@needs_display
def test_contact_sheet(body, tmp_path):
    states = [state_of(body, 0.01 * k, 0.002 * k, 0.1) for k in range(5)]
    path = view.contact_sheet(body, states, tmp_path / "sheet.png", columns=3, title="block")
    image = pixels(path)
    tiles = 3 * view.sheet.TILE_WIDTH
    assert tiles < image.shape[1] < 1.2 * tiles
    assert 0.05 < inked(image) < 0.7
    one = pixels(view.contact_sheet(body, states[:1], tmp_path / "one.png", columns=3))
    assert one.shape[1] < 1.2 * view.sheet.TILE_WIDTH
    assert os.listdir(tmp_path).count("sheet.png") == 1 and len(os.listdir(tmp_path)) == 2


@needs_display
def test_velocities_and_fixed_nodes_are_seen(body, tmp_path):
    def blue(image):
        return ((image[..., 2] - image[..., 0]) > 60).sum()

    still, moving = state_of(body), state_of(body, velocity=0.2)
    plain = pixels(view.contact_sheet(body, [still], tmp_path / "still.png"))
    lines = pixels(view.contact_sheet(body, [moving], tmp_path / "moving.png"))
    assert blue(plain) == 0 and blue(lines) > 100
    marked = pixels(view.contact_sheet(body, [still], tmp_path / "fixed.png", fixed=["x0"]))
    dark = [(image.max(axis=-1) < 70).sum() for image in (plain, marked)]
    assert dark[1] > dark[0] + 50


@needs_display
def test_tip_is_left(tmp_path):
    """The pointed end of the tongue is low in pixels of tissue, the root is high."""
    body = preliminary_tongue()
    rest = State(0.0, 0 * body.points, 0 * body.points, np.zeros(len(body.cells)))
    path = view.shape_picture(body, rest, tmp_path / "x.png", view=view.SIDE, width=300)
    image = reddish(pixels(path))
    columns = np.flatnonzero(image.any(axis=0))
    width = np.ptp(columns) // 8
    front = image[:, columns[0] : columns[0] + width]
    back = image[:, columns[-1] - width : columns[-1]]
    assert front.sum() < 0.7 * back.sum()


@needs_display
def test_animation_moves(body, tmp_path):
    states = [state_of(body, 0.01 * k, 0.003 * k) for k in range(6)]
    path = view.animation(body, states, tmp_path / "a.gif", fps=20)
    with Image.open(path) as gif:
        assert gif.n_frames == 6 and gif.info["duration"] == 50 and gif.width == 480
        frames = []
        for k in (0, 1, 5):
            gif.seek(k)
            frames.append(np.asarray(gif.convert("RGB")).astype(int))
    near, far = (np.abs(frame - frames[0]).max(axis=-1) > 40 for frame in frames[1:])
    assert 0 < near.sum() < far.sum()
    # The end at the right rises, the one at the left stays.
    half = frames[0].shape[1] // 2
    body_rows = slice(40, -40)  # between time and scales
    left, right = far[body_rows, : half // 2], far[body_rows, half:]
    assert right.sum() > 5 * left.sum()


@needs_display
def test_animation_of_states_at_rest_has_every_frame(body, tmp_path):
    path = view.animation(body, [state_of(body, 0.01 * k) for k in range(3)], tmp_path / "a.gif")
    assert path.stat().st_size > 1000


@needs_display
def test_fibre_pictures(body, tmp_path):
    paths = view.fibre_pictures(body, tmp_path / "fibres")
    assert [path.name for path in paths] == ["along.png", "across.png", "all.png"]
    images = [pixels(path) for path in paths]
    assert images[0].shape == images[1].shape
    for image in images[:2]:
        saturated = np.ptp(image, axis=-1) > 90
        assert 50 < saturated.sum() < 0.2 * saturated.size
    assert (images[0] != images[1]).any(axis=-1).sum() > 200


@needs_display
def test_final_shapes(body, tmp_path):
    shapes = {"along": state_of(body, lift=0.005), "across": state_of(body, lift=-0.005)}
    image = pixels(view.final_shapes(body, shapes, tmp_path / "final.png"))
    half = image.shape[1] // 2
    assert inked(image[:, :half]) > 0.05 and inked(image[:, half:]) > 0.05


@needs_display
@pytest.mark.parametrize("colour", ["tissue", "pressure", "stretch", "displacement", "speed"])
def test_shape_picture(body, tmp_path, colour):
    path = tmp_path / "shape.png"
    view.shape_picture(body, state_of(body, lift=0.01, velocity=0.1), path, colour, width=300)
    image = pixels(path)
    assert image.shape[1] == 300 and inked(image) > 0.2


@needs_display
@pytest.mark.parametrize("size", [(1e-3, 2e-3, 1e-3), (0.1, 3.0, 0.1)])
def test_size_of_the_body_does_not_matter(tmp_path, size):
    body = block_body(size, (1, 2, 1))
    path = view.contact_sheet(body, [state_of(body, velocity=size[0])], tmp_path / "s.png")
    image = pixels(path)
    assert reddish(image).mean() > 0.02
    assert ((image[..., 2] - image[..., 0]) > 60).sum() > 50


@needs_display
def test_fibres_are_seen_through_the_shape(body, tmp_path):
    still = state_of(body)
    plain = pixels(view.shape_picture(body, still, tmp_path / "a.png", width=300))
    inside = pixels(
        view.shape_picture(body, still, tmp_path / "b.png", muscles=["along"], width=300)
    )
    assert plain.shape == inside.shape and np.abs(plain - inside).max() > 60


# -- curves ------------------------------------------------------------------------------------


def test_trajectories(tmp_path):
    time = np.linspace(0, 0.5, 20)
    places = np.stack([60 + 5 * time, 0 * time, 90 + np.sin(9 * time)], axis=1)
    image = pixels(view.trajectories({"tip": (time, places)}, tmp_path / "t.png"))
    assert 0.005 < inked(image) < 0.5
    with pytest.raises(ValueError, match=r"tip: .*\(20, 3\)"):
        view.trajectories({"tip": (time, places[:5])}, tmp_path / "no.png")
    with pytest.raises(ValueError, match="no landmarks"):
        view.trajectories({}, tmp_path / "no.png")
    assert os.listdir(tmp_path) == ["t.png"]


@pytest.mark.parametrize("suffix", ["", "_J"])
def test_energy_plot(tmp_path, suffix):
    time = np.linspace(0, 0.5, 20)
    columns = {"kinetic": time**2, "work_gravity": -time, "balance": 1e-6 * time}
    table = {"time_s": time} | {name + suffix: values for name, values in columns.items()}
    image = pixels(view.energy_plot(table, tmp_path / "e.png"))
    assert 0.005 < inked(image) < 0.5
    with pytest.raises(ValueError, match="time_s"):
        view.energy_plot({"kinetic_J": time}, tmp_path / "no.png")


def test_laws(tmp_path):
    folder = Path(__file__).parent.parent / "demos"
    code = (
        f"import sys, json; sys.path.insert(0, {str(folder)!r}); import laws; "
        f"print(json.dumps(laws.main({str(tmp_path)!r})))"
    )
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert answer.returncode == 0, answer.stderr
    numbers = json.loads(answer.stdout)
    assert numbers["f_at_1"] == pytest.approx(1.0)
    assert numbers["stretch_of_largest_f"] == pytest.approx(1.0, abs=1e-3)
    assert numbers["g_at_0"] == pytest.approx(0.7)
    assert numbers["g_at_-25"] == pytest.approx(0.2)
    assert numbers["passive_stress_at_rest_Pa"] == 0
    assert numbers["passive_against_UFL"] < 1e-12
    pictures = sorted(tmp_path.glob("fig*.png"))
    assert len(pictures) == 5 and all(inked(pixels(path)) > 0.01 for path in pictures)


# -- what goes wrong ---------------------------------------------------------------------------


def test_bad_input_is_refused_before_anything_is_drawn(body, tmp_path):
    path = tmp_path / "no.png"
    good = state_of(body)
    torn = State(0.02, np.full_like(body.points, np.nan), good.velocity, good.pressure)
    other = state_of(block_body(cells=(1, 1, 1)))
    with pytest.raises(ValueError, match="no states"):
        view.contact_sheet(body, [], path)
    with pytest.raises(ValueError, match=r"t = 0\.02 s.*displacement is not finite"):
        view.contact_sheet(body, [good, torn], path)
    with pytest.raises(ValueError, match=r"state 0 .*shape"):
        view.animation(body, [other], tmp_path / "no.gif")
    with pytest.raises(ValueError, match="1 captions for 2 states"):
        view.contact_sheet(body, [good, good], path, captions=["only one"])
    with pytest.raises(ValueError, match="columns"):
        view.contact_sheet(body, [good], path, columns=0)
    with pytest.raises(OutOfRange, match="fps"):
        view.animation(body, [good], tmp_path / "no.gif", fps=0)
    with pytest.raises(UnknownName, match=r"colour .*pressure"):
        view.shape_picture(body, good, path, "taste")
    with pytest.raises(UnknownName, match=r"muscle .*across"):
        view.shape_picture(body, good, path, muscles=["heart"])
    with pytest.raises(UnknownName, match="region"):
        view.contact_sheet(body, [good], path, fixed=["moon"])
    with pytest.raises(ValueError, match="no muscles"):
        view.fibre_pictures(block_body(), tmp_path)
    assert os.listdir(tmp_path) == []


@needs_display
@pytest.mark.parametrize("draw", [view.contact_sheet, view.animation])
def test_failure_leaves_the_old_file_and_no_half_one(body, tmp_path, monkeypatch, draw):
    path = tmp_path / ("a.gif" if draw is view.animation else "a.png")
    path.write_bytes(b"the old one")
    calls = []

    def fail_late(*args, **kwargs):
        calls.append(1)
        if len(calls) > 9:
            raise BadMesh("the light went out")
        return original(*args, **kwargs)

    original = view.film.Film.draw
    monkeypatch.setattr(view.film.Film, "draw", fail_late)
    with pytest.raises(BadMesh, match="light"):
        draw(body, [state_of(body, 0.01 * k, 1e-3 * k) for k in range(12)], path)
    assert len(calls) == 10
    assert path.read_bytes() == b"the old one" and os.listdir(tmp_path) == [path.name]
