"""The preliminary and the published tongue: shape, regions, muscles, activations.

What carries the weight: the parents of refined cells (muscles hang on them), and the largest forces
of the muscles against the published ones.
"""

from pathlib import Path

import numpy as np
import pytest

from dolfin_tongue.base.errors import BadMesh, OutOfRange
from dolfin_tongue.geometry.bezier import BezierSolid
from dolfin_tongue.geometry.block import DIVISIONS, unit_block
from dolfin_tongue.geometry.muscles import CROSS_SECTIONS, MUSCLES, Part, block_fibres
from dolfin_tongue.geometry.preliminary import default_control_points, preliminary_tongue
from dolfin_tongue.geometry.published import SPECIFIC_TENSION, published_tongue, read_activations
from dolfin_tongue.geometry.simple import surface_nodes


@pytest.fixture(scope="module")
def tongue():
    return preliminary_tongue()


# preliminary tongue


@pytest.mark.parametrize(("refinement", "margin"), [(1, 0.3), (2, 0.25), (3, 0.2)])
def test_jacobians_are_positive_with_a_margin(refinement, margin):
    body = preliminary_tongue(refinement)  # Body itself refuses Jacobians <= 0 at Gauss points
    quality = body.scaled_jacobians
    print(f"refinement {refinement}: scaled Jacobian {quality.min():.3f} to {quality.max():.3f}")
    assert quality.min() > margin


@pytest.mark.parametrize("refinement", [1, 2])
def test_size_of_the_tongue(refinement):
    body = preliminary_tongue(refinement)
    assert 60e-6 < body.volumes.sum() < 110e-6
    length, width, height = np.ptp(body.points, axis=0)
    assert 0.065 < length < 0.080
    assert 0.040 < width < 0.070
    assert 0.050 < height < 0.065
    assert body.mass == pytest.approx(1040.0 * body.volumes.sum())


def test_refinement_keeps_shape_landmarks_and_converges_in_volume(tongue):
    fine = [preliminary_tongue(factor) for factor in (2, 4)]
    for body in fine:
        for name in tongue.landmarks:
            np.testing.assert_allclose(
                body.points[body.landmark(name)], tongue.points[tongue.landmark(name)], atol=1e-15
            )
        for region in tongue.node_sets:
            offset = body.points[body.nodes(region)] - tongue.points[tongue.nodes(region)][:, None]
            assert np.linalg.norm(offset, axis=2).min(axis=1).max() < 1e-15
    volumes = [body.volumes.sum() for body in (tongue, *fine)]
    # chords of a smooth surface: the error falls by 4 with each halving
    assert (volumes[1] - volumes[0]) / (volumes[2] - volumes[1]) == pytest.approx(4.0, abs=0.5)
    assert volumes[0] == pytest.approx(volumes[2], rel=0.10)


def test_left_and_right_mirror_each_other(tongue):
    mirror = np.array([1.0, -1.0, 1.0])
    grid = tongue.points.reshape(3, 4, 8, 3)  # t, s, r
    np.testing.assert_allclose(grid[:, ::-1], grid * mirror, atol=1e-15)
    number = {tuple(p): c for c, p in enumerate(unit_block().parents.tolist())}
    twin = np.array([number[i, 2 - j, k] for i, j, k in number])
    for muscle in tongue.fibres.muscles:
        place = {int(c): n for n, c in enumerate(muscle.cells)}
        other = [place[int(twin[c])] for c in muscle.cells]
        cosine = np.einsum("ca,ca->c", muscle.directions[other] * mirror, muscle.directions)
        np.testing.assert_allclose(np.abs(cosine), 1.0, atol=1e-12)
        np.testing.assert_allclose(muscle.density[other], muscle.density)


def test_attachments_and_landmarks_are_where_anatomy_has_them(tongue):
    at = {name: tongue.points[node] for name, node in tongue.landmarks.items()}
    centre = {name: tongue.points[nodes].mean(axis=0) for name, nodes in tongue.node_sets.items()}
    assert at["tip"][0] < at["blade"][0] < at["dorsum"][0] < at["back"][0] < at["root"][0]
    line = tongue.points[tongue.nodes("dorsum")]
    assert at["dorsum"][2] == line[:, 2].max()
    assert (np.diff(line[:, 0]) < 0)[1:].all()  # ordered from root to tip
    # the genioglossus comes from the mandible, in front and below; the free tip overhangs it
    assert centre["genioglossus_origin"][2] < at["tip"][2] - 0.02
    assert at["tip"][0] < centre["genioglossus_origin"][0] - 0.01 < centre["base"][0] - 0.03
    assert centre["styloglossus_insertion"][0] > 0.115
    assert np.abs(tongue.points[tongue.nodes("styloglossus_insertion")][:, 1]).min() > 0.015
    fixed = [tongue.nodes(n) for n in ("base", "genioglossus_origin", "styloglossus_insertion")]
    assert len(np.unique(np.concatenate(fixed))) == 12 + 4 + 4


