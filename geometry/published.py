"""Reader of a published tongue: 740 hexahedra, 11 muscles (Buchaillard, Perrier, Payan 2009).

The folder holds the ArtiSynth tongue in neutral formats: mesh ``tongue.vtu``, ``muscles.json``,
``attachments.json`` and activation tables ``activations/*.csv``. Metres; x from front to back,
z up, y < 0 is the left side. The data are by J.-M. Gerard, S. Buchaillard and colleagues
(GIPSA-lab, ICP Grenoble) and part of ArtiSynth: cite S. Buchaillard, P. Perrier, Y. Payan,
J. Acoust. Soc. Am. 126 (2009) 2033-2051 and I. Stavness, J. E. Lloyd, Y. Payan, S. Fels, Int. J.
Numer. Meth. Biomed. Engng 27 (2011) 367-390.
"""

from __future__ import annotations

import csv
import json
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import meshio
import numpy as np

from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.base.errors import BadMesh, OutOfRange, TongueError
from dolfin_tongue.base.units import kPa
from dolfin_tongue.body.body import TISSUE_DENSITY, Body
from dolfin_tongue.body.fibres import SPECIFIC_TENSION, Fibres, MuscleFibres

#: Files of the folder.
FILES = ("tongue.vtu", "muscles.json", "attachments.json")


def published_tongue(folder: Path | str, muscles: Literal["groups", "bundles"] = "groups") -> Body:
    """Read the published tongue.

    Parameters
    ----------
    folder : where the files are.
    muscles : ``"groups"`` gives 11 muscles with both sides in one; ``"bundles"`` gives the 21
        bundles of the files, with ``_L`` and ``_R`` apart.

    Returns
    -------
    Body
        Node sets ``jaw``, ``hyoid`` (the attachments), ``midsagittal`` (nodes at y = 0),
        ``midsagittal_contour`` (ordered, from the jaw over tip and dorsum to the hyoid) and
        ``surface``; landmarks ``tip``, ``top`` (also as ``dorsum``) and ``base``. The fibre density
        makes `SPECIFIC_TENSION` times density times the cross-section of a bundle in the mesh its
        published largest force.

    Raises
    ------
    FileNotFoundError : the folder or a file is missing; the message says which are expected.
    OutOfRange : another word for `muscles`.
    BadMesh : a mesh without hexahedra, or one that `Body` refuses.
    """
    if muscles not in ("groups", "bundles"):
        raise OutOfRange("muscles", repr(muscles), "'groups' or 'bundles'")
    folder = _checked(Path(folder), FILES)
    try:
        return _read(folder, muscles)
    except (meshio.ReadError, ET.ParseError, ValueError, KeyError, TypeError) as error:
        if isinstance(error, TongueError):
            raise
        raise BadMesh(
            f"{folder} does not hold a published tongue as expected: {error!r}"
        ) from error


def _read(folder: Path, muscles: str) -> Body:
    """Read the three files of a folder."""
    mesh = meshio.read(folder / "tongue.vtu")
    if "hexahedron" not in mesh.cells_dict:
        raise BadMesh(f"{folder / 'tongue.vtu'} has no hexahedra, only {list(mesh.cells_dict)}")
    regions = json.loads((folder / "attachments.json").read_text(encoding="utf-8"))
    data = json.loads((folder / "muscles.json").read_text(encoding="utf-8"))
    node_sets, landmarks = _regions(regions)
    chosen = (
        {name: group["members"] for name, group in data["groups"].items()}
        if muscles == "groups"
        else {name: [name] for name in data["muscles"]}
    )
    return Body(
        points=np.asarray(mesh.points, dtype=float),
        cells=np.asarray(mesh.cells_dict["hexahedron"], dtype=np.int64),
        node_sets=node_sets,
        landmarks=landmarks,
        density=TISSUE_DENSITY,
        fibres=Fibres(
            tuple(
                _merge(name, [data["muscles"][member] for member in members])
                for name, members in chosen.items()
            )
        ),
        name="published_tongue",
    )


def _checked(folder: Path, files: Sequence[str]) -> Path:
    """Return the folder if it holds the files; else say what is expected and what is missing."""
    missing = [name for name in files if not (folder / name).is_file()]
    if missing:
        raise FileNotFoundError(
            f"{folder} is not a folder with the published tongue: expected {', '.join(files)}; "
            f"missing {', '.join(missing)}"
        )
    return folder


