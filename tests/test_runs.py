"""Runs that say what they are: every start, pair and method; described, read back, resumed."""

from __future__ import annotations

import importlib
import inspect
import json
import pkgutil
import subprocess
import sys
from dataclasses import dataclass, replace

import numpy as np
import pytest

import dolfin_tongue
from dolfin_tongue.base.errors import BadScene, OutOfRange
from dolfin_tongue.base.values import Parameter
from dolfin_tongue.body import Body, State
from dolfin_tongue.boundary import Attached, Barrier, Contact, Gravity, Sliding
from dolfin_tongue.boundary.contact import ContactLaw
from dolfin_tongue.constitutive import ActiveMuscles, MooneyRivlin, ReportTissue, Viscosity
from dolfin_tongue.control import Control, Motion, Ramp, SmoothMove, Still, Table
from dolfin_tongue.direct import Adaptive, RungeKutta4, TrBdf2
from dolfin_tongue.geometry.simple import block_body
from dolfin_tongue.record import load_run, simulate
from dolfin_tongue.record.codec import ROOMS, Decoder, Encoder
from dolfin_tongue.record.frames import Frames
from dolfin_tongue.rigid import LineMuscle, RigidBody, RigidForce, Spring, StateForce
from dolfin_tongue.scene import Scene
from dolfin_tongue.surfaces import Ellipsoid, Implicit, Plane, Sphere, Surface, Triangulated
from dolfin_tongue.terms import Support, Term

PAIRS = ("Q1/P0", "Q2/P1", "P2/P1")


def block(**options):
    return block_body((0.02, 0.01, 0.01), (2, 1, 1), muscles={"along": (1, 0, 0)}, **options)


def muscle_scene(**options) -> Scene:
    pull = ActiveMuscles({"along": Ramp(0.3, 0.0, 0.01)}, 20e3)
    return Scene(block(**options), (ReportTissue(), Viscosity(20.0), pull), (Attached("x0"),))


def generalised(dt=2e-3, **options):
    pytest.importorskip("dolfinx")
    from dolfin_tongue.fenicsx import GeneralisedAlpha

    return GeneralisedAlpha(dt, **options)


# -- every pair and method ------------------------------------------------------------------------


@pytest.mark.parametrize("pair", PAIRS)
def test_every_pair_is_recorded_resumed_and_read_back(pair, tmp_path):
    scene, method = muscle_scene(), generalised()
    whole = simulate(scene, 0.02, tmp_path / "a", method, pair=pair, frame_interval=0.01)
    simulate(scene, 0.01, tmp_path / "b", method, pair=pair, frame_interval=0.01)
    parts = simulate(
        scene, 0.02, tmp_path / "b", method, pair=pair, frame_interval=0.01, resume=True
    )
    scale = np.abs(whole.last.displacement).max()
    assert np.abs(whole.last.displacement - parts.last.displacement).max() < 1e-3 * scale
    assert whole.method.pair == pair and len(whole.frames) == 3
    read = load_run(tmp_path / "b")
    assert read.method == parts.method and read.summary == parts.summary
    assert [frame.time for frame in read.frames] == pytest.approx([0.0, 0.01, 0.02])
    for name in ("displacement", "velocity", "pressure"):
        np.testing.assert_array_equal(getattr(read.last, name), getattr(parts.last, name))
        np.testing.assert_array_equal(getattr(read.frames[-1], name), getattr(parts.last, name))
    stress = read.solver.fields(read.frames[-1]).cauchy
    np.testing.assert_allclose(stress, parts.solver.fields(parts.last).cauchy, rtol=1e-12)
    # a state of a quadratic displacement is more than its nodal values
    assert (read.last.unknowns is None) == (pair == "Q1/P0")


def test_a_pair_is_refused_by_the_direct_solver(tmp_path):
    with pytest.raises(BadScene, match=r"TrBdf2 has one pair of spaces.*Q2/P1"):
        simulate(muscle_scene(), 0.01, tmp_path, TrBdf2(), pair="Q2/P1")
    assert not any(tmp_path.iterdir())


# -- starts ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("pair", ["direct", *PAIRS])
def test_an_initial_velocity(pair, tmp_path):
    """A free block that is thrown keeps its velocity: its centre of mass moves by v t."""
    scene = Scene(block(), (ReportTissue(), Viscosity(20.0)))
    method = TrBdf2(2e-3) if pair == "direct" else generalised(pair=pair)
    run = simulate(scene, 0.02, tmp_path, method, start=(0.1, 0.0, -0.2))
    np.testing.assert_allclose(run.last.displacement, [[2e-3, 0.0, -4e-3]] * 12, atol=1e-12)
    assert run.summary["exchanged_energy_J"] == pytest.approx(0.0, abs=1e-15)


