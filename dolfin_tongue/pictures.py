"""The pictures of a run: which, and where they go."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from dolfin_tongue import view
from dolfin_tongue.body import Body
from dolfin_tongue.boundary import Attached
from dolfin_tongue.run import Run
from dolfin_tongue.state import State

#: Frames on a contact sheet.
SHEET_FRAMES = 15


def picture_run(run: Run, title: str) -> None:
    """Draw a run into its folder.

    ``sheet.png`` frames with nodes' velocities, ``animation.gif``, ``fibres/`` a picture of each
    muscle, ``trajectories.png``, ``energy.png``, ``shape.png`` the last shape.

    Parameters
    ----------
    run : a finished run.
    title : over the sheet.
    """
    body, folder = run.scene.body, run.folder
    frames = view.telling_frames(run.frames, SHEET_FRAMES)
    fixed = [r for s in run.scene.supports if isinstance(s, Attached) for r in s.regions]
    view.contact_sheet(body, frames, folder / "sheet.png", title=title, fixed=fixed)
    view.animation(body, run.frames, folder / "animation.gif", fixed=fixed)
    if body.fibres.muscles:
        view.fibre_pictures(body, folder / "fibres")
    view.shape_picture(body, run.last, folder / "shape.png")
    view.trajectories(_landmark_paths(folder), folder / "trajectories.png")
    view.energy_plot(read_table(folder / "steps.csv"), folder / "energy.png")


def picture_shapes(body: Body, shapes: Mapping[str, State], path: Path) -> None:
    """Draw the final shapes of several runs of one body side by side."""
    view.final_shapes(body, shapes, path)


def read_table(path: Path) -> dict[str, np.ndarray]:
    """Columns of a CSV table by name."""
    table = np.genfromtxt(path, delimiter=",", names=True)
    return {name: np.atleast_1d(table[name]) for name in table.dtype.names or ()}


def _landmark_paths(folder: Path) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return times (s) and positions, shape (k, 3), mm, of each landmark."""
    columns = read_table(folder / "trajectories.csv")
    names = [name[: -len("_y_m")] for name in columns if name.endswith("_y_m")]  # no bones: no y
    return {
        name: (
            columns["time_s"],
            1e3 * np.stack([columns[f"{name}_{axis}_m"] for axis in "xyz"], axis=1),
        )
        for name in names
    }
