"""Files of a run, written while it goes: tables, frames, checkpoint, summary."""

from __future__ import annotations

import fcntl
import json
import zipfile
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from dolfin_tongue.base.errors import BadScene, TongueError, require_positive
from dolfin_tongue.base.files import replacing, write_json
from dolfin_tongue.body.state import State
from dolfin_tongue.march.observed import MuscleState
from dolfin_tongue.record.fingerprint import fingerprint
from dolfin_tongue.record.frames import Frames
from dolfin_tongue.record.state_file import arrays_of, state_from
from dolfin_tongue.record.table import Table, muscle_row, trajectory_row
from dolfin_tongue.scene.scene import Scene

#: What reading damaged files raises.
DAMAGED = (OSError, EOFError, ValueError, KeyError, zipfile.BadZipFile)


def _claim(folder: Path) -> TextIO:
    """Lock a folder for this run; TongueError if another run writes there."""
    lock = (folder / ".lock").open("w")
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        lock.close()
        raise TongueError(
            f"another run writes to {folder}; choose another folder (under mpirun every process "
            "is a run of its own)"
        ) from error
    return lock


class Recorder:
    """Everything that a run leaves in its folder.

    ``trajectories.csv`` positions of the landmarks (m) and coordinates of rigid bodies (m, rad),
    ``steps.csv`` one row per accepted step, ``muscles.csv`` activations and forces over time,
    ``fields.xdmf`` and ``frames/`` for ParaView, ``checkpoint.npz`` to resume, ``summary.json``.

    Parameters
    ----------
    folder : made if it is not there; files of an earlier run in it are replaced.
    scene : what is simulated.
    frame_interval : time between frames, s.
    """

    def __init__(self, folder: Path, scene: Scene, frame_interval: float):
        require_positive(self, "s", frame_interval=frame_interval)
        self.folder, self.scene = folder, scene
        self.frame_interval = frame_interval
        self._fingerprint = fingerprint(scene)
        folder.mkdir(parents=True, exist_ok=True)
        self._lock = _claim(folder)
        self.trajectories = Table(folder / "trajectories.csv")
        self.steps = Table(folder / "steps.csv")
        self.muscles = Table(folder / "muscles.csv")
        self._first: float | None = None

    def begin(self) -> None:
        """Start anew: the frames of an earlier run do not count."""
        self.frames = Frames(self.folder, self.scene.body)
        self.frames.clear()

    def record(
        self, state: State, observed: dict[str, float], muscles: dict[str, MuscleState]
    ) -> bool:
        """Write an accepted state; whether it became a frame."""
        self.trajectories.append(trajectory_row(self.scene, state))
        step = {"time_s": state.time, "step_s": state.step, "newton_iterations": state.iterations}
        self.steps.append(step | observed)
        row = muscle_row(muscles, self.scene, state)
        if len(row) > 1:
            self.muscles.append(row)
        times = self.frames.times
        due = times[0] + len(times) * self.frame_interval if times else state.time
        if state.time >= due - 1e-9 * self.frame_interval:
            self.frames.append(state)
            return True
        return False

    def checkpoint(self, state: State, account: dict[str, Any]) -> None:
        """Write what a resumed run starts from."""
        with replacing(self.folder / "checkpoint.npz") as path:
            np.savez(
                path, **arrays_of(state), frame_times=self.frames.times,
                account=json.dumps(account), fingerprint=self._fingerprint,
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
        try:
            with np.load(path) as file:
                saved = {name: file[name] for name in file.files}
            if str(saved["fingerprint"]) != self._fingerprint:
                raise BadScene(
                    f"{self.folder} holds a run of another scene; resume with the same body, terms "
                    "and supports, or choose another folder"
                )
            state, account = self._checked(state_from(saved)), json.loads(str(saved["account"]))
            self.frames = Frames(self.folder, self.scene.body)
            self.frames.keep_until(saved["frame_times"].tolist(), state.time)
            for _ in self.frames:  # all can be read
                pass
            for table in (self.trajectories, self.steps, self.muscles):
                if table.path.exists() or table is not self.muscles:
                    table.continue_until(state.time)
        except BadScene:  # another scene; it is a ValueError too
            raise
        except DAMAGED as error:
            raise BadScene(
                f"the run in {self.folder} cannot be resumed, its files are damaged ({error}); "
                "start anew without resuming, or in another folder"
            ) from error
        return state, account

    def _checked(self, state: State) -> State:
        """State of a checkpoint; ValueError if it is not one of this body."""
        arrays = (state.displacement, state.velocity, state.pressure, state.rigid)
        nodes, cells = self.scene.body.points.shape, (self.scene.body.cell_count,)
        shapes = (nodes, nodes, cells, (len(self.scene.rigid_bodies), 3))
        finite = all(np.isfinite(a).all() for a in arrays)
        if not finite or tuple(a.shape for a in arrays) != shapes:
            raise ValueError("the checkpoint does not fit the body")
        return state

    def summary(self, content: dict[str, Any]) -> None:
        """Write ``summary.json``."""
        write_json(self.folder / "summary.json", content)

    def close(self) -> None:
        """Close the tables."""
        for table in (self.trajectories, self.steps, self.muscles):
            table.close()
        self._lock.close()
