"""A table over time that grows while a run goes, and the rows of a run's tables."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any, Literal, TextIO

import numpy as np

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.base.files import write_text
from dolfin_tongue.body.body import Body
from dolfin_tongue.body.state import State
from dolfin_tongue.control import Instant
from dolfin_tongue.march.observed import MuscleState, Touch
from dolfin_tongue.rigid import COORDINATES
from dolfin_tongue.rigid.loads import Loads
from dolfin_tongue.scene.scene import Scene


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


def landmark_positions(body: Body, state: State) -> dict[str, FloatArray]:
    """Position of each landmark, shape (3,), m."""
    return {
        name: body.points[node] + state.displacement[node] for name, node in body.landmarks.items()
    }


def trajectory_row(scene: Scene, state: State) -> dict[str, float]:
    """Positions of the landmarks, m, and coordinates of the rigid bodies, m and rad."""
    row = {"time_s": state.time}
    for name, position in landmark_positions(scene.body, state).items():
        row |= {f"{name}_{axis}_m": float(x) for axis, x in zip("xyz", position, strict=True)}
    for bone, q in zip(scene.rigid_bodies, state.rigid, strict=True):
        units = zip(COORDINATES, ("m", "m", "rad"), np.asarray(q), strict=True)
        row |= {f"{bone.name}_{name}_{unit}": float(x) for name, unit, x in units}
    return row


def contact_columns(contacts: dict[str, Touch]) -> dict[str, float]:
    """Area, resultant, largest pressure and smallest gap of each contact."""
    row: dict[str, float] = {}
    for name, touch in contacts.items():
        row[f"{name}_area_m2"] = touch.area
        row |= {f"{name}_force_{a}_N": float(x) for a, x in zip("xyz", touch.force, strict=True)}
        row[f"{name}_pressure_Pa"] = touch.traction
        row[f"{name}_gap_m"] = touch.gap
    return row


def muscle_row(muscles: dict[str, MuscleState], scene: Scene, state: State) -> dict[str, float]:
    """Activation and force of each muscle, N, its mean fibre stretch and rate of it, 1/s.

    Muscles as lines on bones have activation and force; their names begin with the bone's.
    """
    row: dict[str, float] = {"time_s": state.time}
    for name, muscle in muscles.items():
        row[f"{name}_activation"] = muscle.activation
        row[f"{name}_force_N"] = muscle.force
        row[f"{name}_stretch"] = float(muscle.stretch.mean())
        row[f"{name}_stretch_rate_per_s"] = float(muscle.rate.mean())
    loads = Loads(scene.rigid_bodies, np.zeros(3)) if scene.rigid_bodies else None
    if loads is not None:
        now = Instant(state.time, state.memory)
        lines = loads.muscles(now, state.rigid.ravel(), state.rigid_rate.ravel())
        for (bone, name), (activation, force) in lines.items():
            row[f"{bone}_{name}_activation"] = activation
            row[f"{bone}_{name}_force_N"] = force
    return row
