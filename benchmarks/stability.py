"""What ends badly, and how: a map of dt against stiffness, and a table of extreme scenes.

Every run must finish with volumes kept (largest relative volume change of a cell 1e-8), or end at a
named time for a named cause with everything before it on disk. Anything else is a fault, counted at
the end. What needs other programs' files or a published tongue is skipped without them (variable
DOLFIN_TONGUE_PEERS, option --data). Cheap scenes come first; the files grow while it runs.
"""

from pathlib import Path

import numpy as np

from benchmarks.extremes import charts, contacts, peers, scenes, stiffness
from benchmarks.extremes.outcome import attempt_march, read_table
from benchmarks.extremes.report import DIRECT, FENICSX, Report, both, markdown, solver_of
from dolfin_tongue.anatomy.scenes import published_scene
from dolfin_tongue.app.demo import Options
from dolfin_tongue.base.files import write_text
from dolfin_tongue.body.state import State
from dolfin_tongue.control import Ramp, Step
from dolfin_tongue.direct import Adaptive, RungeKutta4, TrBdf2
from dolfin_tongue.fenicsx import GeneralisedAlpha, Statics, Tolerances
from dolfin_tongue.geometry.preliminary import preliminary_tongue
from dolfin_tongue.geometry.published import published_tongue
from dolfin_tongue.scene.scene import Scene

# -- extreme scenes --------------------------------------------------------------------------------


def blocks(report: Report) -> None:
    """Small blocks: bad cells, overflow, inversion, constraint time constant."""
    block = scenes.muscle_block(viscosity=1.0)
    for tau, dt in ((1e-3, 1e-4), (1e-4, 1e-4), (1e-5, 1e-4), (1e-5, 2e-5)):
        name = f"time constant {tau:g} s, Runge-Kutta 4 at {1e3 * dt:g} ms"
        report.runs(name, block, 0.06, [RungeKutta4(dt, tau)])
    report.runs("time constant 1e-05 s, adaptive pair", block, 0.06, [Adaptive(tau=1e-5)])
    bad = scenes.muscle_block(body=scenes.bad_block())
    report.runs("cells of 5 % scaled Jacobian", bad, 0.3)
    report.runs("pulled to 12 times its length: (67) overflows", scenes.driven_block(0.33, 3), 3)
    report.runs("the same in one step", scenes.driven_block(0.33, 1e-4), 0.1)
    report.runs("hung in 10 000 g", scenes.flung_block(1e5), 0.1)
    report.runs("hung in 1 000 000 g", scenes.flung_block(1e7), 0.1)
    report.runs("cells driven to inversion", scenes.driven_block(-0.035), 0.1)


def tongues(report: Report) -> None:
    """Run the report's tongue under extreme loads, laws and steps."""
    body = preliminary_tongue()
    sudden = scenes.tongue(body, Step(1.0, 0.1))
    report.runs("all muscles 0 to 100 % in one step", sudden, 0.4)
    report.runs("the same, steps adapted to 0.01 mm", sudden, 0.4, both(tolerance=1e-5))
    report.runs("no activity, gravity", scenes.tongue(body), 0.5)
    half = scenes.half_active()
    for name, change in (
        ("passive modulus x 1000", {"factor": 1e3}),
        ("passive modulus / 1000", {"factor": 1e-3}),
        ("viscosity x 1000", {"viscosity": 6e4}),
        ("gravity x 50", {"gravity": 490.5}),
    ):
        report.runs(name, scenes.tongue(body, half, **change), 0.4)
    for dt in (20e-3, 50e-3):
        report.runs(f"dt {1e3 * dt:g} ms", scenes.tongue(body, half), 0.5, both(dt))