def test_contour_is_the_outline_of_the_midsagittal_sheet(tongue):
    contour = tongue.nodes("midsagittal_contour")
    assert len(np.unique(contour)) == len(contour) == 8 + 1 + 8
    assert np.isin(contour, tongue.nodes("midsagittal")).all()
    step = np.linalg.norm(np.diff(tongue.points[contour], axis=0), axis=1)
    assert step.max() < 0.025  # it never jumps across the tongue
    assert contour[8] == tongue.landmark("tip")


@pytest.mark.parametrize("refinement", [1, 2])
def test_muscles_lie_where_the_captions_say(refinement):
    body = preliminary_tongue(refinement)
    i, j, k = unit_block(refinement).parents.T
    middle, high = j == 1, k == 1

    def strength(name: str, where: np.ndarray) -> float:
        """Part of a muscle's fibres, by volume times density, in some cells."""
        muscle = body.fibres[name]
        weight = body.volumes[muscle.cells] * muscle.density
        return float(weight[where[muscle.cells]].sum() / weight.sum())

    assert set(body.fibres.names) == set(MUSCLES) == set(CROSS_SECTIONS)
    for name in ("styloglossus", "hyoglossus"):
        assert strength(name, ~middle) == 1.0
    for name in ("genioglossus_anterior", "genioglossus_posterior"):
        assert strength(name, middle) == 1.0
    assert strength("genioglossus_anterior", i >= 3) == 1.0
    assert strength("genioglossus_posterior", i <= 2) == 1.0
    assert strength("longitudinalis_inferior", ~high) == 1.0
    assert strength("longitudinalis_inferior", ~middle) > 0.8
    assert strength("longitudinalis_inferior", i == 0) == 0.0  # not connected to the hyoid
    assert strength("longitudinalis_superior", high) == 1.0
    assert strength("transversalis", high) > 0.8
    assert strength("verticalis", ~middle) > 0.8
    assert body.fibres.slots(body.fibres.names, len(body.cells)).count == 4


def test_directions_of_the_fans(tongue):
    origin = tongue.points[tongue.nodes("genioglossus_origin")].mean(axis=0)
    centres = tongue.points[tongue.cells].mean(axis=1)
    for name in ("genioglossus_anterior", "genioglossus_posterior"):
        muscle = tongue.fibres[name]
        ray = centres[muscle.cells] - origin
        ray /= np.linalg.norm(ray, axis=1, keepdims=True)
        cosine = np.abs(np.einsum("ca,ca->c", ray, muscle.directions))
        assert cosine.min() > np.cos(np.deg2rad(25.0))
    assert np.abs(tongue.fibres["transversalis"].directions[:, 1]).min() > 0.7
    assert (np.abs(tongue.fibres["verticalis"].directions[:, 2]) > 0.7).all()


@pytest.mark.parametrize("refinement", [1, 3])
@pytest.mark.parametrize(("name", "axis"), [("longitudinalis_superior", 0), ("transversalis", 1)])
def test_largest_force_is_the_published_one(refinement, name, axis):
    """Every cut across the fibres carries density times its area; on average the published area."""
    block, body = unit_block(refinement), preliminary_tongue(refinement)
    muscle = body.fibres[name]
    along = BezierSolid(default_control_points()).jacobian(block.centres[muscle.cells])
    step = np.linalg.norm(along[:, :, axis], axis=1) / (DIVISIONS[axis] * refinement)
    area = muscle.density * body.volumes[muscle.cells] / step
    layers, place = np.unique(block.centres[muscle.cells][:, axis].round(6), return_inverse=True)
    cut = np.bincount(place, area)
    assert len(layers) == DIVISIONS[axis] * refinement
    # layers differ in area, and the chord of a cell from its tangent: a tenth
    assert cut.mean() == pytest.approx(CROSS_SECTIONS[name] * 1e-6, rel=0.1)


@pytest.mark.parametrize("refinement", [1, 3])
def test_fibre_lengths_and_densities_are_anatomical(refinement):
    body = preliminary_tongue(refinement)
    for name, area in CROSS_SECTIONS.items():
        muscle = body.fibres[name]
        length = (muscle.density * body.volumes[muscle.cells]).sum() / (area * 1e-6)
        assert 0.02 < length < 0.09
        assert 0 < muscle.density.min() <= muscle.density.max() < 0.5


def test_refined_fibres_turn_with_the_shape(tongue):
    solid, block = BezierSolid(default_control_points()), unit_block(2)
    fibres = block_fibres(block, solid)["longitudinalis_superior"]
    along = solid.jacobian(block.centres[fibres.cells])[:, :, 0]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    np.testing.assert_allclose(fibres.directions, along, atol=1e-14)
    assert isinstance(MUSCLES["longitudinalis_superior"][0], Part)


