"""Surfaces, obstacles and rigid bodies as a careless user gives them: clear errors before a run."""

from functools import partial

import numpy as np
import pytest

from dolfin_tongue.anatomy.bones import mandible, opening
from dolfin_tongue.anatomy.scenes import published_mouth, report_mouth
from dolfin_tongue.base.errors import BadMesh, BadScene, OutOfRange, UnknownName
from dolfin_tongue.boundary import Attached, Contact, Gravity
from dolfin_tongue.boundary.contact import Barrier, ReportContact
from dolfin_tongue.boundary.sliding import Sliding, moved_onto
from dolfin_tongue.constitutive import ReportTissue
from dolfin_tongue.control import Control, Motion, Ramp, Recorded, SmoothMove, Still
from dolfin_tongue.direct import RungeKutta4
from dolfin_tongue.geometry.palate import Palate, report_palate
from dolfin_tongue.geometry.simple import block_body
from dolfin_tongue.record.fingerprint import fingerprint
from dolfin_tongue.record.run import simulate
from dolfin_tongue.rigid import (
    AngularSpring,
    LineMuscle,
    PointForce,
    RigidBody,
    RigidForce,
    Spring,
    StateForce,
)
from dolfin_tongue.scene.scene import Scene
from dolfin_tongue.scene.well_posed import check_static
from dolfin_tongue.surfaces import (
    Cylinder,
    Implicit,
    Plane,
    Sphere,
    Triangulated,
    faces_towards,
    overlap,
    read_surface,
)

ORIGIN, FAR = (0.0, 0.0, 0.0), (0.0, 0.0, 0.1)
BODY = block_body((0.03, 0.01, 0.01), (3, 1, 1))
TISSUE = (ReportTissue(), Gravity())
BELOW = Plane((0.0, 0.0, -1e-3))
POINTS = 0.01 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])


def bone(**changes):
    values = {"name": "bone", "regions": ("x0",), "mass": 0.1, "inertia": 1e-5, "centre": ORIGIN}
    return RigidBody(**(values | changes))


class Wrong(Motion):
    """A motion of a user."""

    def __init__(self, value):
        self.value = value

    def at(self, time):
        if self.value is None:
            raise ZeroDivisionError("by nothing")
        return self.value


class TooMuch(Control):
    """A control of a user."""

    def __call__(self, time):
        return 1.5