def boundaries(report: Report) -> None:
    """Impact, squeezing, light and heavy bones, films on bad cells, sliding."""
    for speed, tilt, name in ((0.1, 0, "face"), (1.0, 0, "face"), (1.0, 30, "corner")):
        scene, start = contacts.dropped_block(speed, tilt)
        label = f"block dropped on a {name} at {speed:g} m/s"
        report.runs(label, scene, 0.1, both(2.5e-3), start)
    for distance, duration, note in (
        (0.006, 0.1, ""), (0.006, 0.02, ""), (0.01, 0.1, ", on a node that is held")
    ):  # fmt: skip
        name = f"palate comes down by {1e3 * distance:g} mm in {1e3 * duration:g} ms{note}"
        report.runs(name, contacts.closing_palate(distance, duration), 0.2)
    for share, duration in ((0.3, 0.1), (0.5, 0.05), (1.0, 0.05)):
        name = f"squeezed: mandible closes by {10 * share:g} degrees in {1e3 * duration:g} ms"
        report.runs(name, contacts.squeezed_tongue(share, duration), 0.25)
    for mass in (1e-3, 10.0):
        report.runs(f"free mandible of {mass:g} kg", contacts.weighed_mandible(mass), 0.3)
    for sigma in (0.073, 10.0):
        name = f"film of {sigma:g} N/m on a corner of 5 % scaled Jacobian"
        report.runs(name, scenes.film_on_a_corner(sigma), 0.1)
    for radius, gravity in ((0.1, 500.0), (0.03, 50.0)):
        name = f"sliding in a bowl of {100 * radius:g} cm under {gravity:g} m/s2"
        report.runs(name, contacts.sliding_block(radius, gravity), 0.2)


def rests(report: Report) -> None:
    """10 s of rest: without load, from the equilibrium under gravity, and sagging into it."""
    body = preliminary_tongue()
    hanging = scenes.tongue(body)
    rest = Statics(hanging, Tolerances(1e-12, 1e-12, renew_above=0.0)).solve()
    start = State(0.0, rest.displacement, rest.velocity, rest.pressure)
    for name, scene, begin in (
        ("10 s of rest without load", scenes.tongue(body, gravity=0.0), None),
        ("10 s of rest under gravity", hanging, start),
        ("10 s of sagging to rest", hanging, None),
    ):
        tip = body.points[body.landmark("tip")]
        if scene is hanging:
            tip = tip + rest.displacement[body.landmark("tip")]
        for method in both():
            outcome = report.attempt(name, scene, 10.0, method, begin)
            path = read_table(report.run_folder(name, method) / "trajectories.csv")
            late = path["time_s"] >= (0.0 if begin or scene is not hanging else 5.0)
            places = np.column_stack([path[f"tip_{axis}_m"] for axis in "xyz"])[late]
            drift = np.linalg.norm(places - tip, axis=1)
            note = f"{solver_of(method)}: tip within {drift.max(initial=0.0):.0e} m of equilibrium"
            report.add(name, method, outcome, note + (" after 5 s" if not late.all() else ""))


# -- against FEBio ---------------------------------------------------------------------------------


def swings(report: Report) -> None:
    """Swing FEBio's undamped block for 10 s at 5 ms, and see whether its energy grows."""
    scene = scenes.febio_dynamic((8, 4, 4), active=False)
    scale = 0.0
    radii = (1.0, 0.9, 0.8)
    methods = {f"radius {r}": GeneralisedAlpha(5e-3, spectral_radius=r) for r in radii}
    for kind, method in (methods | {"TR-BDF2": TrBdf2(5e-3)}).items():
        name = f"undamped block for 10 s, {kind}"
        outcome = report.attempt(name, scene, 10.0, method)
        if not scale:
            steps = read_table(report.run_folder(name, method) / "steps.csv")
            scale = steps["kinetic_J"].max()
        growth, last = (100 * x / scale for x in (outcome.energies.max(), outcome.energies[-1]))
        note = f"energy grows by {growth:.2g} % at most, is {last:+.3g} % at the end"
        report.add(name, method, outcome, note)


def contractions(report: Report) -> None:
    """Contract FEBio's block by 20 kPa along z over 50 ms, at steps of which FEBio dies."""
    for (cells, ms), died in peers.DEATHS.items():
        name = f"20 kPa across, {'x'.join(map(str, cells))}, dt {ms} ms"
        scene = scenes.febio_dynamic(cells, active=True)
        for method in both(1e-3 * ms):
            outcome = report.attempt(name, scene, 0.5, method)
            report.add(name, method, outcome, f"FEBio dies at {died:g} s")


def febio_statics(report: Report) -> None:
    """Compare static answers with FEBio's."""
    folder = peers.febio_folder()
    for (material, angle), expected in peers.STATIC.items():
        scene = scenes.febio_static(material, angle)
        state = Statics(scene).solve()
        end = 1e3 * state.displacement[scene.body.nodes("x1")].mean(axis=0)[:2]
        off = np.linalg.norm(end - expected) / np.linalg.norm(expected)
        note = f"end moves {end[0]:.4f} {end[1]:.4f} mm, FEBio's {expected[0]:.4f} "
        note += f"{expected[1]:.4f}: {100 * off:.2f} %"
        if folder:
            note += f"; any node {_node_distance(folder, scene, state, material, angle)}"
        report.row(f"static {material}, fibres at {angle:.0f} deg", FENICSX, "solved", note)
    for cells, sag in peers.SAG.items():
        scene = scenes.febio_dynamic(cells, active=False)
        ours = Statics(scene).solve().displacement[scene.body.nodes("x1"), 0].mean()
        note = f"end sags {1e3 * ours:.5f} mm, FEBio's {1e3 * sag:.5f}: "
        note += f"{100 * abs(ours / sag - 1):.2f} %"
        report.row(f"static sag, {'x'.join(map(str, cells))}", FENICSX, "solved", note)


