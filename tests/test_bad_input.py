"""Bad input gets a clear error before any solve."""

from dataclasses import replace

import numpy as np
import pytest

from dolfin_tongue.base.errors import BadMesh, BadScene, OutOfRange, UnknownName
from dolfin_tongue.body.fibres import Fibres, MuscleFibres
from dolfin_tongue.boundary import Attached, Gravity
from dolfin_tongue.constitutive import (
    ActiveMuscles,
    FibreReinforcedTissue,
    MooneyRivlin,
    ReportTissue,
    Viscosity,
)
from dolfin_tongue.control import Constant, Ramp, SmoothRamp, Step, Table
from dolfin_tongue.fenicsx import Statics
from dolfin_tongue.geometry.simple import block_body
from dolfin_tongue.scene.scene import Scene

BODY = block_body((0.03, 0.01, 0.01), (3, 1, 1), muscles={"genioglossus": (1.0, 0.0, 0.0)})


def test_unknown_muscle_lists_the_known_ones():
    with pytest.raises(UnknownName, match=r"unknown muscle 'genoglossus'.*genioglossus"):
        Scene(BODY, (ActiveMuscles({"genoglossus": Constant(0.5)}),))
    with pytest.raises(UnknownName, match="known muscle names: genioglossus"):
        Scene(BODY, (FibreReinforcedTissue(muscle="styloglossus"),))


def test_unknown_region_lists_the_known_ones():
    with pytest.raises(UnknownName, match=r"unknown region 'hyoid'.*x0, x1, y0"):
        Scene(BODY, (ReportTissue(),), (Attached("hyoid"),))
    with pytest.raises(UnknownName, match="landmark"):
        BODY.landmark("tip")


@pytest.mark.parametrize("value", [-0.1, 1.01, np.nan, np.inf])
@pytest.mark.parametrize("control", [Constant, Step, Ramp, SmoothRamp])
def test_activation_outside_the_unit_interval(control, value):
    with pytest.raises(OutOfRange, match=r"activation = .* must be in \[0, 1\]"):
        control(value)


def test_bad_tables():
    with pytest.raises(OutOfRange, match="row 1"):
        Table((0.0, 1.0), (0.0, np.nan))
    with pytest.raises(BadScene, match="must increase: row 2"):
        Table((0.0, 0.2, 0.2), (0.0, 0.1, 0.2))
    with pytest.raises(BadScene, match="as many times as values"):
        Table((0.0, 0.2), (0.0,))
    with pytest.raises(BadScene, match="at least one"):
        Table((), ())
    with pytest.raises((OutOfRange, BadScene)):
        Table((0.0, np.nan), (0.0, 0.1))


@pytest.mark.parametrize("duration", [0.0, -1.0, np.nan])
def test_bad_ramp_duration(duration):
    with pytest.raises(OutOfRange, match="duration"):
        Ramp(0.5, 0.0, duration)


def test_coordinates_that_are_not_numbers():
    points = BODY.points.copy()
    points[4, 1] = np.nan
    with pytest.raises(BadMesh, match=r"node\(s\) 4 are not finite"):
        replace(BODY, points=points)


def test_inverted_cells_are_listed():
    cells = BODY.cells.copy()
    cells[1] = cells[1][[4, 5, 6, 7, 0, 1, 2, 3]]
    with pytest.raises(
        BadMesh, match=r"1 inverted hexahedron8 cell\(s\).*: 1\. Check the node order"
    ):
        replace(BODY, cells=cells)


def test_cells_that_name_missing_nodes_and_unused_nodes():
    cells = BODY.cells.copy()
    cells[0, 0] = 99
    with pytest.raises(BadMesh, match="99"):
        replace(BODY, cells=cells)
    with pytest.raises(BadMesh, match=r"belong to no cell"):
        replace(BODY, points=np.vstack([BODY.points, [[1.0, 1.0, 1.0]]]))


@pytest.mark.parametrize("vector", [(0.0, 0.0, 0.0), (2.0, 0.0, 0.0), (np.nan, 0.0, 1.0)])
def test_fibres_that_are_not_unit_vectors(vector):
    with pytest.raises(BadMesh, match="unit vectors; not so in cells 1"):
        MuscleFibres("m", np.array([0, 1]), np.array([(1.0, 0, 0), vector]), np.ones(2))


def test_bad_fibre_density_and_repeated_cells():
    unit = np.array([(1.0, 0, 0)] * 2)
    with pytest.raises(OutOfRange, match="density of 'm' in cell 3"):
        MuscleFibres("m", np.array([2, 3]), unit, np.array([1.0, -1.0]))
    with pytest.raises(BadMesh, match="more than once"):
        MuscleFibres("m", np.array([2, 2]), unit, np.ones(2))
    with pytest.raises(BadMesh, match="not there"):
        replace(BODY, fibres=Fibres((MuscleFibres("m", np.array([2, 3]), unit, np.ones(2)),)))
    with pytest.raises(BadMesh, match="used twice"):
        Fibres((BODY.fibres.muscles[0],) * 2)


@pytest.mark.parametrize("density", [0.0, -1.0, np.nan])
def test_bad_mass_density(density):
    with pytest.raises(OutOfRange, match="density"):
        replace(BODY, density=density)


