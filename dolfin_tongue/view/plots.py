"""Curves over time: landmarks, energies, contact, rigid bodies."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dolfin_tongue.base.files import replacing

#: Colours that are told apart by most eyes (Okabe and Ito), on white ground.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7a5230", "#444444")

_STYLE = {
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e6e6ea",
    "axes.edgecolor": "#55555c",
    "axes.axisbelow": True,
    "font.size": 10,
    "legend.frameon": False,
    "lines.linewidth": 1.7,
}


def new_figure(width: float, height: float) -> Any:
    """Make a matplotlib figure, in inches, that needs no display and no global state."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def save_figure(figure: Any, path: Path | str, dpi: int = 120) -> Path:
    """Write a figure, whole or not at all; return its path."""
    path = Path(path)
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=dpi)
    return path


def style() -> Any:
    """Return a context in which figures look like those of this package."""
    import matplotlib

    return matplotlib.rc_context(_STYLE)


def trajectories(table: Mapping[str, tuple[ArrayLike, ArrayLike]], path: Path | str) -> Path:
    """Draw landmarks over time and their paths in the midsagittal plane, tip to the left.

    Parameters
    ----------
    table : landmark -> (times (k,), s; positions (k, 3), mm).
    path : of the image; its suffix tells the format.

    Returns
    -------
    Path
        `path`.

    Raises
    ------
    ValueError : no landmarks, or times and positions that do not fit.
    """
    data = {name: _checked(name, *entry) for name, entry in table.items()}
    if not data:
        raise ValueError("there are no landmarks to draw")
    with style():
        figure = new_figure(11, 5.2)
        axes = figure.subplot_mosaic([["plane", "x"], ["plane", "z"]], width_ratios=[1, 1.15])
        for number, (name, (times, places)) in enumerate(data.items()):
            colour = COLOURS[number % len(COLOURS)]
            x, _, z = places.T
            axes["plane"].plot(x, z, color=colour, label=name.replace("_", " "))
            axes["plane"].plot(x[0], z[0], "o", color="white", mec=colour, mew=1.5, ms=6)
            axes["plane"].plot(x[-1], z[-1], "o", color=colour, ms=6)
            # Displacements: positions of all landmarks on one axis would be flat lines far apart.
            axes["x"].plot(1e3 * times, x - x[0], color=colour)
            axes["z"].plot(1e3 * times, z - z[0], color=colour)
        axes["plane"].set(
            xlabel="x, mm (front to back)", ylabel="z, mm (up)", aspect="equal",
            title="Paths from the start (open) to the end (filled)", adjustable="datalim",
        )  # fmt: skip
        axes["x"].set(ylabel="backward, mm", title="Displacement of the landmarks")
        axes["z"].set(xlabel="time, ms", ylabel="upward, mm")
        axes["x"].sharex(axes["z"])
        axes["plane"].legend(loc="best", fontsize=9)
        return save_figure(figure, path)


