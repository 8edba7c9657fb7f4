"""Files of a run, written while it goes: tables, frames, checkpoint, summary."""

from __future__ import annotations

import csv
import hashlib
import json
import pickle
from pathlib import Path
from typing import Any, Literal, TextIO

import numpy as np

from dolfin_tongue.errors import BadScene, TongueError
from dolfin_tongue.files import replacing, write_json, write_text
from dolfin_tongue.frames import Frames
from dolfin_tongue.observe import landmark_positions
from dolfin_tongue.scene import Scene
from dolfin_tongue.state import State


class Table:
    """A CSV file that grows row by row; every row is on disk at once.

    Parameters
    ----------
    path : the file; a table that is there is replaced.
    """

    def __init__(self, path: Path):
        self.path = path
        self._file: TextIO | None = None
        self._writer: csv.DictWriter | None = None

    def continue_until(self, time: float) -> None:
        """Keep the rows of an earlier run up to a time (first column, s)."""
        with self.path.open(newline="", encoding="utf-8") as file:
            header, *rows = list(csv.reader(file))
        kept = [row for row in rows if len(row) == len(header) and float(row[0]) <= time]
        write_text(self.path, "".join(",".join(row) + "\n" for row in [header, *kept]))
        self._file, self._writer = self._open(header, "a")

    def append(self, row: dict[str, Any]) -> None:
        """Add a row; the first one gives the column names."""
        if self._file is None or self._writer is None:
            self._file, self._writer = self._open(list(row), "w")
            self._writer.writeheader()
        self._writer.writerow(row)
        self._file.flush()

    def close(self) -> None:
        """Close the file."""
        if self._file:
            self._file.close()

    def _open(self, columns: list[str], mode: Literal["w", "a"]) -> tuple[TextIO, csv.DictWriter]:
        file = self.path.open(mode, newline="", encoding="utf-8")
        return file, csv.DictWriter(file, columns, lineterminator="\n")


class Recorder:
    """Everything that a run leaves in its folder.

    ``trajectories.csv`` positions of the landmarks (m), ``steps.csv`` one row per accepted step,
    ``fields.xdmf`` and ``frames/`` for ParaView, ``checkpoint.npz`` to resume, ``summary.json``.

    Parameters
    ----------
    folder : made if it is not there; files of an earlier run in it are replaced.
    scene : what is simulated.
    frame_interval : time between frames, s.
    """

    def __init__(self, folder: Path, scene: Scene, frame_interval: float):
        folder.mkdir(parents=True, exist_ok=True)
        self.folder, self.scene = folder, scene
        self.frame_interval = frame_interval
        self.frames = Frames(folder, scene.body)
        self.trajectories = Table(folder / "trajectories.csv")
        self.steps = Table(folder / "steps.csv")
        self._fingerprint = fingerprint(scene)

    def record(self, state: State, observed: dict[str, float]) -> bool:
        """Write an accepted state; whether it became a frame."""
        positions = landmark_positions(self.scene.body, state)
        row = {"time_s": state.time}
        for name, position in positions.items():
            row |= {f"{name}_{axis}_m": float(x) for axis, x in zip("xyz", position, strict=True)}
        self.trajectories.append(row)
        step = {"time_s": state.time, "step_s": state.step, "newton_iterations": state.iterations}
        self.steps.append(step | observed)
        due = len(self.frames.times) * self.frame_interval
        if state.time >= due - 1e-9 * self.frame_interval:
            self.frames.append(state)
            return True
        return False

    def checkpoint(self, state: State, memory: dict[str, Any]) -> None:
        """Write what a resumed run starts from."""
        with replacing(self.folder / "checkpoint.npz") as path:
            np.savez(
                path, time=state.time, displacement=state.displacement, velocity=state.velocity,
                pressure=state.pressure, step=state.step, frame_times=self.frames.times,
                memory=json.dumps(memory), fingerprint=self._fingerprint,
            )  # fmt: skip

    def resume(self) -> tuple[State, dict[str, Any]] | None:
        """Take up an earlier run of the same scene; None where there is none.

        Raises
        ------
        BadScene : the folder holds a run of another scene.
        """
        path = self.folder / "checkpoint.npz"
        if not path.exists():
            return None
        with np.load(path) as saved:
            if str(saved["fingerprint"]) != self._fingerprint:
                raise BadScene(
                    f"{self.folder} holds a run of another scene; resume with the same body, terms "
                    "and supports, or choose another folder"
                )
            state = State(
                float(saved["time"]), saved["displacement"], saved["velocity"], saved["pressure"],
                float(saved["step"]),
            )  # fmt: skip
            memory = json.loads(str(saved["memory"]))
            times = saved["frame_times"].tolist()
        self.frames.keep_until(times, state.time)
        self.trajectories.continue_until(state.time)
        self.steps.continue_until(state.time)
        return state, memory

    def summary(self, content: dict[str, Any]) -> None:
        """Write ``summary.json``."""
        write_json(self.folder / "summary.json", content)

    def close(self) -> None:
        """Close the tables."""
        self.trajectories.close()
        self.steps.close()


def fingerprint(scene: Scene) -> str:
    """Return a key that two scenes share if and only if their contents are the same."""
    try:
        return hashlib.sha256(pickle.dumps(scene)).hexdigest()
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise TongueError(
            f"this scene cannot be saved ({error}); use named functions and classes in its terms"
        ) from error
