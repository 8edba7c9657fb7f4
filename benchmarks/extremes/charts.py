"""The map of dt against stiffness and viscosity: which runs finish, and what ends the others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dolfin_tongue.view.plots import COLOURS, new_figure, save_figure, style

#: Steps of the map, s, and what is along its other axis: a factor, or Pa s.
MAP_STEPS = (1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2)
AXES = {
    "factor": tuple(10.0**k for k in range(-3, 4)),
    "viscosity": tuple(10.0**k for k in range(-2, 5)),
}
LABELS = {"factor": "factor of the passive modulus", "viscosity": "viscosity, Pa s"}

#: Colour, marker and label of each outcome; a finished run is hollow where its path is off by more.
POOR = 0.1
LOOK = {
    "finished": (COLOURS[2], "o", "finished, volumes kept (hollow: tip off by > 10 %)"),
    "drifted": (COLOURS[4], "D", "finished, volumes not kept to 1e-8"),
    "throttled": (COLOURS[3], "v", "alive but throttled, given up"),
    "refused": (COLOURS[5], "s", "refused: limit by viscosity (v), stiffness (k), tau (t)"),
    "stopped": (COLOURS[1], "X", "stopped, with time and cause"),
    "fault": ("#000000", "*", "FAULT"),
}  # fmt: skip


@dataclass(frozen=True)
class Point:
    """One run of the map.

    Parameters
    ----------
    method : label of the method.
    axis : ``factor`` (of the passive modulus) or ``viscosity`` (Pa s).
    value : on that axis.
    dt : s.
    kind, cause : outcome.
    error : largest distance of the end's path from a reference over its largest excursion.
    steps, wall : accepted steps; wall time, s.
    volume : largest relative volume change of a cell.
    """

    method: str
    axis: str
    value: float
    dt: float
    kind: str
    cause: str
    error: float
    steps: int
    wall: float
    volume: float

    @property
    def letter(self) -> str:
        """Letter of the limit by which a run was refused."""
        for word, letter in (("the viscosity", "v"), ("tau =", "t"), ("stiffness", "k")):
            if self.kind == "refused" and word in self.cause.partition("limit")[2]:
                return letter
        return ""


def draw_map(points: Sequence[Point], methods: Sequence[str], path: Path) -> Path:
    """Draw small multiples, a row per axis and a column per method."""
    with style():
        figure = new_figure(2.55 * len(methods), 6.6)
        axes = figure.subplots(2, len(methods), sharex=True, sharey="row", squeeze=False)
        for row, axis in enumerate(LABELS):
            for column, method in enumerate(methods):
                part = [p for p in points if p.axis == axis and p.method == method]
                _draw_panel(axes[row, column], part)
                if row == 0:
                    axes[row, column].set_title(method, fontsize=10.5)
            axes[row, 0].set_ylabel(LABELS[axis])
        for panel in axes[-1]:
            panel.set_xlabel("dt, ms")
        _legend(figure, {p.kind for p in points})
        return save_figure(figure, path)


def _draw_panel(axes: Any, points: Sequence[Point]) -> None:
    for point in points:
        colour, marker, _ = LOOK[point.kind]
        poor = point.kind == "finished" and not point.error <= POOR
        axes.plot(
            1e3 * point.dt, point.value, marker, ms=9, mew=1.6, color=colour,
            mfc="white" if poor else colour,
        )  # fmt: skip
        if point.letter:
            axes.annotate(
                point.letter, (1e3 * point.dt, point.value), ha="center", va="center", fontsize=8
            )
    axes.set(xscale="log", yscale="log")
    axes.margins(0.09)
    steps = sorted({1e3 * p.dt for p in points})
    axes.set_xticks(steps, [f"{dt:g}" for dt in steps])
    axes.minorticks_off()


def _legend(figure: Any, kinds: set[str]) -> None:
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], ls="", marker=marker, color=colour, ms=8, label=label)
        for kind, (colour, marker, label) in LOOK.items()
        if kind in kinds
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=3)


def counted(points: Sequence[Point]) -> str:
    """How many runs ended how."""
    counts = {kind: sum(p.kind == kind for p in points) for kind in LOOK}
    return ", ".join(f"{count} {kind}" for kind, count in counts.items() if count)


def path_error(
    times: np.ndarray, path: np.ndarray, reference: tuple[np.ndarray, np.ndarray]
) -> float:
    """Largest distance of a path (k, 3) from a reference over the reference's excursion."""
    at, values = reference
    expected = np.column_stack([np.interp(times, at, values[:, i]) for i in range(3)])
    excursion = np.linalg.norm(values, axis=1).max()
    return float(np.linalg.norm(path - expected, axis=1).max() / excursion)
