"""The pictures of a run: which, and where they go."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from dolfin_tongue import view
from dolfin_tongue.body.body import Body
from dolfin_tongue.body.state import State
from dolfin_tongue.boundary import Attached
from dolfin_tongue.record.run import Run
from dolfin_tongue.view.plots import contact_names, rigid_names

#: Frames on a contact sheet.
SHEET_FRAMES = 15

#: Frames on a picture of contact pressures.
PRESSURE_FRAMES = 8


def picture_run(run: Run, title: str) -> None:
    """Draw a run into its folder.

    ``sheet.png`` frames with nodes' velocities, ``animation.gif``, ``fibres/`` a picture of each
    muscle, ``trajectories.png``, ``energy.png``, ``shape.png`` the last shape. Walls that the body
    touches or slides on, and rigid bodies, are drawn with it. Where there are any:
    ``contact.png`` forces and areas of contact, ``pressure.png`` where the tissue is touched,
    ``rigid.png`` coordinates of rigid bodies.

    Parameters
    ----------
    run : a finished run.
    title : over the sheet.
    """
    body, folder = run.scene.body, run.folder
    frames = view.key_frames(run.frames, SHEET_FRAMES)
    fixed = [r for s in run.scene.supports if isinstance(s, Attached) for r in s.regions]
    around = view.Surroundings.of(run.scene)
    view.contact_sheet(
        body, frames, folder / "sheet.png", title=title, fixed=fixed, surroundings=around
    )
    view.animation(body, run.frames, folder / "animation.gif", fixed=fixed, surroundings=around)
    if body.fibres.muscles:
        view.fibre_pictures(body, folder / "fibres")
    view.shape_picture(body, run.last, folder / "shape.png", surroundings=around)
    places, steps = read_table(folder / "trajectories.csv"), read_table(folder / "steps.csv")
    view.trajectories(_landmark_paths(places), folder / "trajectories.png")
    view.energy_plot(steps, folder / "energy.png")
    if contact_names(steps):
        view.contact_plot(steps, folder / "contact.png")
        _picture_pressures(run, title, steps)
    if rigid_names(places):
        view.rigid_plot(places, folder / "rigid.png")


def _picture_pressures(run: Run, title: str, steps: dict[str, np.ndarray]) -> None:
    """Draw the pressure of contact at some of the frames from the first touch on."""
    touched = np.any([steps[name] > 0 for name in steps if name.endswith("_area_m2")], axis=0)
    if not touched.any():
        return
    begin = steps["time_s"][touched][0]
    frames = [frame for frame in run.frames if frame.time >= begin] or [run.last]
    frames = view.key_frames(frames, PRESSURE_FRAMES)
    touches = [run.solver.contacts(frame).values() for frame in frames]
    maps = [np.sum([touch.pressure for touch in each], axis=0) for each in touches]
    view.contact_picture(run.scene.body, frames, maps, run.folder / "pressure.png", title=title)


def picture_shapes(body: Body, shapes: Mapping[str, State], path: Path) -> None:
    """Draw the final shapes of several runs of one body side by side."""
    view.final_shapes(body, shapes, path)


def read_table(path: Path) -> dict[str, np.ndarray]:
    """Columns of a CSV table by name."""
    table = np.genfromtxt(path, delimiter=",", names=True)
    return {name: np.atleast_1d(table[name]) for name in table.dtype.names or ()}


def _landmark_paths(
    columns: Mapping[str, np.ndarray],
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return times (s) and positions, shape (k, 3), mm, of each landmark."""
    # Rigid bodies have columns too, but none for y.
    names = [name[: -len("_y_m")] for name in columns if name.endswith("_y_m")]
    return {
        name: (
            columns["time_s"],
            1e3 * np.stack([columns[f"{name}_{axis}_m"] for axis in "xyz"], axis=1),
        )
        for name in names
    }
