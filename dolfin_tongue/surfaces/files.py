"""Surfaces from files."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.base.errors import BadMesh, OutOfRange, is_number, listing
from dolfin_tongue.surfaces.triangulated import Triangulated

#: What VTK reads better than meshio: OBJ files with normals and texture, and VTK's own surfaces.
BY_VTK = (".obj", ".stl", ".vtp")


def read_surface(path: Path | str, scale: float = 1.0, **options: Any) -> Triangulated:
    """Read a triangulated surface.

    Points at the same place are merged (an STL file repeats them for every triangle),
    quadrilaterals are cut into triangles; triangles that lose a corner by merging are left out.

    Parameters
    ----------
    path : an OBJ, STL or VTP file, or any other that meshio knows by its extension.
    scale : metres per unit of the file: 1e-3 for millimetres.
    options : of `Triangulated`: ``sheet``, ``inside``, ``spacing``, ``band`` and others.

    Raises
    ------
    FileNotFoundError : there is no such file.
    BadMesh : an unknown extension, a damaged file, no triangles, or triangles that `Triangulated`
        refuses.
    OutOfRange : scale not a finite number > 0.
    """
    path = Path(path)
    if not (is_number(scale) and scale > 0):
        raise OutOfRange("scale", scale, "a finite number > 0")
    if not path.is_file():
        raise FileNotFoundError(f"there is no surface file {path}")
    points, triangles = _by_vtk(path) if path.suffix.lower() in BY_VTK else _by_meshio(path)
    if not len(triangles):
        raise BadMesh(f"{path} holds no triangles or quadrilaterals")
    wrong = np.flatnonzero(((triangles < 0) | (triangles >= len(points))).any(axis=1))
    if wrong.size:
        raise BadMesh(
            f"{path}: triangle(s) {listing(wrong)} name points that the file does not have; it has "
            f"{len(points)}"
        )
    return Triangulated(*merge_points(points * scale, triangles), **options)


def _by_vtk(path: Path) -> tuple[FloatArray, IntArray]:
    """Points and triangles by VTK, which reports damaged files only by reading nothing."""
    import pyvista

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            surface: Any = pyvista.read(path)
    except Exception as error:  # the readers raise all kinds for a damaged file
        raise BadMesh(f"{path} cannot be read as a surface: {error}") from error
    if not isinstance(surface, pyvista.PolyData):
        surface = surface.extract_surface()
    triangles = surface.triangulate().faces.reshape(-1, 4)[:, 1:]
    return np.asarray(surface.points, dtype=float), np.asarray(triangles, dtype=np.int64)


def _by_meshio(path: Path) -> tuple[FloatArray, IntArray]:
    """Points and triangles by meshio."""
    import meshio

    try:
        mesh = meshio.read(path)
    except (Exception, SystemExit) as error:  # meshio leaves the program on some damaged files
        known = ", ".join(sorted({*BY_VTK, *meshio.extension_to_filetypes}))
        raise BadMesh(
            f"{path} cannot be read as a surface ({error}); known extensions: {known}"
        ) from error
    cells = {kind: np.asarray(block, np.int64) for kind, block in mesh.cells_dict.items()}
    quads = cells.get("quad", np.empty((0, 4), np.int64))
    triangles = [
        cells.get("triangle", np.empty((0, 3), np.int64)),
        quads[:, :3],
        quads[:, [0, 2, 3]],
    ]
    return np.asarray(mesh.points, dtype=float), np.concatenate(triangles)


def merge_points(points: FloatArray, triangles: IntArray) -> tuple[FloatArray, IntArray]:
    """Merge points that coincide, and drop points and triangles of which nothing is left.

    Parameters
    ----------
    points : ndarray, shape (n, 3), m -- equal to within 1e-6 of the surface's extent are merged
        (files in single precision have seven digits).
    triangles : ndarray, shape (t, 3).
    """
    grain = 1e-6 * float(np.ptp(points, axis=0).max())
    if not np.isfinite(grain) or grain == 0:
        return points, triangles
    pairs = cKDTree(points).query_pairs(grain, output_type="ndarray")
    links = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(points),) * 2)
    _, group = connected_components(links, directed=False)
    _, first = np.unique(group, return_index=True)
    merged = group[triangles]
    whole = (merged != np.roll(merged, 1, axis=1)).all(axis=1)
    used, renumbered = np.unique(merged[whole], return_inverse=True)
    return points[first[used]], renumbered.reshape(-1, 3)
