"""Surfaces from files: round trips through the usual formats, units, damaged and missing files."""

import meshio
import numpy as np
import pytest
from shapes import ball, cube, sheet

from dolfin_tongue.base.errors import BadMesh, OutOfRange
from dolfin_tongue.surfaces.files import merge_points, read_surface
from dolfin_tongue.surfaces.triangles import volume

POINTS, TRIANGLES = ball(300)


def write(path, points=POINTS, triangles=TRIANGLES):
    """Write by meshio, or by VTK what meshio cannot."""
    if path.suffix != ".vtp":
        meshio.Mesh(points, [("triangle", triangles)]).write(path)
        return
    import pyvista

    pyvista.PolyData(points, np.insert(triangles, 0, 3, axis=1)).save(path)


@pytest.mark.parametrize("suffix", ["obj", "stl", "vtp", "ply", "vtu", "STL"])
def test_round_trip(tmp_path, suffix):
    path = tmp_path / "ball.stl"
    write(path if suffix == "STL" else path.with_suffix(f".{suffix}"))
    if suffix == "STL":
        path.rename(path.with_suffix(".STL"))
    surface = read_surface(path.with_suffix(f".{suffix}"), band=8e-3)
    assert surface.points.shape == POINTS.shape
    assert surface.triangles.shape == TRIANGLES.shape
    assert volume(surface.points, surface.triangles) == pytest.approx(
        volume(POINTS, TRIANGLES), rel=1e-6
    )
    assert surface.band == 8e-3
    assert not surface.sheet


def test_millimetres_and_sheets(tmp_path):
    points, triangles = sheet()
    write(tmp_path / "sheet.stl", 1e3 * points, triangles)
    surface = read_surface(tmp_path / "sheet.stl", scale=1e-3, sheet=True)
    assert surface.extent == pytest.approx(0.04)
    assert surface.value(np.array([[0.001, 0.002, 0.003]])) == pytest.approx([0.003], rel=1e-6)
    with pytest.raises(BadMesh, match=r"open: it has 32 border edge\(s\)"):
        read_surface(tmp_path / "sheet.stl", scale=1e-3)
    with pytest.raises(BadMesh, match=r"40 m long; .*scale=1e-3"):
        read_surface(tmp_path / "sheet.stl", sheet=True)


@pytest.mark.parametrize("suffix", ["obj", "vtu"])
def test_quadrilaterals_are_cut(tmp_path, suffix):
    from dolfin_tongue.geometry.simple import block_body

    body = block_body((0.02, 0.02, 0.02), (2, 2, 2))
    path = tmp_path / f"block.{suffix}"
    meshio.Mesh(body.points, [("quad", body.boundary)]).write(path)
    surface = read_surface(path)
    assert len(surface.triangles) == 48
    assert len(surface.points) == 26  # the point inside the block belongs to no face
    assert volume(surface.points, surface.triangles) == pytest.approx(8e-6)


def test_merging():
    points, triangles = cube()
    apart = points[triangles].reshape(-1, 3) + 1e-10 * np.arange(36)[:, None]
    merged, whole = merge_points(apart, np.arange(36).reshape(-1, 3))
    assert len(merged) == 8
    assert len(whole) == 12
    assert volume(merged, whole) == pytest.approx(8e-6, rel=1e-5)
    _, left = merge_points(points, np.concatenate([triangles, [[0, 1, 1]]]))
    assert len(left) == 12


def test_a_missing_file(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"there is no surface file .*palate\.obj"):
        read_surface(tmp_path / "palate.obj")


@pytest.mark.parametrize("name", ["notes.xyz", "notes.ply", "notes.stl", "notes.obj", "notes.vtp"])
def test_what_is_no_surface(tmp_path, name):
    (tmp_path / name).write_text("nothing to see here\n")
    with pytest.raises(BadMesh, match=rf"{name}.* (cannot be read|holds no triangles)"):
        read_surface(tmp_path / name)


def test_an_unknown_extension_lists_the_known_ones(tmp_path):
    (tmp_path / "palate.docx").write_text("")
    with pytest.raises(BadMesh, match=r"cannot be read.*known extensions: .*\.obj.*\.vtp"):
        read_surface(tmp_path / "palate.docx")


def test_a_file_without_triangles(tmp_path):
    meshio.Mesh(POINTS, [("line", TRIANGLES[:, :2])]).write(tmp_path / "lines.vtu")
    with pytest.raises(BadMesh, match="holds no triangles"):
        read_surface(tmp_path / "lines.vtu")


@pytest.mark.parametrize("scale", [0.0, -1.0, np.nan, "1e-3"])
def test_a_bad_scale(tmp_path, scale):
    write(tmp_path / "ball.stl")
    with pytest.raises(OutOfRange, match=r"scale = .* a finite number > 0"):
        read_surface(tmp_path / "ball.stl", scale=scale)
