"""Results of other programs, read from a folder outside of the project.

The variable ``DOLFIN_TONGUE_PEERS`` names a folder with ``febio/``: end positions ``A_*.csv``
(node, X, Y, Z, x, y, z in mm) and end-face curves ``C_*_tip.csv`` (t, tipmean_ux, ... in s and m),
made with FEBio 4.11.0 (public sources, commit 65622b53) and described in the README there, which
also gives the numbers below. Those of ArtiSynth (public sources, core b9aa17b, models bcda205) are
from ``artisynth/README.md``.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from benchmarks.extremes.outcome import read_table
from dolfin_tongue.base.arrays import FloatArray

VARIABLE = "DOLFIN_TONGUE_PEERS"

#: Mean displacement of the face x = L, mm: (material, angle of the fibres in degrees) -> (x, y).
STATIC = {
    ("MR", 0.0): (-1.7044541180, 0.0),
    ("MR", 30.0): (-1.2381308796, -2.2947746726),
    ("FUNGISO", 0.0): (-2.6378258289, 0.0),
    ("FUNGISO", 30.0): (-2.0630258534, -3.5108572244),
}

#: Static sag of the end face along x under gravity, m, by mesh.
SAG = {(4, 2, 2): -2.8229e-4, (8, 4, 4): -2.8651e-4}

#: What became of FEBio's runs under 20 kPa ramped over 50 ms: (mesh, dt in ms) -> time of death, s.
DEATHS = {
    ((4, 2, 2), 10): 0.200, ((4, 2, 2), 5): 0.345, ((4, 2, 2), 2): 0.234,
    ((8, 4, 4), 10): 0.00, ((8, 4, 4), 5): 0.01, ((8, 4, 4), 2): 0.29,
}  # fmt: skip

#: Muscles at 100 % of which ArtiSynth's tongue dies at dt 10 ms or 2 ms.
ARTISYNTH_DEATHS = {"STY": "10 and 2 ms", "GH": "10 and 2 ms", "HG": "10 and 2 ms", "GGA": "2 ms"}


def febio_folder() -> Path | None:
    """Folder of FEBio's files, if there is one."""
    folder = Path(os.environ.get(VARIABLE, "")) / "febio"
    return folder if os.environ.get(VARIABLE) and folder.is_dir() else None


def end_positions(folder: Path, material: str, angle: float) -> tuple[FloatArray, FloatArray]:
    """Read reference and end positions of all nodes of a static case, each (n, 3), m."""
    load = "active10x" if angle == 0 else "active10d30"
    table = read_table(folder / f"A_10x4x4_{material}_{load}.csv")
    before, after = (np.column_stack([table[k] for k in axes]) for axes in ("XYZ", "xyz"))
    return 1e-3 * before, 1e-3 * after


def end_face(folder: Path, cells: tuple[int, int, int], load: str) -> tuple[FloatArray, FloatArray]:
    """Time (s) and mean x-displacement (m) of the end face at dt 0.25 ms."""
    mesh = "x".join(str(n) for n in cells)
    table = read_table(folder / f"C_{mesh}_K1000_dt0.25_{load}_tip.csv")
    return table["t"], table["tipmean_ux"]
