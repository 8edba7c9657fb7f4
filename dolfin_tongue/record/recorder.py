"""Files of a run, written while it goes: tables, frames, checkpoint, summary."""

from __future__ import annotations

import csv
import fcntl
import hashlib
import json
import zipfile
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import partial
from numbers import Real
from pathlib import Path
from types import CodeType, FunctionType, MethodType
from typing import Any, Literal, TextIO

import numpy as np

from dolfin_tongue.base.errors import BadScene, TongueError, require_positive
from dolfin_tongue.base.files import replacing, write_json, write_text
from dolfin_tongue.march.state import State
from dolfin_tongue.record.frames import Frames
from dolfin_tongue.record.observe import landmark_positions
from dolfin_tongue.rigid import COORDINATES
from dolfin_tongue.scene.scene import Scene

#: What reading damaged files raises.
_DAMAGED = (OSError, EOFError, ValueError, KeyError, zipfile.BadZipFile)


def _claim(folder: Path) -> TextIO:
    """Lock a folder for this run; TongueError if another run writes there."""
    lock = (folder / ".lock").open("w")
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        lock.close()
        raise TongueError(f"another run writes to {folder}; choose another folder") from error
    return lock


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
        if header[:1] != ["time_s"] or not rows:
            raise ValueError(f"{self.path.name} is no table over time")
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

    ``trajectories.csv`` positions of the landmarks (m) and coordinates of rigid bodies (m, rad),
    ``steps.csv`` one row per accepted step,
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
        self.frames = Frames(folder, scene.body, len(scene.rigid_bodies))
        self.trajectories = Table(folder / "trajectories.csv")
        self.steps = Table(folder / "steps.csv")

    def record(self, state: State, observed: dict[str, float]) -> bool:
        """Write an accepted state; whether it became a frame."""
        positions = landmark_positions(self.scene.body, state)
        row = {"time_s": state.time}
        for name, position in positions.items():
            row |= {f"{name}_{axis}_m": float(x) for axis, x in zip("xyz", position, strict=True)}
        for bone, q in zip(self.scene.rigid_bodies, state.rigid, strict=True):
            units = zip(COORDINATES, ("m", "m", "rad"), q, strict=True)
            row |= {f"{bone.name}_{name}_{unit}": float(x) for name, unit, x in units}
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
                pressure=state.pressure, step=state.step, rigid=state.rigid,
                rigid_rate=state.rigid_rate, sliding=state.sliding, frame_times=self.frames.times,
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
        try:
            with np.load(path) as file:
                saved = {name: file[name] for name in file.files}
            if str(saved["fingerprint"]) != self._fingerprint:
                raise BadScene(
                    f"{self.folder} holds a run of another scene; resume with the same body, terms "
                    "and supports, or choose another folder"
                )
            state, memory = self._saved_state(saved), json.loads(str(saved["memory"]))
            self.frames.keep_until(saved["frame_times"].tolist(), state.time)
            self.frames.read_all()
            self.trajectories.continue_until(state.time)
            self.steps.continue_until(state.time)
        except BadScene:  # another scene; it is a ValueError too
            raise
        except _DAMAGED as error:
            raise BadScene(
                f"the run in {self.folder} cannot be resumed, its files are damaged ({error}); "
                "start anew without resuming, or in another folder"
            ) from error
        return state, memory

    def _saved_state(self, saved: dict[str, Any]) -> State:
        """State of a checkpoint; ValueError if it is not one of this body."""
        state = State(
            float(saved["time"]), saved["displacement"], saved["velocity"], saved["pressure"],
            float(saved["step"]), rigid=saved["rigid"], rigid_rate=saved["rigid_rate"],
            sliding=saved["sliding"],
        )  # fmt: skip
        arrays = (state.displacement, state.velocity, state.pressure, state.rigid)
        nodes, cells = self.scene.body.points.shape, (len(self.scene.body.cells),)
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
        self.trajectories.close()
        self.steps.close()
        self._lock.close()


def fingerprint(scene: Scene) -> str:
    """Return a key that two scenes share if their contents are the same."""
    digest = hashlib.sha256()
    _feed(digest, scene)
    return digest.hexdigest()


def _numbers_of_module(function: FunctionType) -> dict[str, Any]:
    """Return the numbers, arrays and tuples of a function's module that it uses by name."""
    known = function.__globals__
    used = {name: known[name] for name in function.__code__.co_names if name in known}
    return {n: value for n, value in used.items() if isinstance(value, Real | np.ndarray | tuple)}


def _feed(digest: Any, value: Any) -> None:
    """Feed a value to a hash by its contents: fields, arrays, numbers, code of functions."""
    if isinstance(value, np.ndarray):
        digest.update(f"{value.dtype.kind}{value.shape}".encode() + value.tobytes())
    elif is_dataclass(value) and not isinstance(value, type):
        digest.update(type(value).__qualname__.encode())
        for field in fields(value):
            _feed(digest, (field.name, getattr(value, field.name)))
    elif isinstance(value, Mapping):
        _feed(digest, sorted(value.items(), key=lambda item: str(item[0])))
    elif isinstance(value, tuple | list):
        for item in value:
            _feed(digest, item)
    elif isinstance(value, Real) and not isinstance(value, bool):
        digest.update(repr(float(value)).encode())
    elif isinstance(value, partial):
        _feed(digest, (value.func, value.args, value.keywords))
    elif isinstance(value, MethodType):
        _feed(digest, (value.__func__, value.__self__))
    elif isinstance(value, FunctionType):
        closure = [cell.cell_contents for cell in value.__closure__ or ()]
        _feed(digest, (value.__code__, value.__defaults__, value.__kwdefaults__, closure))
        _feed(digest, _numbers_of_module(value))
    elif isinstance(value, CodeType):
        digest.update(value.co_code + repr(value.co_names).encode())
        _feed(digest, value.co_consts)
    elif hasattr(value, "__dict__"):
        digest.update(type(value).__qualname__.encode())
        _feed(digest, vars(value))
    else:
        digest.update(repr(value).encode())
