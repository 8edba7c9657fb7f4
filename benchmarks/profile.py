"""Where the time of the demo goes: simulated seconds per wall second, by part of the solver.

Five runs of the demo's second (gravity, then all eight muscles) with files and pictures left out;
the table gives the median run. PETSc's own event log counts factorisation and back-substitution.
The error is the largest distance of the tip from a run at a small dt, over its largest excursion.
"""

import time as clock

import numpy as np
from petsc4py import PETSc

from dolfin_tongue.anatomy.scenes import report_tongue
from dolfin_tongue.app.demo import Options
from dolfin_tongue.base.files import write_json
from dolfin_tongue.control import SmoothRamp
from dolfin_tongue.direct import TrBdf2
from dolfin_tongue.fenicsx import GeneralisedAlpha
from dolfin_tongue.geometry.preliminary import preliminary_tongue
from dolfin_tongue.march.compare import timed

REPEATS = 5
REFERENCE_DT = 3.125e-4
FACTORISATION = ("MatLUFactorSym", "MatLUFactorNum")


class Stopwatch:
    """Adds up the time spent in a method."""

    def __init__(self, owner, name):
        self.seconds, method = 0.0, getattr(owner, name)

        def timed(*arguments, **named):
            begin = clock.perf_counter()
            result = method(*arguments, **named)
            self.seconds += clock.perf_counter() - begin
            return result

        setattr(owner, name, timed)


def one_run(scene, dt):
    """One second of the demo; wall time of each part, s."""
    solver = GeneralisedAlpha(dt).solver(scene)
    parts = {
        "residual": Stopwatch(solver.system, "residual"),
        "tangent": Stopwatch(solver.system, "jacobian"),
    }
    events = {name: PETSc.Log.Event(name) for name in (*FACTORISATION, "MatSolve")}
    before = {name: event.getPerfInfo()["time"] for name, event in events.items()}
    begin = clock.perf_counter()
    for _ in solver.march(1.0):
        pass
    wall = clock.perf_counter() - begin
    spent = {name: event.getPerfInfo()["time"] - before[name] for name, event in events.items()}
    times = {name: watch.seconds for name, watch in parts.items()}
    times["factorisation"] = sum(spent[name] for name in FACTORISATION)
    times["back-substitution"] = spent["MatSolve"]
    times["stepping (TS, SNES, Python)"] = wall - sum(times.values())
    counts = {name.replace("_", " "): count for name, count in solver.counts().items()}
    return wall, times, counts


def tip_path(solver, tip):
    """Displacement of the tip at all steps, shape (steps + 1, 3), m."""
    return np.array([state.displacement[tip] for state in solver.march(1.0)])


def tip_error(path, reference):
    """Largest distance of a path from a finer one, over the largest excursion, in %."""
    error = path - reference[:: (len(reference) - 1) // (len(path) - 1)]
    return 100 * np.linalg.norm(error, axis=1).max() / np.linalg.norm(reference, axis=1).max()


def direct_rows(scene, reference):
    """Speed and error of the direct solver's implicit method, whose loose Newton is enough here."""
    tip = scene.body.landmark("tip")
    for dt in (5e-3, 1e-2):

        def make(dt=dt):
            return TrBdf2(dt, newton=1e-5).solver(scene)

        timed(make, 1.0, 1)  # compiles on first use
        timing, _ = timed(make, 1.0, REPEATS)
        label = f"direct, dt {1e3 * dt:g} ms:"
        spread = f"{1 / timing.largest:.2f} to {1 / timing.least:.2f}"
        yield f"{label} simulated seconds per wall second", f"{1 / timing.median:.2f} ({spread})"
        yield f"{label} tip error, %", tip_error(tip_path(make(), tip), reference)


def main(options: Options) -> dict[str, object]:
    """Run the benchmark; returns the table."""
    PETSc.Log.begin()
    body = preliminary_tongue(options.refinement)
    scene = report_tongue({m: SmoothRamp(0.5, 0.5, 0.1) for m in body.fibres.names}, body=body)
    begin = clock.perf_counter()
    one_run(scene, 0.05)  # compiles on first use
    table: dict[str, object] = {"cells": body.cell_count}
    table["compile and set-up, s"] = clock.perf_counter() - begin
    tip = body.landmark("tip")
    reference = tip_path(GeneralisedAlpha(REFERENCE_DT).solver(scene), tip)
    for dt in [options.dt] if options.dt else [2.5e-3, 5e-3, 10e-3]:
        runs = sorted((one_run(scene, dt) for _ in range(REPEATS)), key=lambda run: run[0])
        wall, times, counts = runs[REPEATS // 2]
        spread = f"{1 / runs[-1][0]:.2f} to {1 / runs[0][0]:.2f}"
        label = f"dt {1e3 * dt:g} ms:"
        table[f"{label} simulated seconds per wall second"] = f"{1 / wall:.2f} ({spread})"
        path = tip_path(GeneralisedAlpha(dt).solver(scene), tip)
        table[f"{label} tip error, %"] = tip_error(path, reference)
        table |= {f"{label} {name}, s": seconds for name, seconds in times.items()}
        table |= {f"{label} {name}": count for name, count in counts.items()}
        assert np.isclose(sum(times.values()), wall)
    table |= dict(direct_rows(scene, reference))
    write_json(options.folder / "profile.json", table)
    return table
