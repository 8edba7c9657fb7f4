"""Sliding, contact and bones in both solvers: exact motions, balances, and what each costs a step.

A block in a bowl against the pendulum's exact period; a bone on a hinge with a soft block against a
small step of the other solver; drops on a plane; the mouth in both solvers; and the wall time of a
step of the mouth with and without each of its parts.
"""

from itertools import product

import numpy as np

from benchmarks.extremes import contacts, proofs
from dolfin_tongue.anatomy.bones import opening
from dolfin_tongue.anatomy.scenes import SURROUNDINGS, report_mouth
from dolfin_tongue.app.demo import Options
from dolfin_tongue.base.files import write_json
from dolfin_tongue.boundary.sliding import off_surface
from dolfin_tongue.control import SmoothRamp
from dolfin_tongue.direct import TrBdf2
from dolfin_tongue.fenicsx import GeneralisedAlpha, Tolerances
from dolfin_tongue.march.compare import orders, timed

SOLVERS = ("FEniCSx", "direct")
REPEATS = 5


def solver_of(name, scene, dt, tight=False):
    """One of the two solvers at a fixed step; tight where differences are measured."""
    if name == "FEniCSx":
        newton = Tolerances(1e-12, 1e-12) if tight else Tolerances()
        return GeneralisedAlpha(dt, newton=newton).solver(scene)
    return TrBdf2(dt, newton=1e-11 if tight else 1e-7).solver(scene)


def bowl():
    """Relative error of the period, and the largest distance of a node from the bowl."""
    scene = proofs.block_in_bowl()
    period, nodes = proofs.exact_period(scene), scene.body.nodes("z0")
    for dt in (8e-3, 4e-3, 2e-3):
        row = {}
        for name in SOLVERS:
            states = list(solver_of(name, scene, dt).march(1.02 * period))
            error = proofs.period_of(proofs.swing_angles(scene, states)) / period - 1
            places = [(scene.body.points + state.displacement)[nodes] for state in states]
            off = max(float(np.abs(off_surface(proofs.BOWL, place)).max()) for place in places)
            row[name] = f"{100 * error:+.3f} %, off by {off:.0e} m"
        yield f"bowl, dt {1e3 * dt:g} ms: period, distance from the surface", row


def hinge():
    """Error of the hinged bone's angle against a fine run of the other solver, with orders."""
    scene, steps = proofs.hinged_bone(), (4e-3, 2e-3, 1e-3)

    def angle(name, dt):
        *_, last = solver_of(name, scene, dt, tight=True).march(0.08)
        return float(last.rigid[0, 2])

    row = {}
    for name, other in zip(SOLVERS, reversed(SOLVERS), strict=True):
        fine = (4 * angle(other, 1.25e-4) - angle(other, 2.5e-4)) / 3
        errors = [abs(angle(name, dt) / fine - 1) for dt in steps]
        observed = orders(steps, errors)
        row[name] = f"{errors[0]:.1e} to {errors[-1]:.1e}, order {observed[0]:.2f}, "
        row[name] += f"{observed[-1]:.2f}"
    yield "hinged bone, dt 4 to 1 ms: angle against the other solver, extrapolated", row


def drops():
    """Smallest gap and largest rise of the mechanical energy in a step, over the first energy."""
    blocks = ((0.1, 0.0, "face"), (1.0, 0.0, "face"), (1.0, 30.0, "corner"))
    for (speed, tilt, where), dt in product(blocks, (5e-3, 2.5e-3, 1e-3)):
        row = {}
        for name in SOLVERS:
            scene, start = contacts.dropped_block(speed, tilt)
            solver = solver_of(name, scene, dt)
            energies, gaps = [], []
            for state in solver.march(0.1, start):
                energies.append(sum(solver.energies(state).values()))
                gaps.append(solver.contacts(state)["contact"].gap)
            rise = max(0.0, float(np.diff(energies).max())) / abs(energies[0])
            row[name] = f"{1e3 * min(gaps):.3f} mm, {rise:.0e}, {len(gaps) - 1} steps"
        label = f"drop on a {where} at {speed:g} m/s, dt {1e3 * dt:g} ms"
        yield f"{label}: smallest gap, rise of energy", row


def mouth(parts=SURROUNDINGS):
    """Return the report's tongue in the mouth, pressed to the palate while the mandible opens."""
    levels = {"genioglossus_posterior": 1.0, "styloglossus": 0.6}
    activation = {name: SmoothRamp(level, 0.0, 0.1) for name, level in levels.items()}
    motion = opening(0.2, 0.2) if "mandible" in parts else None
    return report_mouth(activation, parts, motion=motion)


def agreement():
    """Largest distance of nodes between both solvers in the mouth, over the largest way."""
    scene, row = mouth(), {}
    for dt in (4e-3, 2e-3, 1e-3):
        ways = []
        for name in SOLVERS:
            *_, last = solver_of(name, scene, dt).march(0.3)
            ways.append(last.displacement)
        row[dt] = float(np.abs(ways[0] - ways[1]).max() / np.abs(ways[1]).max())
    text = ", ".join(f"{100 * value:.2g} %" for value in row.values())
    both = dict.fromkeys(SOLVERS, "") | {"FEniCSx": text}
    yield "mouth at 0.3 s, dt 4, 2, 1 ms: largest difference of the solvers", both


def costs():
    """Wall time of a step of 5 ms in the mouth with all parts, without each, and without any."""
    cases = {"all": SURROUNDINGS}
    cases |= {f"all but {x}": tuple(y for y in SURROUNDINGS if y != x) for x in SURROUNDINGS}
    cases["none of them"] = ()
    first: dict[str, float] = {}
    for label, parts in cases.items():
        row = {}
        for name in SOLVERS:

            def make(parts=parts, name=name):
                return solver_of(name, mouth(parts), 5e-3)

            timed(make, 0.02, 1)  # compiles on first use
            timing, states = timed(make, 0.4, REPEATS)
            wall = timing.median / (len(states) - 1)
            first.setdefault(name, wall)
            row[name] = f"{1e3 * wall:.2f} ms, {wall / first[name]:.2f} of all, "
            row[name] += f"{len(states) - 1} steps"
        yield f"a step of the mouth, {label}", row


def main(options: Options) -> dict[str, object]:
    """Run the benchmark; returns the table."""
    table: dict[str, object] = {}
    for part in (bowl, hinge, drops, agreement, costs):
        for name, row in part():
            table[name] = row
            print(name, row, flush=True)
            write_json(options.folder / "boundaries.json", table)
    return table