def _node_distance(folder: Path, scene: Scene, state: State, material: str, angle: float) -> str:
    """Largest distance of any node from FEBio's, over the largest displacement."""
    before, after = peers.end_positions(folder, material, angle)
    order, theirs = (np.lexsort(np.round(1e9 * x).T) for x in (scene.body.points, before))
    gap = (scene.body.points + state.displacement)[order] - after[theirs]
    largest = np.linalg.norm(state.displacement, axis=1).max()
    return f"{100 * np.linalg.norm(gap, axis=1).max() / largest:.2f} %"


def febio_curves(report: Report) -> None:
    """Compare paths of the end face over 0.1 s at dt 0.25 ms with FEBio's at the same dt."""
    folder = peers.febio_folder()
    if folder is None:
        print(f"FEBio's curves: skipped, {peers.VARIABLE} names no folder with febio/", flush=True)
        return
    for cells, load in (((4, 2, 2), "grav"), ((8, 4, 4), "grav"), ((4, 2, 2), "act20k")):
        scene = scenes.febio_dynamic(cells, active=load == "act20k")
        times, expected = peers.end_face(folder, cells, load)
        face = scene.body.nodes("x1")
        for method in (GeneralisedAlpha(2.5e-4, spectral_radius=1.0), TrBdf2(2.5e-4)):
            outcome, states = attempt_march(scene, 0.1, method)
            ours = np.array([s.displacement[face, 0].mean() for s in states])
            gap = np.abs(ours - np.interp(outcome.times, times, expected))
            reach = np.abs(expected[times <= 0.1]).max()
            parts = [gap[outcome.times <= t].max() / reach for t in (0.02, 0.05, 0.1)]
            off = " ".join(f"{100 * part:.2g} %" for part in parts)
            note = f"{solver_of(method)}: off by {off} of the reach until 20, 50, 100 ms"
            name = f"FEBio's {load}, {'x'.join(map(str, cells))}, dt 0.25 ms"
            report.add(name, method, outcome, note)


# -- published tongue ------------------------------------------------------------------------------


def published(report: Report, data: Path | None) -> None:
    """Every muscle of the published tongue at 100 %, ramped over 50 ms, under gravity."""
    if data is None:
        print("published tongue: skipped, no --data", flush=True)
        return
    body = published_tongue(data)
    for muscle in body.fibres.names:
        died = peers.ARTISYNTH_DEATHS.get(muscle)
        note = f"ArtiSynth dies at dt {died}" if died else ""
        scene = published_scene(data, {muscle: Ramp(1.0, 0.0, 0.05)}, body)
        name = f"published tongue, {muscle} 100 %"
        for method in both():
            report.add(name, method, report.attempt(name, scene, 0.2, method), note)


def verdict(rows: list[dict], points: list[charts.Point]) -> str:
    """Count what must not be."""
    kinds = [row["kind"] for row in rows], [point.kind for point in points]
    parts = (
        f"{len(part)} {what}: {part.count('fault')} faults, {part.count('drifted')} with volumes "
        "kept worse than to 1e-8"
        for part, what in zip(kinds, ("runs", "runs of the map"), strict=True)
    )
    return "; ".join(parts)


def main(options: Options) -> dict[str, object]:
    """Run the benchmark; returns the table."""
    options.folder.mkdir(parents=True, exist_ok=True)
    report = Report(options.folder)
    for part in (
        blocks,
        tongues,
        boundaries,
        febio_statics,
        contractions,
        rests,
        febio_curves,
        swings,
    ):
        part(report)
    published(report, options.data)
    points = stiffness.stiffness_map(options.folder)
    table = report.table() | dict(stiffness.map_rows(points))
    table["faults"] = {FENICSX: "", DIRECT: "", "note": verdict(report.rows, points)}
    write_text(options.folder / "table.md", markdown(table))
    return dict(table)
