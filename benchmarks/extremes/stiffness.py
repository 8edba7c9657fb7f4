"""Runs of the map: a block at every dt, stiffness and viscosity, with every method."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np

from benchmarks.extremes import charts, scenes
from benchmarks.extremes.outcome import attempt_march
from benchmarks.extremes.report import DIRECT, FENICSX, write_csv
from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.body.state import State
from dolfin_tongue.direct import Adaptive, RungeKutta4, TrBdf2
from dolfin_tongue.fenicsx import GeneralisedAlpha
from dolfin_tongue.march.solver import Method
from dolfin_tongue.scene.scene import Scene

#: Methods of the map: label, and the method for a step (s).
METHODS: dict[str, Callable[[float], Method]] = {
    "alpha2, radius 0": lambda dt: GeneralisedAlpha(dt, spectral_radius=0.0),
    "alpha2, radius 0.8": lambda dt: GeneralisedAlpha(dt),
    "alpha2, radius 1": lambda dt: GeneralisedAlpha(dt, spectral_radius=1.0),
    "RungeKutta4": lambda dt: RungeKutta4(dt),
    "Adaptive (largest dt)": lambda dt: Adaptive(largest=dt),
    "TrBdf2": lambda dt: TrBdf2(dt),
}
END = 0.06
#: Accepted steps after which a run of the map is given up; the smallest dt takes 600.
MOST = 2000


def stiffness_map(folder: Path) -> list[charts.Point]:
    """Run the block at every dt, stiffness and viscosity with every method."""
    points: list[charts.Point] = []
    for axis, values in charts.AXES.items():
        for value in values:
            scene = scenes.muscle_block(**{axis: value})
            _, states = attempt_march(scene, END, TrBdf2(5e-5, newton=1e-9))
            fine = np.array([s.time for s in states]), _end_path(scene, states)
            part = [
                _point(scene, fine, method, axis, value, dt)
                for method in METHODS
                for dt in charts.MAP_STEPS
            ]
            points += part
            write_csv(folder / "map.csv", [asdict(point) for point in points])
            print(f"       map, {axis} {value:g}: {charts.counted(part)}", flush=True)
    charts.draw_map(points, list(METHODS), folder / "stability.png")
    return points


def _point(
    scene: Scene, fine: tuple[FloatArray, FloatArray], method: str, axis: str, value: float,
    dt: float,
) -> charts.Point:  # fmt: skip
    """One run of the map, compared with the path at a small step."""
    outcome, states = attempt_march(scene, END, METHODS[method](dt), most=MOST)
    path = _end_path(scene, states)
    error = charts.path_error(outcome.times, path, fine) if states else np.nan
    return charts.Point(
        method, axis, value, dt, outcome.kind, outcome.cause, error, outcome.steps, outcome.wall,
        outcome.volume,
    )  # fmt: skip


def map_rows(points: list[charts.Point]) -> Iterator[tuple[str, dict[str, str]]]:
    """Per method and axis: how many runs ended how, and how many paths are right."""
    for method in METHODS:
        for axis in charts.AXES:
            part = [p for p in points if (p.method, p.axis) == (method, axis)]
            alive = [p for p in part if p.kind in ("finished", "drifted")]
            good = sum(p.error <= charts.POOR for p in alive)
            note = f"{good} of {len(part)} right to {100 * charts.POOR:.0f} %"
            worst = max((p.error for p in alive), default=np.nan)
            note += f"; the worst that finished is off by {100 * worst:.0f} %"
            solver = FENICSX if method.startswith("alpha2") else DIRECT
            cells = {FENICSX: "", DIRECT: "", "note": note} | {solver: charts.counted(part)}
            yield f"map, {axis}: {method}", cells


def _end_path(scene: Scene, states: Sequence[State]) -> FloatArray:
    """Displacement of the end of the block over a motion, shape (states, 3), m."""
    node = scene.body.landmark("end")
    return np.array([state.displacement[node] for state in states]).reshape(-1, 3)