def test_a_state_of_one_solver_starts_the_other(tmp_path):
    scene = muscle_scene()
    first = simulate(scene, 0.02, tmp_path / "a", TrBdf2(1e-3))
    second = simulate(scene, 0.04, tmp_path / "b", generalised(1e-3), start=first.last)
    whole = simulate(scene, 0.04, tmp_path / "c", TrBdf2(1e-3))
    assert second.frames[0].time == 0.02
    assert [frame.time for frame in second.frames] == pytest.approx([0.02, 0.04])
    scale = np.abs(whole.last.displacement).max()
    assert np.abs(second.last.displacement - whole.last.displacement).max() < 1e-3 * scale


def test_a_static_equilibrium_starts_a_motion_at_rest(tmp_path):
    generalised()
    from dolfin_tongue.fenicsx import Statics

    scene = Scene(block(), (ReportTissue(), Viscosity(20.0), Gravity()), (Attached("x0"),))
    rest = replace(Statics(scene).solve(), time=0.0)
    for number, method in enumerate((TrBdf2(2e-3), generalised())):
        run = simulate(scene, 0.05, tmp_path / str(number), method, start=rest)
        assert np.abs(run.last.displacement - rest.displacement).max() < 1e-7


@pytest.mark.parametrize(
    "start, text",
    [
        ((1.0, 2.0), r"velocity of shape \(3,\)"),
        ((np.nan, 0.0, 0.0), "finite"),
        (State(0.0, np.zeros((4, 3)), np.zeros((4, 3)), np.zeros(2)), "displacement must be"),
        (State(0.0, np.zeros((12, 3)), np.zeros((12, 3)), np.zeros(3)), "pressure must be"),
    ],
)
def test_starts_that_do_not_fit_are_refused(start, text, tmp_path):
    with pytest.raises(BadScene, match=text):
        simulate(muscle_scene(), 0.01, tmp_path, TrBdf2(), start=start)
    assert not any(tmp_path.iterdir())


def test_an_end_before_the_start_is_refused(tmp_path):
    late = replace(TrBdf2().solver(muscle_scene()).rest(), time=0.5)
    with pytest.raises(OutOfRange, match=r"end = 0\.4"):
        simulate(muscle_scene(), 0.4, tmp_path, TrBdf2(), start=late)


# -- descriptions ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class Half(Control):
    """Half of something."""

    level: float

    def __call__(self, time):
        return self.level / 2


def rich_scene() -> Scene:
    """Values, sets, contacts, sliding nodes, bones: what a description has to hold."""
    body = replace(
        block(), cell_sets={"front": np.array([1])}, density={"front": 1100.0, "elsewhere": 1040.0}
    )
    sets = body.node_sets | {"end": np.setdiff1d(body.nodes("x1"), body.nodes("y0"))}
    body = replace(body, node_sets=sets)
    body = replace(body, points=body.points + np.array([0.0, 0.0, 1e-3]))
    corners = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * 0.05
    sheet = Triangulated(corners, np.array([[0, 1, 2], [0, 2, 3]]), sheet=True)
    motion = (Still(), Still(), SmoothMove(1e-4))
    bone = RigidBody(
        "bone", ("end",), 0.02, 1e-5, (0.025, 0.005, 0.005),
        (
            Spring((0.02, 0, 0.01), (0.05, 0, 0.03), 5.0),
            LineMuscle((0.02, 0, 0.01), (0.05, 0, 0.03), activation=Table((0, 1), (0, 0.2))),
        ),
        motion={"z": Still()},
    )  # fmt: skip
    terms = (
        ReportTissue(a0=Parameter("stiffness", 500.0)),
        Viscosity(np.array([20.0, 30.0])),
        Gravity(),
        ActiveMuscles({"along": Half(0.4)}, max_stress={"along": 1e4}),
        Contact(sheet, "z0", Barrier(), motion),
    )
    return Scene(body, terms, (Sliding(Plane((0, 0.0, 0), (0, 1, 0)), "y0"), bone))


def test_a_rich_scene_is_read_back_with_all_its_numbers(tmp_path):
    scene = rich_scene()
    run = simulate(scene, 0.01, tmp_path, TrBdf2(2e-3))
    read = load_run(tmp_path, own=(Half,))
    assert [type(term) for term in read.scene.terms] == [type(term) for term in scene.terms]
    solver = TrBdf2(2e-3).solver(read.scene)
    *_, last = solver.march(0.01)
    np.testing.assert_array_equal(last.displacement, run.last.displacement)
    np.testing.assert_array_equal(last.rigid, run.last.rigid)
    assert read.scene.parameters == {"stiffness": 500.0}
    with pytest.raises(BadScene, match=r"test_runs.Half.*own="):
        load_run(tmp_path)


