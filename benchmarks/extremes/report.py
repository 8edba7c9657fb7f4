"""The table of runs: one row per scene and solver, on disk while the benchmark goes."""

from __future__ import annotations

import csv
import io
import time as clock
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from benchmarks.extremes.outcome import Outcome, attempt
from dolfin_tongue.base.files import write_json, write_text
from dolfin_tongue.body.state import State
from dolfin_tongue.direct import TrBdf2
from dolfin_tongue.fenicsx import GeneralisedAlpha
from dolfin_tongue.march.solver import Method
from dolfin_tongue.scene.scene import Scene

FENICSX, DIRECT = "FEniCSx", "direct"


def both(dt: float = 5e-3, tolerance: float | None = None) -> tuple[GeneralisedAlpha, TrBdf2]:
    """Return the method of each solver that is meant for production."""
    return GeneralisedAlpha(dt, tolerance=tolerance), TrBdf2(dt, tolerance=tolerance)


def solver_of(method: Method) -> str:
    """Which solver a method belongs to."""
    return FENICSX if isinstance(method, GeneralisedAlpha) else DIRECT


@dataclass
class Report:
    """Collects runs, prints them and keeps the files up to date.

    Parameters
    ----------
    folder : for ``extremes.csv``, ``extremes.json`` and the folders of the runs.
    rows : one per run.
    """

    folder: Path
    rows: list[dict] = field(default_factory=list)
    begin: float = field(default_factory=clock.perf_counter)

    def runs(
        self, name: str, scene: Scene, end: float, methods: Sequence[Method] | None = None,
        start: State | None = None,
    ) -> None:  # fmt: skip
        """Attempt a scene with several methods, each in a folder of its own."""
        for method in both() if methods is None else methods:
            self.add(name, method, self.attempt(name, scene, end, method, start))

    def attempt(
        self, name: str, scene: Scene, end: float, method: Method, start: State | None = None
    ) -> Outcome:
        """Attempt one run, without a row."""
        return attempt(scene, end, self.run_folder(name, method), method, start)

    def run_folder(self, name: str, method: Method) -> Path:
        """Folder of a run."""
        words = "".join(c if c.isalnum() or c == "." else " " for c in name).split()
        return self.folder / "_".join(words) / solver_of(method)

    def add(self, name: str, method: Method, outcome: Outcome, note: str = "") -> None:
        """Take up the outcome of a run."""
        numbers = {
            "time_s": outcome.time, "steps": outcome.steps, "max_volume_change": outcome.volume,
            "wall_s": outcome.wall,
        }  # fmt: skip
        self.row(name, solver_of(method), outcome.short, note, outcome.kind, numbers, outcome.cause)

    def row(
        self, name: str, solver: str, text: str, note: str = "", kind: str = "solved",
        numbers: dict[str, float] | None = None, cause: str = "",
    ) -> None:  # fmt: skip
        """Add a row, print it, and write the files anew."""
        blank = dict.fromkeys(("time_s", "steps", "max_volume_change", "wall_s"))
        row = {"scene": name, "solver": solver, "outcome": text, "note": note, "kind": kind}
        self.rows.append(row | (numbers or blank) | {"cause": cause})
        elapsed = clock.perf_counter() - self.begin
        print(f"{elapsed:5.0f} s  {name} | {solver}: {text}; {note}".rstrip("; "), flush=True)
        write_csv(self.folder / "extremes.csv", self.rows)
        write_json(self.folder / "extremes.json", self.rows)

    def table(self) -> dict[str, dict[str, str]]:
        """One row per scene, one column per solver."""
        table: dict[str, dict[str, str]] = {}
        for row in self.rows:
            cells = table.setdefault(row["scene"], {FENICSX: "", DIRECT: "", "note": ""})
            cells[row["solver"]] = row["outcome"]
            if row["note"] not in cells["note"]:
                cells["note"] = f"{cells['note']}; {row['note']}".strip("; ")
        return table


def write_csv(path: Path, rows: list[dict]) -> None:
    """Write rows with the keys of the first as columns."""
    text = io.StringIO()
    writer = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    write_text(path, text.getvalue())


def markdown(table: dict[str, dict[str, str]]) -> str:
    """Return the table for the documentation."""
    columns = list(next(iter(table.values())))
    lines = ["| scene | " + " | ".join(columns) + " |", "|---" * (len(columns) + 1) + "|"]
    lines += [f"| {name} | " + " | ".join(row.values()) + " |" for name, row in table.items()]
    return "\n".join(lines) + "\n"