def _checked(name: str, times: ArrayLike, places: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Arrays of a trajectory; ValueError if they do not fit."""
    time, place = np.asarray(times, dtype=float), np.asarray(places, dtype=float)
    if not time.size or place.shape != (*time.shape, 3):
        raise ValueError(
            f"{name}: times of shape {time.shape} need positions of shape ({time.size}, 3), "
            f"at least one, not {place.shape}"
        )
    return time, place


def energy_plot(columns: Mapping[str, ArrayLike], path: Path | str) -> Path:
    """Draw energies and works over time, and under them the error of their balance.

    Parameters
    ----------
    columns : each of shape (k,). ``time_s`` or ``time``, s; the energies are the columns whose
        names end in ``_J``, or all others if none does, J. A name that begins with ``work_`` is
        drawn as a dashed line; ``balance`` and ``exchanged`` go into the lower part.
    path : of the image; its suffix tells the format.

    Returns
    -------
    Path
        `path`.

    Raises
    ------
    ValueError : no column of times, no energies.
    """
    table = {name: np.asarray(values, dtype=float) for name, values in columns.items()}
    time = table.pop("time_s", table.pop("time", None))
    if any(name.endswith("_J") for name in table):
        table = {name[:-2]: values for name, values in table.items() if name.endswith("_J")}
    if time is None or not table:
        raise ValueError(f"need a column time_s and energies (_J), not {', '.join(columns)}")
    balance, exchanged = table.pop("balance", None), table.pop("exchanged", None)
    with style():
        figure = new_figure(9, 5.4 if balance is None else 6.4)
        ratios = [1.0] if balance is None else [3.2, 1.0]
        rows = figure.subplots(len(ratios), 1, sharex=True, squeeze=False, height_ratios=ratios)
        axes = rows[:, 0]
        _draw_energies(axes[0], 1e3 * time, table)
        if balance is not None:
            _draw_balance(axes[1], 1e3 * time, balance, exchanged)
        axes[-1].set_xlabel("time, ms")
        return save_figure(figure, path)


def _draw_energies(axes: Any, time: np.ndarray, table: Mapping[str, np.ndarray]) -> None:
    """Draw energies (solid) and works (dashed), in mJ."""
    for number, (name, values) in enumerate(table.items()):
        work = name.startswith("work_")
        label = f"work of {name[5:]}" if work else name
        axes.plot(
            time, 1e3 * values, "--" if work else "-", label=label.replace("_", " "),
            color=COLOURS[number % len(COLOURS)],
        )  # fmt: skip
    axes.axhline(0.0, color="#55555c", lw=0.8)
    axes.set(ylabel="mJ", title="Energies of the body, and works done on it")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))


def _draw_balance(
    axes: Any, time: np.ndarray, balance: np.ndarray, exchanged: np.ndarray | None
) -> None:
    """Draw the error of the balance in micro-joule, and what share of all exchange it is."""
    axes.plot(time, 1e6 * balance, color="#444444")
    axes.axhline(0.0, color="#55555c", lw=0.8)
    title = "Error of the balance"
    if exchanged is not None and exchanged[-1] > 0:
        share = np.abs(balance).max() / exchanged[-1]
        title += f" (largest: {share:.1e} of the energy exchanged)"
    axes.set(ylabel="µJ", title=title)


def contact_plot(columns: Mapping[str, ArrayLike], path: Path | str) -> Path:
    """Draw resultant, area and largest pressure of each contact over time.

    Parameters
    ----------
    columns : each of shape (k,). ``time_s``, s; for each contact, e.g. ``contact``, the columns
        ``contact_area_m2``, ``contact_force_x_N``, ``_y_N``, ``_z_N`` (on the tissue) and, where
        there is one, ``contact_pressure_Pa``.
    path : of the image; its suffix tells the format.

    Returns
    -------
    Path
        `path`.

    Raises
    ------
    ValueError : no column of times, no contacts.
    """
    table = {name: np.asarray(values, dtype=float) for name, values in columns.items()}
    names = contact_names(table)
    if "time_s" not in table or not names:
        raise ValueError(
            f"need a column time_s and contacts (_area_m2, _force_x_N), not {', '.join(columns)}"
        )
    time = 1e3 * table["time_s"]
    pressed = any(f"{name}_pressure_Pa" in table for name in names)
    with style():
        figure = new_figure(9, 7.2 if pressed else 5.4)
        axes = figure.subplots(3 if pressed else 2, 1, sharex=True)
        for number, name in enumerate(names):
            colour, label = COLOURS[number % len(COLOURS)], name.replace("_", " ")
            force = np.array([table[f"{name}_force_{axis}_N"] for axis in "xyz"])
            axes[0].plot(time, np.linalg.norm(force, axis=0), color=colour, label=label)
            for part, dashes, way in ((0, ":", "backward"), (2, "--", "upward")):
                axes[0].plot(
                    time, force[part], dashes, color=colour, lw=1.2, label=f"{label}, {way}"
                )
            axes[1].plot(time, 1e6 * table[f"{name}_area_m2"], color=colour)
            if f"{name}_pressure_Pa" in table:
                axes[2].plot(time, 1e-3 * table[f"{name}_pressure_Pa"], color=colour)
        axes[0].axhline(0.0, color="#55555c", lw=0.8)
        axes[0].set(ylabel="N", title="Force of contact on the tissue: its size and its parts")
        axes[0].legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
        axes[1].set(ylabel="mm²", title="Area in contact")
        if pressed:
            axes[2].set(ylabel="kPa", title="Largest pressure")
        axes[-1].set_xlabel("time, ms")
        return save_figure(figure, path)


def contact_names(columns: Mapping[str, Any]) -> list[str]:
    """Contacts that have columns of area and force."""
    found = [name[: -len("_area_m2")] for name in columns if name.endswith("_area_m2")]
    return [name for name in found if all(f"{name}_force_{a}_N" in columns for a in "xyz")]


def rigid_plot(columns: Mapping[str, ArrayLike], path: Path | str) -> Path:
    """Draw the coordinates of rigid bodies over time.

    Parameters
    ----------
    columns : each of shape (k,). ``time_s``, s; for each body, e.g. ``mandible``, the columns
        ``mandible_x_m``, ``mandible_z_m`` and ``mandible_angle_rad``; others are left out.
    path : of the image; its suffix tells the format.

    Returns
    -------
    Path
        `path`.

    Raises
    ------
    ValueError : no column of times, no rigid bodies.
    """
    table = {name: np.asarray(values, dtype=float) for name, values in columns.items()}
    names = rigid_names(table)
    if "time_s" not in table or not names:
        raise ValueError(
            f"need a column time_s and rigid bodies (_x_m, _z_m, _angle_rad), not "
            f"{', '.join(columns)}"
        )
    parts = (
        ("angle_rad", 180 / np.pi, "degrees", "Rotation (negative: what lies in front sinks)"),
        ("x_m", 1e3, "mm", "Displacement backward"),
        ("z_m", 1e3, "mm", "Displacement upward"),
    )
    with style():
        figure = new_figure(9, 7.2)
        axes = figure.subplots(3, 1, sharex=True)
        for place, (ending, factor, unit, title) in zip(axes, parts, strict=True):
            for number, name in enumerate(names):
                place.plot(
                    1e3 * table["time_s"], factor * table[f"{name}_{ending}"],
                    color=COLOURS[number % len(COLOURS)], label=name.replace("_", " "),
                )  # fmt: skip
            place.axhline(0.0, color="#55555c", lw=0.8)
            place.set(ylabel=unit, title=title)
        axes[0].legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
        axes[-1].set_xlabel("time, ms")
        return save_figure(figure, path)


def rigid_names(columns: Mapping[str, Any]) -> list[str]:
    """Rigid bodies that have columns of their three coordinates."""
    found = [name[: -len("_angle_rad")] for name in columns if name.endswith("_angle_rad")]
    return [name for name in found if f"{name}_x_m" in columns and f"{name}_z_m" in columns]