def test_a_description_says_by_what_and_when(tmp_path):
    simulate(muscle_scene(), 0.01, tmp_path, TrBdf2(2e-3))
    simulate(muscle_scene(), 0.02, tmp_path, TrBdf2(2e-3), resume=True)
    content = json.loads((tmp_path / "scene.json").read_text(encoding="utf-8"))
    first, second = content["sessions"]
    assert first["from_s"] == 0.0 and second["from_s"] == 0.01
    assert first["command"] == sys.argv
    assert first["versions"]["dolfin-tongue"] == dolfin_tongue.__version__
    assert {"python", "numpy", "scipy"} <= set(first["versions"])
    assert content["method"]["fields"]["dt"] == 2e-3


def test_a_scene_with_functions_says_what_to_hand_over(tmp_path):
    def wave(x):
        return x[2] + 0.02 + 0.001 * np.sin(x[0]) if x.ndim == 1 else x[:, 2] + 0.02

    def push(time, q, v):
        return np.array([0.001, 0.0, 0.0])

    bone = RigidBody("bone", ("x1",), 0.02, 1e-5, (0.025, 0.005, 0.005), (StateForce(push),))
    wall = Implicit(lambda x: x[:, 2] + 0.02, gradient=None)
    scene = Scene(
        block(), (ReportTissue(), Viscosity(20.0), Contact(wall, "z0")), (Attached("x0"), bone)
    )
    run = simulate(scene, 0.01, tmp_path, TrBdf2(2e-3))
    with pytest.raises(BadScene, match=r"holds the function .*<lambda>.*scene="):
        load_run(tmp_path)
    read = load_run(tmp_path, scene=scene)
    np.testing.assert_array_equal(read.frames[-1].displacement, run.frames[-1].displacement)


def test_every_class_of_the_package_can_be_read_back():
    """Whatever a scene may be made of is found by its name."""
    bases = (Term, Support, Control, Motion, RigidForce, Surface, ContactLaw)
    known = {
        name: item for room in ROOMS for name, item in vars(importlib.import_module(room)).items()
    }
    for module in pkgutil.walk_packages(dolfin_tongue.__path__, "dolfin_tongue."):
        if module.name.endswith("__main__"):
            continue
        for name, item in inspect.getmembers(importlib.import_module(module.name), inspect.isclass):
            concrete = issubclass(item, bases) and not inspect.isabstract(item)
            concrete = concrete and not name.startswith("_")
            if concrete and item.__module__.startswith("dolfin_tongue") and item not in bases:
                assert known.get(name) is item, f"{name} is exported by no room"


@pytest.mark.parametrize(
    "value",
    [
        Sphere((0.0, 0.0, 0.1), 0.1, inside=True),
        Ellipsoid((0.0, 0.0, 0.0), (0.1, 0.2, 0.3)),
        (1, 2.5, None, True, "text", {"a": (1,)}, [np.float64(2.0)]),
        Adaptive(1e-6, rtol=1e-4, pair="RK45"),
        RungeKutta4(1e-4),
        {"density": {"front": 1100.0}, "x": Parameter("p", 1.0)},
    ],
    ids=lambda value: type(value).__name__,
)
def test_what_is_encoded_is_decoded(value):
    encoder = Encoder()
    text = json.dumps(encoder.encode(value))
    assert Decoder(encoder.arrays).decode(json.loads(text)) == value


@pytest.mark.parametrize(
    "name, damage, text",
    [
        ("scene.json", lambda path: path.write_text("{"), "cannot be read"),
        ("scene.json", lambda path: path.unlink(), "holds no run"),
        ("scene.npz", lambda path: path.write_bytes(b"PK"), "cannot be read"),
        ("checkpoint.npz", lambda path: path.unlink(), "cannot be read"),
        ("fields.xdmf", lambda path: path.write_text("<Xdmf>"), "cannot be read"),
    ],
)
def test_damaged_folders_are_refused(name, damage, text, tmp_path):
    simulate(muscle_scene(), 0.004, tmp_path, TrBdf2(2e-3))
    damage(tmp_path / name)
    with pytest.raises(BadScene, match=text):
        load_run(tmp_path)


def test_a_description_runs_no_code(tmp_path):
    """Names of modules, functions and classes outside of the package are not looked up."""
    simulate(muscle_scene(), 0.004, tmp_path, TrBdf2(2e-3))
    path = tmp_path / "scene.json"
    for name in ("os.system", "dolfin_tongue.app.cli.app", "subprocess.Popen", "simulate"):
        content = json.loads(path.read_text(encoding="utf-8"))
        content["method"] = {"class": name, "fields": {"args": "true"}}
        path.write_text(json.dumps(content), encoding="utf-8")
        with pytest.raises(BadScene, match="does not know"):
            load_run(tmp_path)


# -- frames ---------------------------------------------------------------------------------------