def test_six_control_planes_are_required():
    with pytest.raises(BadMesh, match="six control planes"):
        preliminary_tongue(control_points=np.zeros((5, 4, 3, 3)))


def test_inside_out_control_points_name_the_inverted_cells():
    with pytest.raises(BadMesh, match=r"42 inverted hexahedron8 cell\(s\).*: 0, 1, 2"):
        preliminary_tongue(control_points=default_control_points()[::-1])


def test_density_of_mass_is_checked():
    with pytest.raises(OutOfRange, match="density"):
        preliminary_tongue(density=0.0)


# published tongue


def test_published_tongue(published_folder):
    body = published_tongue(published_folder)
    assert body.points.shape == (946, 3)
    assert body.cells.shape == (740, 8)
    assert body.volumes.sum() == pytest.approx(102.292e-6, rel=1e-5)
    assert len(body.fibres.names) == 11
    assert len(body.nodes("jaw")) == 59
    assert len(body.nodes("hyoid")) == 56
    assert len(body.nodes("midsagittal")) == 120
    assert len(body.nodes("midsagittal_contour")) == 27
    assert np.abs(body.points[body.nodes("midsagittal")][:, 1]).max() < 1e-9
    assert body.landmark("dorsum") == body.landmark("top") == 869
    assert (body.landmark("tip"), body.landmark("base")) == (919, 927)
    np.testing.assert_array_equal(body.nodes("surface"), surface_nodes(body))
    for muscle in body.fibres.muscles:
        np.testing.assert_allclose(np.linalg.norm(muscle.directions, axis=1), 1.0, rtol=1e-14)


def test_published_forces(published_folder):
    bundles = published_tongue(published_folder, muscles="bundles")
    assert len(bundles.fibres.names) == 21
    posterior = bundles.fibres["GGP_L"]
    # largest force 18.5 N over the bundle's 166.91 mm2 in the mesh, rounded to 5 digits in the file
    assert SPECIFIC_TENSION * posterior.density * 166.91e-6 == pytest.approx(18.5, rel=1e-4)
    both = published_tongue(published_folder).fibres["GGP"]
    cells = np.concatenate([bundles.fibres[f"GGP_{side}"].cells for side in "LR"])
    np.testing.assert_array_equal(both.cells, np.unique(cells))
    np.testing.assert_allclose(both.density, posterior.density[0])


def test_published_tongue_says_what_is_missing(tmp_path):
    (tmp_path / "tongue.vtu").touch()
    with pytest.raises(FileNotFoundError, match=r"missing muscles.json, attachments.json"):
        published_tongue(tmp_path)
    with pytest.raises(OutOfRange, match="'groups' or 'bundles'"):
        published_tongue(tmp_path, muscles="sides")


def test_published_activations(published_folder):
    names = published_tongue(published_folder).fibres.names
    tables = sorted((published_folder / "activations").glob("bracing_*.csv"))
    assert len(tables) == 8
    for path in tables:
        table = read_activations(path)
        assert table.names == names
        assert table.values.shape == (len(table.times), 11)


def write(folder: Path, text: str) -> Path:
    path = folder / "table.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_activation_table(tmp_path):
    table = read_activations(write(tmp_path, "time_s,A,B\n0,0,0.5\n0.25,1,0\n"))
    assert table.names == ("A", "B")
    np.testing.assert_array_equal(table.times, [0, 0.25])
    np.testing.assert_array_equal(table.values, [[0, 0.5], [1, 0]])


@pytest.mark.parametrize(
    ("text", "error", "message"),
    [
        ("time_s,A\n0,0\n0,1\n", OutOfRange, r"time in row 1 = 0.0 .* > 0"),
        ("time_s,A\n0,0\nnan,1\n", OutOfRange, "finite"),
        ("time_s,A\n", OutOfRange, "at least one"),
        ("time_s,A\n0,0\n1,1.5\n", OutOfRange, "activation of A in row 1 = 1.5"),
        ("time_s,A\n0,nan\n", OutOfRange, "activation of A in row 0"),
        ("time_s,A\n0,0,1\n", ValueError, "row 0 has not 2 entries"),
        ("posture,A\na,0\n", ValueError, "must be time_s, not 'posture'"),
        ("", ValueError, "must be time_s"),
    ],
)
def test_bad_activation_tables(tmp_path, text, error, message):
    with pytest.raises(error, match=message):
        read_activations(write(tmp_path, text))


def test_missing_activation_table_lists_the_others(tmp_path):
    write(tmp_path, "time_s,A\n0,0\n")
    with pytest.raises(FileNotFoundError, match=r"there is: table.csv"):
        read_activations(tmp_path / "other.csv")
