"""Error against run time: methods of both solvers in time, pairs of spaces in space.

Each scene and method runs in a process of its own, so that its peak memory is its own; set-up
(compilation, if the cache has none, and first use) is reported apart from marching. Errors in time
are against two small steps of `alpha2`, extrapolated (Richardson), whose agreement with the direct
solver `bench crosscheck` shows. Errors in space are those of static equilibria against the finest
pair. Options: --data adds the published tongue.
"""

import json
import subprocess
import sys
import time as clock
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.plots.accuracy import plot_space, plot_time
from dolfin_tongue.anatomy.scenes import published_scene, report_tongue
from dolfin_tongue.app.demo import CHECKOUT, Options
from dolfin_tongue.base.errors import TongueError
from dolfin_tongue.base.files import replacing, write_json, write_text
from dolfin_tongue.body.shape import volume_changes, volume_ratios
from dolfin_tongue.boundary import Attached
from dolfin_tongue.constitutive import ActiveMuscles, ReportTissue, Viscosity
from dolfin_tongue.control import Constant, SmoothRamp
from dolfin_tongue.direct import Adaptive, RungeKutta4, TrBdf2
from dolfin_tongue.fenicsx import GeneralisedAlpha, Statics, Tolerances
from dolfin_tongue.geometry.preliminary import preliminary_tongue
from dolfin_tongue.geometry.published import published_tongue
from dolfin_tongue.geometry.simple import block_body
from dolfin_tongue.march.compare import at_times, interpolated, landmark_path, peak_memory, timed
from dolfin_tongue.record.observe import EnergyAudit
from dolfin_tongue.scene.scene import Scene

REPEATS = 3
SAMPLE = 0.01  # s; every step used here divides it
STEPS = (1e-2, 5e-3, 2.5e-3, 1.25e-3)
TIGHT = Tolerances(1e-11, 1e-11)


# -- scenes ------------------------------------------------------------------------------------


def block(cells=(4, 2, 2), level=None):
    """Block of 40 x 20 x 20 mm with one muscle, oblique, held at one end."""
    body = block_body((0.04, 0.02, 0.02), cells, muscles={"oblique": (0.9, 0.0, 0.436)})
    muscle = ActiveMuscles({"oblique": level or SmoothRamp(0.5, 0.0, 0.05)}, 20e3)
    body = replace(body, landmarks={**body.landmarks, "tip": body.landmark("end")})
    return Scene(body, (ReportTissue(), Viscosity(60.0), muscle), (Attached("x0"),))


def tongue(refinement):
    """Return the report's tongue: gravity, all muscles from 0.05 s."""
    body = preliminary_tongue(refinement)
    active = {name: SmoothRamp(0.5, 0.05, 0.05) for name in body.fibres.names}
    return report_tongue(active, body=body)


def published(folder):
    """Return the published tongue: gravity and GGP."""
    body = published_tongue(Path(folder))
    return published_scene(Path(folder), {"GGP": SmoothRamp(0.5, 0.0, 0.05)}, body)


#: Scenes in time: end (s) and the step of the finer reference run (s).
SCENES = {
    "block, one muscle": (0.2, 1.25e-4),
    "report's tongue": (0.2, 1.25e-4),
    "report's tongue, refined": (0.1, 2.5e-4),
    "published tongue": (0.1, 2.5e-4),
}


def scene_of(name, data):
    """Build a scene by its name."""
    if name == "block, one muscle":
        return block()
    if name == "published tongue":
        return published(data)
    return tongue(2 if "refined" in name else 1)


# -- methods -----------------------------------------------------------------------------------


def alpha(radius, **newton):
    """Generalised-alpha with a spectral radius, lagged Newton unless told otherwise."""
    tolerances = Tolerances(**newton)
    return lambda dt: GeneralisedAlpha(dt, spectral_radius=radius, newton=tolerances)


#: Label -> the method for a step (s).
METHODS = {
    "alpha2 radius 1": alpha(1.0),
    "alpha2 radius 0.8": alpha(0.8),
    "alpha2 radius 0.5": alpha(0.5),
    "alpha2 radius 0.8, full Newton": alpha(0.8, renew_above=0.0),
    "backward Euler": lambda dt: GeneralisedAlpha(dt, method="backward_euler"),
    "direct implicit": TrBdf2,
    "direct implicit, loose Newton": lambda dt: TrBdf2(dt, newton=1e-5),
    "direct linearly implicit": lambda dt: TrBdf2(dt, corrections=1),
}
#: Explicit methods run at their stability limit whatever dt: once per scene, where cells are large.
EXPLICIT = {
    "direct Runge-Kutta 4": lambda dt: RungeKutta4(dt, cut=True),
    "direct adaptive": lambda dt: Adaptive(1e-6, rtol=1e-4, pair="RK45"),
}
EXPLICIT_SCENES = ("block, one muscle", "report's tongue")
EXPLICIT_END = 0.1