def test_frames_are_read_from_a_folder_as_they_are_asked_for(tmp_path):
    run = simulate(muscle_scene(), 0.02, tmp_path, TrBdf2(1e-3), frame_interval=0.005)
    frames = Frames(tmp_path, run.scene.body)
    assert len(frames) == 5 and frames.times == pytest.approx([0.0, 0.005, 0.01, 0.015, 0.02])
    assert [frame.time for frame in frames] == frames.times
    assert [frame.time for frame in frames[1:3]] == frames.times[1:3]
    np.testing.assert_array_equal(frames[-1].displacement, run.last.displacement)
    with pytest.raises(IndexError):
        frames[5]
    other = block_body((0.02, 0.01, 0.01), (3, 1, 1))
    with pytest.raises(ValueError, match="does not belong to"):
        Frames(tmp_path, other)[0]


def test_frames_of_several_kinds_of_cells_are_valid_xdmf(tmp_path, monkeypatch):
    import meshio

    brick = block_body((0.01, 0.01, 0.01), (2, 1, 1))
    one, two = brick.cells
    prisms = np.array([two[[0, 1, 2, 4, 5, 6]], two[[0, 2, 3, 4, 6, 7]]])
    body = Body(brick.points, {"hexahedron8": one[None], "prism6": prisms}, brick.node_sets)
    scene = Scene(body, (MooneyRivlin(), Viscosity(20.0), Gravity()), (Attached("x0"),))
    run = simulate(scene, 0.02, tmp_path, TrBdf2(2e-3), frame_interval=0.01)
    monkeypatch.chdir(tmp_path)  # meshio takes the names of files from where it runs
    with meshio.xdmf.TimeSeriesReader("fields.xdmf") as reader:
        points, cells = reader.read_points_cells()
        time, at_points, at_cells = reader.read_data(2)
    assert {block.type: len(block.data) for block in cells} == {"hexahedron": 1, "wedge": 2}
    assert time == 0.02 and len(points) == 12
    np.testing.assert_array_equal(at_points["displacement"], run.last.displacement)
    np.testing.assert_array_equal(np.concatenate(at_cells["pressure"]), run.last.pressure)


# -- where FEniCSx is not installed, and under MPI --------------------------------------------------


def run_python(code: str, *before: str) -> str:
    done = subprocess.run(
        [*before, sys.executable, "-c", code], capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_the_direct_solver_runs_where_fenicsx_is_not_installed(tmp_path):
    """Scene, run, tables, frames and reading back, with every import of those libraries refused."""
    out = run_python(f"""
import sys
class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in ("ufl", "basix", "dolfinx", "ffcx", "petsc4py", "mpi4py", "gmsh"):
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
sys.meta_path.insert(0, Absent())
import dolfin_tongue as dt
from dolfin_tongue.boundary import Contact
from dolfin_tongue.geometry.simple import block_body
from dolfin_tongue.surfaces import Implicit
body = block_body((0.02, 0.01, 0.01), (2, 1, 1), muscles={{"along": (1, 0, 0)}})
wall = Contact(Implicit(lambda x: x[:, 2] + 0.002), "z0")
terms = (dt.ReportTissue(), dt.Viscosity(20.0), dt.Gravity(), wall)
muscle = dt.ActiveMuscles({{"along": dt.SmoothRamp(0.3)}}, 2e4)
scene = dt.Scene(body, (*terms, muscle), (dt.Attached("x0"),))
dt.simulate(scene, 0.02, {str(tmp_path)!r}, dt.TrBdf2(2e-3))
run = dt.load_run({str(tmp_path)!r}, scene=scene)
print(len(run.frames), run.solver.fields(run.last).cauchy.shape)
""")
    assert out.split("\n")[0] == "2 (16, 3, 3)"


def test_two_processes_of_mpi_finish(tmp_path):
    """Each process runs on its own: no vector of theirs is shared (a hang for ever before)."""
    pytest.importorskip("dolfinx")
    import shutil

    if shutil.which("mpirun") is None:
        pytest.skip("mpirun is not installed")
    code = f"""
import dolfin_tongue as dt
from mpi4py import MPI
from dolfin_tongue.geometry.simple import block_body
scene = dt.Scene(block_body((0.02, 0.01, 0.01), (2, 1, 1)),
    (dt.ReportTissue(), dt.Viscosity(20.0), dt.Gravity()), (dt.Attached("x0"),))
folder = {str(tmp_path)!r} + f"/{{MPI.COMM_WORLD.rank}}"
run = dt.simulate(scene, 0.01, folder, dt.GeneralisedAlpha(2e-3))
state = dt.Statics(scene).solve()
print("end", run.last.time, state.load)
"""
    command = ("mpirun", "-n", "2", "--oversubscribe", "--allow-run-as-root")
    assert run_python(code, *command).count("end 0.01 1.0") == 2