@pytest.mark.parametrize(
    "vector",
    [("a", "b", "c"), ("1", "2", "3"), (1j, 0, 0), [[0], [1, 2], 3], (True, 0, 0), "abc", None, {}],
)
@pytest.mark.parametrize(
    "make",
    [Plane, lambda v: Sphere(v, 1.0), lambda v: PointForce(ORIGIN, v), lambda v: bone(centre=v)],
)
def test_vectors_that_are_none(make, vector):
    with pytest.raises(OutOfRange, match="three finite numbers"):
        make(vector)


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: Sphere(ORIGIN, 1.0, "no"), OutOfRange, "inside = 'no'.*True or False"),
        (lambda: Cylinder(ORIGIN, FAR, 1.0, 1), OutOfRange, "True or False"),
        (lambda: Triangulated(POINTS, FACES[:3], sheet="x"), OutOfRange, "True or False"),
        (lambda: Triangulated(POINTS, [[0, 1, 2], [0, 1]]), BadMesh, "regular array"),
        (lambda: Triangulated(POINTS, FACES, retraction=3), OutOfRange, "retraction"),
        (lambda: Triangulated(POINTS, FACES).with_clearance(ORIGIN), BadMesh, r"shape \(k, 3\)"),
        (lambda: Implicit(lambda x: x[:, 2], gradient=3), OutOfRange, "gradient = 3"),
        (lambda: Implicit(lambda x: x[:, 2], lambda x: 1 / 0), OutOfRange, "gradient.*raises"),
        (lambda: Implicit(lambda x: x[:, 2], hessian=lambda x: "a"), OutOfRange, "hessian.*raises"),
        (lambda: overlap("x", POINTS), BadScene, "must be a surface"),
        (lambda: overlap(Plane(), ORIGIN), BadMesh, r"shape \(k, 3\)"),
        (lambda: overlap(Plane(), [[np.nan] * 3]), BadMesh, "finite"),
        (lambda: faces_towards(Plane(), BODY, 1e-3), BadScene, "a body first"),
        (lambda: faces_towards(BODY, Plane, 1e-3), BadScene, "must be a surface"),
        (
            lambda: moved_onto(BODY, Cylinder(ORIGIN, (1, 0, 0), 0.01), "z0"),
            BadScene,
            "axis or centre",
        ),
        (lambda: Palate(top=("a", "b")), OutOfRange, "two finite numbers"),
        (lambda: Palate(front="a"), OutOfRange, "increasing"),
        (lambda: Palate(height=11.0, half_width=23.0), OutOfRange, "millimetres"),
        (lambda: report_palate(1e-6), OutOfRange, "at least"),
        (lambda: report_palate(palate=Palate), BadScene, "takes measures"),
    ],
)
def test_surfaces(make, error, message):
    with pytest.raises(error, match=message):
        make()


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: Contact(BELOW, ["boundary"]), BadScene, "name of one"),
        (lambda: Contact(BELOW, law=Barrier(steep="a")), OutOfRange, "steep"),
        (lambda: Contact(BELOW, law=Barrier(steep=np.inf)), OutOfRange, "steep"),
        (lambda: Contact(BELOW, law=ReportContact(a2=None)), OutOfRange, "a2"),
        (lambda: Contact(BELOW, motion=(Still,) * 3), BadScene, "along x is the class Still"),
        (lambda: Contact(BELOW, motion=(Wrong(0.0),) * 3), BadScene, "three finite numbers"),
        (lambda: Contact(Implicit(lambda x: np.log(x[:, 2]))), BadScene, r"no distance \(NaN\)"),
        (lambda: Contact(Plane()), BadScene, "on or behind the obstacle, the deepest by 0 m"),
    ],
)
def test_contacts(make, error, message):
    with np.errstate(all="ignore"), pytest.raises(error, match=message):
        Scene(BODY, (*TISSUE, make()))


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: bone(regions=None), BadScene, "tuple of names"),
        (lambda: bone(forces=None), BadScene, "tuple of them"),
        (lambda: bone(forces=(f for f in [AngularSpring(1.0)])), BadScene, "tuple of them"),
        (lambda: bone(forces=(RigidForce(),)), BadScene, "take StateForce"),
        (lambda: bone(motion=Still()), BadScene, "must map coordinates"),
        (lambda: bone(motion={"x": Still}), BadScene, "is the class Still"),
        (lambda: bone(motion={"x": Wrong((np.nan, 0, 0))}), BadScene, "three finite numbers"),
        (lambda: bone(motion={"x": Wrong(None)}), BadScene, "raises ZeroDivisionError"),
        (lambda: bone(centre=(85.0, 0.0, 75.0)), BadScene, "centre .* m from the tissue.*1e-3"),
        (lambda: bone(forces=(Spring(ORIGIN, (0, 0, 90.0)),)), BadScene, "anchor of a Spring"),
        (lambda: Spring(ORIGIN, FAR, to=bone()), BadScene, "to must be the name"),
        (
            lambda: LineMuscle(ORIGIN, FAR, activation=TooMuch()),
            OutOfRange,
            r"t = 0 s = 1.5.*\[0, 1\]",
        ),
        (lambda: LineMuscle(ORIGIN, FAR, activation=Ramp(0.5), law=None), BadScene, "law must be"),
        (lambda: StateForce(lambda t: [0, 0, 0]), BadScene, "raises TypeError"),
        (lambda: StateForce(lambda t, q, v: "abc"), BadScene, "three finite numbers"),
        (lambda: Recorded(("a", "b"), (0, 1)), BadScene, "must be numbers"),
        (lambda: Recorded(0.0, 1.0), BadScene, "must be numbers"),
        (lambda: opening(share="a"), OutOfRange, "share"),
        (lambda: mandible("x0", motion=Still()), BadScene, "must map coordinates"),
        (lambda: report_mouth({}, "palate"), BadScene, "tuple of names"),
        (lambda: report_mouth({}, ("hyoid",), motion=opening()), BadScene, "no mandible"),
        (lambda: published_mouth("/nowhere", {}, ("palat",)), UnknownName, "unknown part"),
    ],
)
def test_rigid_bodies_and_mouths(make, error, message):
    with pytest.raises(error, match=message):
        Scene(BODY, TISSUE, (make(),))