# -- one scene and method, in its own process ------------------------------------------------------


def measure(name, method, data, reference):
    """All steps of a method on a scene; list of rows."""
    scene = scene_of(name, data)
    explicit = method in EXPLICIT
    make = (EXPLICIT if explicit else METHODS)[method]
    end = min(SCENES[name][0], EXPLICIT_END) if explicit else SCENES[name][0]
    rows = []
    for dt in [STEPS[-1]] if explicit else STEPS:
        row = {"scene": name, "method": method, "dt_s": dt}
        try:
            rows.append(row | one_step_size(scene, make(dt), end, reference, explicit))
        except TongueError as error:
            rows.append(row | {"outcome": str(error)})
    return rows


def one_step_size(scene, method, end, reference, explicit):
    """Measure set-up, marching and errors at one dt."""
    begin = clock.perf_counter()
    solver = method.solver(scene)
    next(iter(solver.march(end)))
    set_up = clock.perf_counter() - begin
    timing, states = timed(lambda: method.solver(scene), end, 1 if explicit else REPEATS)
    times = [SAMPLE * (k + 1) for k in range(round(end / SAMPLE))]
    exact = interpolated(states, times)
    nodes = [scene.body.landmark("tip"), scene.body.landmark(second_landmark(scene))]
    error = landmark_path(exact, nodes) - reference[: len(times)]
    body, largest = scene.body, np.linalg.norm(reference, axis=2).max(axis=0)
    tip, dorsum = np.linalg.norm(error, axis=2).max(axis=0) / largest
    return {
        "outcome": "finished",
        "steps": len(states) - 1,
        "wall_s": timing.median,
        "wall_least_s": timing.least,
        "wall_largest_s": timing.largest,
        "set_up_s": set_up,
        "simulated_per_wall": end / timing.median,
        "tip_error": tip,
        "dorsum_error": dorsum,
        "volume_error": max(
            float(np.abs(volume_changes(scene.body, s.displacement)).max()) for s in states
        ),
        "local_volume_error": max(
            float(np.abs(part - 1).max())
            for s in states
            for part in volume_ratios(body, s.displacement)
        ),
        "energy_error": balance_error(solver, states),
        "peak_memory_MB": peak_memory() / 1e6,
    }


def balance_error(solver, states):
    """Largest error of the energy balance over the energy exchanged."""
    audit = EnergyAudit(solver, solver.scene)
    records = [audit.update(state) for state in states]
    return max(abs(r["balance_J"]) for r in records) / records[-1]["exchanged_J"]


def second_landmark(scene):
    """Name of the landmark observed beside the tip."""
    return "dorsum" if "dorsum" in scene.body.landmarks else "tip"


def reference_path(name, data):
    """Path of tip and dorsum at the sampled times, extrapolated from two small steps."""
    scene, (end, dt) = scene_of(name, data), SCENES[name]
    times = [SAMPLE * (k + 1) for k in range(round(end / SAMPLE))]
    nodes = [scene.body.landmark("tip"), scene.body.landmark(second_landmark(scene))]
    coarse, fine = (
        landmark_path(
            at_times(GeneralisedAlpha(h, newton=TIGHT).solver(scene).march(end), times), nodes
        )
        for h in (2 * dt, dt)
    )
    return (4 * fine - coarse) / 3


# -- space -------------------------------------------------------------------------------------


