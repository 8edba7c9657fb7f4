"""Both solvers, the same motion: differences against dt for the report's and a published tongue.

The reference is the direct solver: on the report's tongue its adaptive Runge-Kutta pair of order 8
with a tight tolerance; on the published tongue (with --data), whose small cells would throttle an
explicit method to microseconds, its implicit method at two small steps, extrapolated (Richardson).
The FEniCSx solver runs at a sequence of dt. Differences are largest values over sampled times and
all nodes (cells), relative to the largest value of the reference.
"""

from dataclasses import astuple

from dolfin_tongue.anatomy.scenes import published_scene, report_tongue
from dolfin_tongue.app.demo import Options
from dolfin_tongue.base.files import replacing, write_json, write_text
from dolfin_tongue.body.state import State
from dolfin_tongue.control import Ramp, SmoothRamp
from dolfin_tongue.direct import Adaptive, TrBdf2
from dolfin_tongue.fenicsx import GeneralisedAlpha, Tolerances
from dolfin_tongue.geometry.preliminary import preliminary_tongue
from dolfin_tongue.geometry.published import published_tongue
from dolfin_tongue.march.compare import at_times, difference, orders, visiting

TIGHT = Tolerances(1e-12, 1e-12)
REPORT_STEPS = (4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4, 1.25e-4, 6.25e-5)
PUBLISHED_STEPS = (4e-3, 2e-3, 1e-3, 5e-4)


def report_cases():
    """Name, scene and end of each case on the report's tongue."""
    body = preliminary_tongue()
    everything = {name: SmoothRamp(0.5, 0.06, 0.048) for name in body.fibres.names}
    yield "gravity, then all muscles", report_tongue(everything, body=body), 0.12
    for name in body.fibres.names:
        yield name, report_tongue({name: SmoothRamp(0.5, 0.0, 0.048)}, body=body), 0.06


def samples(end):
    """Return the times at which motions are compared: every 4 ms."""
    return [0.004 * (k + 1) for k in range(round(end / 0.004))]


def fenicsx_differences(scene, end, steps, reference):
    """Differences of the FEniCSx solver from the reference, one per dt."""
    rows = []
    for dt in steps:
        states = GeneralisedAlpha(dt, newton=TIGHT).solver(scene).march(end)
        rows.append(difference(at_times(states, samples(end)), reference))
    return rows


def extrapolated(scene, end, dt):
    """Motion of the direct implicit method at dt and dt/2, extrapolated to order 3 or 4."""
    coarse, fine = (
        at_times(TrBdf2(h, newton=1e-9).solver(scene).march(end), samples(end))
        for h in (dt, dt / 2)
    )

    def mean(name, a, b):
        return (4 * getattr(b, name) - getattr(a, name)) / 3

    names = ("displacement", "velocity", "pressure")
    return [
        State(a.time, *(mean(name, a, b) for name in names))
        for a, b in zip(coarse, fine, strict=True)
    ]


def table_of(name, steps, rows):
    """Rows of the printed table and the CSV."""
    order = [None, *orders(steps, [row.displacement for row in rows])]
    for dt, row, p in zip(steps, rows, order, strict=True):
        yield name, dt, *astuple(row), p


def main(options: Options) -> dict[str, object]:
    """Run all cases; returns the table, writes CSV, JSON and a plot as it goes."""
    table, printed = [], {}
    for name, scene, end in _cases(options):
        published = name.startswith("published")
        if published:
            reference, steps = extrapolated(scene, end, 5e-4), PUBLISHED_STEPS
        else:
            solver = Adaptive(tolerance=1e-10, rtol=1e-9).solver(scene)
            reference, steps = visiting(solver, samples(end)), REPORT_STEPS
        rows = fenicsx_differences(scene, end, steps, reference)
        table += table_of(name, steps, rows)
        _write(options.folder, table)
        observed = orders(steps, [row.displacement for row in rows])
        printed[name] = {
            "u at 4 ms": f"{rows[0].displacement:.1e}",
            "smallest dt, ms": f"{1e3 * steps[-1]:g}",
            "u": f"{rows[-1].displacement:.1e}",
            "v": f"{rows[-1].velocity:.1e}",
            "p": f"{rows[-1].pressure:.1e}",
            "order in u": f"{min(observed):.2f} to {max(observed):.2f}",
        }
        print(name, printed[name], flush=True)
    _plot(options.folder, table)
    return printed


def _cases(options):
    yield from report_cases()
    if options.data is None:
        print("no published tongue (--data): its case is left out")
        return
    body = published_tongue(options.data)
    yield (
        "published tongue, GGP",
        published_scene(options.data, {"GGP": Ramp(0.5, 0.0, 0.048)}, body),
        0.1,
    )


COLUMNS = ("case", "dt_s", "displacement", "velocity", "pressure", "order")


def _write(folder, table):
    lines = [",".join(COLUMNS)]
    lines += [",".join(f'"{x}"' if isinstance(x, str) else f"{x}" for x in row) for row in table]
    write_text(folder / "crosscheck.csv", "\n".join(lines) + "\n")
    write_json(folder / "crosscheck.json", [dict(zip(COLUMNS, row, strict=True)) for row in table])


def _plot(folder, table):
    """Draw differences against dt, one line per case, with a slope of 2."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 4.2), layout="constrained")
    for axes, quantity in zip(figure.subplots(1, 3, sharey=True), COLUMNS[2:5], strict=True):
        column = COLUMNS.index(quantity)
        for name in dict.fromkeys(row[0] for row in table):
            rows = [row for row in table if row[0] == name]
            axes.loglog(
                [1e3 * r[1] for r in rows], [r[column] for r in rows], "o-", ms=3, label=name
            )
        axes.loglog([0.1, 5], [1e-6, 2.5e-3], "k:", label="slope 2")
        axes.set(title=quantity, xlabel="dt of the FEniCSx solver, ms")
        axes.grid(alpha=0.3)
    figure.axes[0].set_ylabel("largest difference from the direct solver, relative")
    figure.axes[-1].legend(fontsize=7)
    with replacing(folder / "crosscheck.png") as path:
        figure.savefig(path, dpi=140)
