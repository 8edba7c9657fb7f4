"""Plots of the benchmark `accuracy`: error against run time."""

import numpy as np

from dolfin_tongue.base.files import replacing


def plot_time(path, name, rows, methods):
    """Draw tip error against wall seconds per simulated second, one line per method."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 5), layout="constrained")
    axes = figure.subplots()
    for method in methods:
        found = [r for r in rows if (r["scene"], r["method"]) == (name, method) and "wall_s" in r]
        if not found:
            continue
        end = [r["wall_s"] * r["simulated_per_wall"] for r in found]
        wall = np.array(
            [[r[k] for k in ("wall_s", "wall_least_s", "wall_largest_s")] for r in found]
        )
        wall /= np.array(end)[:, None]
        spread = [wall[:, 0] - wall[:, 1], wall[:, 2] - wall[:, 0]]
        axes.errorbar(
            wall[:, 0], [r["tip_error"] for r in found], xerr=spread, marker="o", ms=4, label=method
        )
    axes.axvline(1.0, color="0.6", lw=1)
    axes.text(1.0, axes.get_ylim()[1], " real time", va="top", color="0.4", fontsize=8)
    axes.axhline(0.01, color="0.6", lw=1, ls=":")
    axes.set(
        xscale="log", yscale="log", title=f"{name}: error in time against run time",
        xlabel="wall seconds per simulated second", ylabel="largest error of the tip, relative",
    )  # fmt: skip
    axes.grid(alpha=0.3, which="both")
    axes.legend(fontsize=8)
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=130)


def plot_space(path, rows):
    """Draw tip error against wall time of a static solve, one line per pair."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 4.5), layout="constrained")
    names = list(dict.fromkeys(row["scene"] for row in rows))
    for axes, name in zip(figure.subplots(1, len(names), squeeze=False)[0], names, strict=True):
        for pair in dict.fromkeys(row["pair"] for row in rows):
            found = [r for r in rows if (r["scene"], r["pair"]) == (name, pair) and "unknowns" in r]
            found = [r for r in found if r["tip_error"] > 0]
            axes.loglog(
                [r["wall_s"] for r in found], [r["tip_error"] for r in found], "o-", label=pair
            )
            for r in found:
                axes.annotate(r["mesh"], (r["wall_s"], r["tip_error"]), fontsize=7)
        axes.set(
            title=name, xlabel="wall time of the static solve, s", ylabel="tip error, relative"
        )
        axes.grid(alpha=0.3, which="both")
        axes.legend(fontsize=8)
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=130)