def _regions(data: Mapping[str, Any]) -> tuple[dict[str, IntArray], dict[str, int]]:
    """Node sets and landmarks of attachments.json."""
    facets = np.array(data["boundary_facets"])[:, 2:]  # the first two are cell and local face
    node_sets = {
        "jaw": np.array(data["jaw"]["nodes"]),
        "hyoid": np.array(data["hyoid"]["nodes"]),
        "midsagittal": np.array(data["midplane_nodes"]),
        "midsagittal_contour": np.array(data["midsagittal_contour_nodes"]),
        "surface": np.unique(facets),
    }
    landmarks = {name: int(node) for name, node in data["named_nodes"].items()}
    landmarks["dorsum"] = landmarks["top"]
    return node_sets, landmarks


def _merge(name: str, bundles: Sequence[Mapping[str, Any]]) -> MuscleFibres:
    """One muscle from its bundles; a cell of several bundles appears once, with their mean."""
    cells = np.concatenate([np.array(bundle["elements"], dtype=np.int64) for bundle in bundles])
    directions = np.concatenate([np.array(bundle["directions"]) for bundle in bundles])
    density = np.concatenate([_density(bundle) for bundle in bundles])
    distinct, first, place, count = np.unique(
        cells, return_index=True, return_inverse=True, return_counts=True
    )
    # The sign of a direction has no meaning: turn all of a cell alike before adding them up.
    along = np.einsum("ca,ca->c", directions, directions[first][place]) >= 0
    summed = np.zeros((len(distinct), 3))
    np.add.at(summed, place, np.where(along[:, None], directions, -directions))
    unit = summed / np.linalg.norm(summed, axis=1, keepdims=True)  # the file has 6 digits
    return MuscleFibres(name, distinct, unit, np.bincount(place, density) / count)


def _density(bundle: Mapping[str, Any]) -> FloatArray:
    """Fibre density in a bundle's cells: largest force over cross-section and tension."""
    stress = bundle["max_force_over_mesh_csa_kPa"] * kPa
    return np.full(len(bundle["elements"]), stress / SPECIFIC_TENSION)


@dataclass(frozen=True)
class ActivationTable:
    """Activations of muscles over time.

    Parameters
    ----------
    times : ndarray, shape (k,), s -- increasing.
    names : the muscles, m of them.
    values : ndarray, shape (k, m), dimensionless, in [0, 1] -- linear between the times.
    """

    times: FloatArray
    names: tuple[str, ...]
    values: FloatArray

    def __post_init__(self) -> None:
        if self.values.shape != (len(self.times), len(self.names)):
            raise BadMesh(
                f"{len(self.times)} times and {len(self.names)} muscles need values of shape "
                f"({len(self.times)}, {len(self.names)}), not {self.values.shape}"
            )
        if not len(self.times) or not np.isfinite(self.times).all():
            raise OutOfRange("times", self.times, "at least one, and all finite", "s")
        late = np.flatnonzero(~(np.diff(self.times) > 0))
        if late.size:
            row = int(late[0]) + 1
            raise OutOfRange(
                f"time in row {row}", self.times[row], f"> {self.times[row - 1]:g} (the row before)"
            )
        wrong = np.argwhere(~((self.values >= 0) & (self.values <= 1)))
        if wrong.size:
            row, column = wrong[0]
            raise OutOfRange(
                f"activation of {self.names[column]} in row {row}",
                self.values[row, column],
                "in [0, 1]",
            )


def read_activations(path: Path | str) -> ActivationTable:
    """Read an activation table: a CSV with a column ``time_s`` and one per muscle.

    Parameters
    ----------
    path : the file, e.g. ``activations/bracing_brace.csv``.

    Raises
    ------
    FileNotFoundError : no such file; the message lists the tables beside it.
    OutOfRange : times that do not increase, activations outside [0, 1] or not a number.
    BadMesh : another first column than ``time_s``, a row of another length, or an entry that
        is not a number.
    """
    path = Path(path)
    if not path.is_file():
        beside = sorted(other.name for other in path.parent.glob("*.csv")) or ["no tables"]
        raise FileNotFoundError(f"no activation table {path}; there is: {', '.join(beside)}")
    with path.open(newline="", encoding="utf-8") as file:
        lines = [line for line in csv.reader(file) if line]
    header, rows = (lines[0], lines[1:]) if lines else ([""], [])
    if header[0] != "time_s":
        raise BadMesh(f"{path}: the first column must be time_s, not {header[0]!r}")
    uneven = [i for i, row in enumerate(rows) if len(row) != len(header)]
    if uneven:
        raise BadMesh(f"{path}: row {uneven[0]} has not {len(header)} entries")
    table = np.array(rows, dtype=float).reshape(-1, len(header))
    return ActivationTable(table[:, 0], tuple(header[1:]), table[:, 1:])
