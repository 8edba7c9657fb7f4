"""Where the time of the demo goes: simulated seconds per wall second, by part of the solver.

Five runs of the demo's second (gravity, then all eight muscles) with files and pictures left out;
the table gives the median run. PETSc's own event log counts factorisation and back-substitution.
The error is the largest distance of the tip from a run at a small dt, over its largest excursion.
"""

import time as clock

import numpy as np
from petsc4py import PETSc

from dolfin_tongue.control import SmoothRamp
from dolfin_tongue.demo import Options
from dolfin_tongue.files import write_json
from dolfin_tongue.geometry.preliminary import preliminary_tongue
from dolfin_tongue.scenes import report_tongue
from dolfin_tongue.solve.dynamics import Dynamics, TimeSteps

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
    dynamics = Dynamics(scene, TimeSteps(dt))
    system = dynamics.system
    parts = {
        "set arguments": Stopwatch(system, "set_state"),
        "residual": Stopwatch(system, "residual"),
        "tangent": Stopwatch(system, "jacobian"),
    }
    events = {name: PETSc.Log.Event(name) for name in (*FACTORISATION, "MatSolve")}
    before = {name: event.getPerfInfo()["time"] for name, event in events.items()}
    begin = clock.perf_counter()
    steps = sum(1 for _ in dynamics.march(1.0)) - 1
    wall = clock.perf_counter() - begin
    spent = {name: event.getPerfInfo()["time"] - before[name] for name, event in events.items()}
    times = {name: watch.seconds for name, watch in parts.items()}
    times["factorisation"] = sum(spent[name] for name in FACTORISATION)
    times["back-substitution"] = spent["MatSolve"]
    times["stepping (TS, SNES, Python)"] = wall - sum(times.values())
    counts = {
        "steps": steps,
        "Newton iterations": dynamics.newton.iterations,
        "residuals": dynamics.newton.residuals,
        "factorisations": dynamics.newton.factorisations,
    }
    return wall, times, counts


def tip_path(scene, dt):
    """Displacement of the tip at all steps, shape (steps + 1, 3), m."""
    tip = scene.body.landmark("tip")
    return np.array([s.displacement[tip] for s in Dynamics(scene, TimeSteps(dt)).march(1.0)])


def main(options: Options) -> dict[str, object]:
    """Run the benchmark; returns the table."""
    PETSc.Log.begin()
    body = preliminary_tongue(options.refinement)
    scene = report_tongue({m: SmoothRamp(0.5, 0.5, 0.1) for m in body.fibres.names}, body=body)
    begin = clock.perf_counter()
    one_run(scene, 0.05)  # compiles on first use
    table: dict[str, object] = {"cells": len(body.cells)}
    table["compile and set-up, s"] = clock.perf_counter() - begin
    reference = tip_path(scene, REFERENCE_DT)
    for dt in [options.dt] if options.dt else [2.5e-3, 5e-3, 10e-3]:
        runs = sorted((one_run(scene, dt) for _ in range(REPEATS)), key=lambda run: run[0])
        wall, times, counts = runs[REPEATS // 2]
        spread = f"{1 / runs[-1][0]:.2f} to {1 / runs[0][0]:.2f}"
        label = f"dt {1e3 * dt:g} ms:"
        table[f"{label} simulated seconds per wall second"] = f"{1 / wall:.2f} ({spread})"
        error = tip_path(scene, dt) - reference[:: round(dt / REFERENCE_DT)]
        excursion = np.linalg.norm(reference, axis=1).max()
        table[f"{label} tip error, %"] = 100 * np.linalg.norm(error, axis=1).max() / excursion
        table |= {f"{label} {name}, s": seconds for name, seconds in times.items()}
        table |= {f"{label} {name}": count for name, count in counts.items()}
        assert np.isclose(sum(times.values()), wall)
    write_json(options.folder / "profile.json", table)
    return table