@pytest.mark.parametrize(
    ("support", "names"),
    [
        ([Sliding(Plane(), "z0")], "the body"),
        ([bone()], "the body with bone"),
        (
            [
                bone(motion={"x": Still(), "z": Still()}),
                Sliding(Plane((0.03, 0, 0), (1, 0, 0)), "x1"),
            ],
            None,
        ),
        ([bone(forces=(Spring(ORIGIN, FAR, damping=1.0),))], "the body with bone"),
        ([Attached("x0"), bone(regions=())], "bone"),
        ([bone(motion=dict.fromkeys(("x", "z", "angle"), Still()))], None),
        ([bone(motion={"x": Still(), "z": Still()}, forces=(AngularSpring(1.0),))], None),
        ([Sliding(Plane(), "z0"), Attached("top")], None),
        ([Attached("x0"), bone(regions=("x1",))], None),
    ],
)
def test_statics_of_what_nothing_holds(support, names):
    sets = {**BODY.node_sets, "top": BODY.nodes("x0")[-2:]}
    scene = Scene(
        type(BODY)(BODY.points, BODY.cells, sets, surfaces=BODY.surfaces), TISSUE, tuple(support)
    )
    if names is None:
        check_static(scene)
        return
    with pytest.raises(BadScene, match=f"nothing resists a rigid motion of {names}\\. "):
        check_static(scene)


LEVEL = 0.01


def level(height, x):
    return x[:, 2] + height


class Shelf:
    def __init__(self, height):
        self.height = height

    def at(self, x):
        return x[:, 2] + self.height


def test_runs_with_other_functions_are_other_runs(monkeypatch):
    def key(function):
        return fingerprint(Scene(BODY, (*TISSUE, Contact(Implicit(function)))))

    pairs = [
        (partial(level, 0.01), partial(level, 0.02)),
        (Shelf(0.01).at, Shelf(0.02).at),
        (lambda x: level(0.01, np.sin(x)), lambda x: level(0.01, np.tan(x))),
    ]
    for first, second in pairs:
        assert key(first) != key(second)
    assert key(partial(level, 0.01)) == key(partial(level, 0.01))

    def by_name(x):
        return x[:, 2] + LEVEL

    before = key(by_name)
    monkeypatch.setitem(globals(), "LEVEL", 0.02)
    assert key(by_name) != before


def test_another_scene_is_not_called_a_damaged_file(tmp_path):
    def run(depth, resume):
        scene = Scene(BODY, (*TISSUE, Contact(Plane((0, 0, -depth)))), (Attached("x0"),))
        return simulate(scene, 1e-4, tmp_path, RungeKutta4(5e-5), resume=resume)

    run(1e-3, resume=False)
    assert run(1e-3, resume=True).last.time == 1e-4
    with pytest.raises(BadScene, match=r"^(?!.*damaged).*holds a run of another scene"):
        run(2e-3, resume=True)


def test_a_file_that_names_missing_points(tmp_path):
    file = tmp_path / "surface.obj"
    file.write_text("v 0 0 0\nv 0.01 0 0\nv 0 0.01 0\nf 1 2 3\nf 1 2 99\n", encoding="utf-8")
    with pytest.raises(BadMesh, match=r"triangle\(s\) 1 name points that the file does not have"):
        read_surface(file, sheet=True)


def test_moves_that_are_good_stay_so():
    """Lists for tuples, an array for three numbers, a float of NumPy: the same motion."""

    def last(distance, centre, several):
        motion = (Still(), Still(), SmoothMove(distance))
        spring = Spring(ORIGIN, FAR, stiffness=10.0, rest=0.05)
        bones = bone(regions=several(["x0"]), forces=several([spring]), centre=centre)
        contact = Contact(BELOW, motion=motion)
        scene = Scene(BODY, (*TISSUE, contact), (bones,))
        *_, state = RungeKutta4(5e-5).solver(scene).march(1e-4)
        return state, contact.shift(0.1)[0]

    plain, way = last(-1e-3, ORIGIN, tuple)
    other, other_way = last(np.float64(-1e-3), np.zeros(3), list)
    assert way == pytest.approx([0.0, 0.0, -5e-4])  # half of it after half of 0.2 s
    assert (other_way == way).all()
    assert (other.displacement == plain.displacement).all()
    assert (other.rigid == plain.rigid).all()
    # down: its weight is 0.98 N and more, the spring pulls up with 0.5 N
    assert plain.rigid[0, 1] < 0