def spatial_rows():
    """Solve static equilibria on several meshes and pairs; tip errors against the finest pair."""
    level = Constant(0.5)
    blocks = {f"{n}x{n // 2}x{n // 2}": block((n, n // 2, n // 2), level) for n in (2, 4, 8, 16)}
    yield from _space("block, one muscle", blocks, ("8x4x4", "Q2/P1"), 4)
    tongues = {}
    for refinement in (1, 2, 3):
        body = preliminary_tongue(refinement)
        active = dict.fromkeys(body.fibres.names, Constant(0.05))
        tongues[f"refinement {refinement}"] = report_tongue(active, body=body)
    yield from _space("report's tongue, muscles at 5 %", tongues, ("refinement 3", "Q2/P1"), 3)


def _space(name, scenes, finest, limit):
    solutions = {}
    for pair in ("Q1/P0", "Q2/P1", "P2/P1"):
        for mesh, scene in list(scenes.items())[
            : None if pair == "Q1/P0" else limit - 1 + (limit < 4)
        ]:
            row = {"scene": name, "pair": pair, "mesh": mesh}
            try:
                solver = Statics(scene, pair=pair)
                begin = clock.perf_counter()
                state = solver.solve()
            except TongueError as error:
                yield row | {"outcome": str(error)}
                continue
            body = scene.body
            ratios = solver.strain(state).volume_ratio
            solutions[mesh, pair] = row | {
                "outcome": "finished",
                "unknowns": solver.system.size,
                "wall_s": clock.perf_counter() - begin,
                "tip": state.displacement[body.landmark("tip")],
                "local_volume_error": float(np.abs(ratios - 1).max()),
            }
    exact = solutions[finest]["tip"]
    for row in solutions.values():
        error = float(np.linalg.norm(row["tip"] - exact) / np.linalg.norm(exact))
        yield {**row, "tip": row["tip"].tolist(), "tip_error": error}


# -- all of it ---------------------------------------------------------------------------------


def main(options: Options) -> dict[str, object]:
    """Run everything; returns a digest, writes CSV, JSON and plots as it goes."""
    rows: list[dict] = []
    names = [name for name in SCENES if options.data or name != "published tongue"]
    if not options.data:
        print("no published tongue (--data): its scene is left out")
    for name in names:
        path = options.folder / "references" / f"{name}.npy"
        with replacing(path) as temporary:
            np.save(temporary, reference_path(name, options.data))
        methods = [*METHODS, *(EXPLICIT if name in EXPLICIT_SCENES else ())]
        for method in methods:
            rows += _in_own_process(name, method, options.data, path)
            _write(options.folder / "accuracy_time", rows)
            _tell(rows[-1])
        picture = options.folder / f"accuracy_{names.index(name) + 1}.png"
        plot_time(picture, name, rows, [*METHODS, *EXPLICIT])
    space = []
    for row in spatial_rows():
        space.append(row)
        _write(options.folder / "accuracy_space", space)
        print({k: row[k] for k in row if k not in ("tip", "scene")}, flush=True)
    plot_space(options.folder / "accuracy_space.png", space)
    return digest(rows)


def digest(rows):
    """Fastest run of each method with a tip error of at most 1 %, per scene.

    Columns: step, tip error, simulated seconds per wall second, largest relative volume change of a
    cell, largest |det F - 1|, error of the energy balance over the energy exchanged, peak memory.
    """
    table = {}
    for name in dict.fromkeys(row["scene"] for row in rows):
        for method in dict.fromkeys(row["method"] for row in rows if row["scene"] == name):
            good = [
                row
                for row in rows
                if (row["scene"], row["method"]) == (name, method)
                and row["outcome"] == "finished"
                and row["tip_error"] <= 0.01
            ]
            best = max(good, key=lambda row: row["simulated_per_wall"], default=None)
            table[f"{name}: {method}"] = _digest_row(best)
    return table


def _digest_row(row):
    columns = ("dt ms", "tip %", "s/s", "volume", "det F", "energy", "MB")
    if row is None:
        return dict.fromkeys(columns, "") | {"tip %": "> 1"}
    explicit = row["method"] in EXPLICIT
    values = (
        f"{1e3 * EXPLICIT_END / row['steps']:.3f}" if explicit else f"{1e3 * row['dt_s']:g}",
        f"{100 * row['tip_error']:.2g}",
        f"{row['simulated_per_wall']:.3g}",
        f"{row['volume_error']:.0e}",
        f"{row['local_volume_error']:.2f}",
        f"{row['energy_error']:.0e}",
        f"{row['peak_memory_MB']:.0f}",
    )
    return dict(zip(columns, values, strict=True))


def _in_own_process(name, method, data, reference):
    paths = [path and str(path.resolve()) for path in (data, reference)]
    command = [sys.executable, "-m", "benchmarks.accuracy", json.dumps([name, method, *paths])]
    done = subprocess.run(command, capture_output=True, text=True, cwd=CHECKOUT)
    if done.returncode:
        return [{"scene": name, "method": method, "outcome": done.stderr.strip().splitlines()[-1]}]
    return json.loads(done.stdout.splitlines()[-1])


def _tell(row):
    keys = ("scene", "method", "dt_s", "tip_error", "simulated_per_wall", "outcome")
    print(*(f"{row[k]:.3g}" if isinstance(row[k], float) else row[k] for k in keys if k in row),
          sep="  ", flush=True)  # fmt: skip


def _write(path, rows):
    columns = list(dict.fromkeys(key for row in rows for key in row))
    lines = [",".join(columns)]
    for row in rows:
        lines.append(",".join(json.dumps(row[c]) if c in row else "" for c in columns))
    write_text(path.with_suffix(".csv"), "\n".join(lines) + "\n")
    write_json(path.with_suffix(".json"), rows)


if __name__ == "__main__":
    warnings.simplefilter("ignore")  # an explicit method says that it cuts its step; it is meant
    scene_name, method_name, data_folder, reference_file = json.loads(sys.argv[1])
    result = measure(scene_name, method_name, data_folder, np.load(reference_file))
    print(json.dumps(result))