def test_static_problem_without_attachment():
    with pytest.raises(BadScene, match=r"needs attachments.*0 node\(s\).*Attached"):
        Statics(Scene(BODY, (ReportTissue(), Gravity())))
    line = replace(BODY, node_sets={"line": np.array([0, 1, 2, 3])})
    assert np.ptp(BODY.points[:4, 1:], axis=0).max() == 0  # these nodes lie on one line
    with pytest.raises(BadScene, match="do not lie on one line"):
        Statics(Scene(line, (ReportTissue(),), (Attached("line"),)))


def test_scenes_that_contradict_themselves():
    with pytest.raises(BadScene, match="at least one term"):
        Scene(BODY, ())
    with pytest.raises(BadScene, match="not a term"):
        Scene(BODY, (Attached("x0"),))
    with pytest.raises(BadScene, match="not a support"):
        Scene(BODY, (ReportTissue(),), (Gravity(),))
    with pytest.raises(BadScene, match=r"both Attached\(x0\) and Attached\(y0\)"):
        Scene(BODY, (ReportTissue(),), (Attached("x0"), Attached("y0")))
    with pytest.raises(BadScene, match="without muscles"):
        ActiveMuscles({})


@pytest.mark.parametrize(
    "make",
    [
        lambda: ReportTissue(a0=0.0),
        lambda: ReportTissue(a2=-6.0),
        lambda: ReportTissue(a1=np.nan),
        lambda: FibreReinforcedTissue(a3=-1.0, muscle="genioglossus"),
        lambda: MooneyRivlin(c10=-1.0),
        lambda: MooneyRivlin(c20=-1.0),
        lambda: Viscosity(0.0),
        lambda: Viscosity(np.inf),
        lambda: ActiveMuscles({"genioglossus": Constant(0.1)}, max_stress=-1.0),
        lambda: Gravity((0.0, np.nan, 0.0)),
        lambda: Gravity((0.0, 1.0)),
    ],
)
def test_numbers_without_physical_sense(make):
    with pytest.raises(OutOfRange):
        make()


def test_cells_that_repeat_or_overlap():
    cells = BODY.cells.copy()
    cells[0, 1] = cells[0, 0]
    with pytest.raises(BadMesh, match=r"cell\(s\) 0 name a node twice|belong to no cell"):
        replace(BODY, cells=cells)
    with pytest.raises(BadMesh, match="listed twice"):
        replace(BODY, cells=np.vstack([BODY.cells, BODY.cells[:1]]), fibres=Fibres())


@pytest.mark.parametrize("nodes", [np.ones(16, dtype=bool), [0.5, 1.0], ["a"], [1 + 0j]])
def test_node_numbers_must_be_whole(nodes):
    with pytest.raises(BadMesh, match="whole numbers"):
        replace(BODY, node_sets={"held": nodes})


def test_lists_are_taken():
    body = replace(BODY, points=BODY.points.tolist(), node_sets={"held": [0, 1]})
    assert body.nodes("held").dtype.kind == "i" and body.points.shape == BODY.points.shape


def test_millimetres_are_noticed():
    with pytest.raises(BadMesh, match="multiply by 1e-3"):
        replace(BODY, points=1e3 * BODY.points)


@pytest.mark.parametrize("control", [0.5, Ramp, None, lambda t: 0.5])
def test_controls_that_are_none(control):
    with pytest.raises(BadScene, match="is no control"):
        ActiveMuscles({"genioglossus": control})
    with pytest.raises(BadScene, match="must map"):
        ActiveMuscles(["genioglossus"])


@pytest.mark.parametrize("make", [lambda x: Viscosity(x), lambda x: Constant(x), Ramp])
@pytest.mark.parametrize("value", ["0.5", None, True])
def test_numbers_that_are_none(make, value):
    with pytest.raises(OutOfRange):
        make(value)


def test_arrays_that_are_no_values_on_these_cells():
    """A control has one number; that of a law may be an array, as long as the cells."""
    values = np.array([0.1, 0.2])
    for make in (Constant, Ramp):
        with pytest.raises(OutOfRange):
            make(values)
    with pytest.raises(BadScene, match=r"Viscosity\.eta has values for 2 cells, and block has 3"):
        Scene(BODY, (ReportTissue(), Viscosity(values)))


def test_static_problems_without_stiffness_and_with_loose_pieces():
    with pytest.raises(BadScene, match="tissue that resists"):
        Statics(Scene(BODY, (Gravity(), Viscosity(1.0)), (Attached("x0"),)))
    twin = np.vstack([BODY.points, BODY.points + np.array([0, 0.1, 0])])
    cells = np.vstack([BODY.cells, BODY.cells + len(BODY.points)])
    both = replace(BODY, points=twin, cells=cells, surfaces={})
    with pytest.raises(BadScene, match="each of its pieces"):
        Statics(Scene(both, (ReportTissue(),), (Attached("x0"),)))


def test_muscle_without_cells():
    with pytest.raises(BadMesh, match="no cells"):
        MuscleFibres("m", np.array([], dtype=int), np.zeros((0, 3)), np.zeros(0))
