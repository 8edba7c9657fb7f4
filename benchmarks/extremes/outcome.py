"""What became of a run: finished, refused, stopped for a named cause; or a fault."""

from __future__ import annotations

import csv
import json
import re
import time as clock
import traceback
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.base.errors import NotConverged, TongueError
from dolfin_tongue.direct.integrate import Direct, Method
from dolfin_tongue.fenicsx.generalised_alpha import Dynamics, TimeSteps
from dolfin_tongue.march.state import State
from dolfin_tongue.record.observe import volume_changes
from dolfin_tongue.record.recorder import Recorder
from dolfin_tongue.record.run import simulate
from dolfin_tongue.scene.scene import Scene

#: Largest relative volume change of a cell of which we say that the volumes are kept.
KEPT = 1e-8

#: Files that every FEniCSx run must leave, however it ends.
FILES = ("summary.json", "steps.csv", "trajectories.csv", "checkpoint.npz", "fields.xdmf")


class GivenUp(KeyboardInterrupt):
    """The benchmark stops a run that takes too long; `run.simulate` still writes its summary."""


@dataclass
class Outcome:
    """What became of a run.

    Parameters
    ----------
    kind : ``finished`` (end reached, volumes kept), ``drifted`` (end reached, volumes not kept),
        ``refused`` (before the first step), ``stopped`` (a named cause at a named time),
        ``throttled`` (alive, but given up by the benchmark), or ``fault`` (anything else).
    time : last accepted time, s.
    steps : accepted steps.
    cause : why it ended, in full; empty if it finished.
    volume : largest relative volume change of a cell at any accepted state.
    wall : wall time, s.
    times, energies : of the accepted states, s and J; energies where they were recorded.
    last : last accepted state.
    """

    kind: str
    time: float = 0.0
    steps: int = 0
    cause: str = ""
    volume: float = 0.0
    wall: float = 0.0
    times: FloatArray = field(default_factory=lambda: np.zeros(0), repr=False)
    energies: FloatArray = field(default_factory=lambda: np.zeros(0), repr=False)
    last: State | None = field(default=None, repr=False)

    @property
    def short(self) -> str:
        """Outcome in a few words, with the cause where there is one."""
        if self.kind in ("finished", "drifted"):
            kept = "" if self.kind == "finished" else " (not kept)"
            return f"finished, dV {self.volume:.0e}{kept}"
        at = "" if self.kind == "refused" else f" at {self.time:.4g} s"
        return f"{self.kind}{at}: {short_cause(self.cause)}"


def short_cause(text: str) -> str:
    """Cut the list of cells and the advice out of a message."""
    found = re.search(r"stability limit, which (.*?)( \(fastest [^)]*\))? sets to (\S+)", text)
    if found:
        return f"{found.group(1)} allows {1e3 * float(found.group(3)):.3g} ms"
    text = text.partition(" Most distorted cells")[0].rstrip(".") + _advice(text)
    found = re.search(r"Cause: (.*)$", text)
    text = found.group(1) if found else re.sub(r"^no convergence beyond t = \S+ ", "", text)
    return re.sub(r": (lower|try) .*$", "", text).strip().rstrip(".;")


def _advice(text: str) -> str:
    """Cause that a FEniCSx run names after its list of cells, up to the colon."""
    found = re.search(r"det F [^;]*; ([^:]*)(: |$)", text)
    return f"; {found.group(1)}" if found else ""


def attempt_alpha2(
    scene: Scene, end: float, folder: Path, steps: TimeSteps, limit: float = 60.0
) -> Outcome:
    """Run a scene with `run.simulate` and judge what it left on disk.

    Parameters
    ----------
    scene, end, folder, steps : as for `run.simulate`.
    limit : wall time after which the run is given up, s.
    """
    begin = clock.perf_counter()

    def watch(time: float) -> None:
        if clock.perf_counter() - begin > limit:
            raise GivenUp(f"given up after {limit:g} s of wall time")

    kind, cause, last = "finished", "", None
    try:
        last = simulate(scene, end, folder, steps, frame_interval=end / 4, progress=watch).last
    except GivenUp as error:
        kind, cause = "throttled", str(error)
    except NotConverged as error:
        kind, cause = "stopped", str(error)
    except TongueError as error:
        return Outcome("refused", cause=str(error), wall=clock.perf_counter() - begin)
    except Exception as error:  # whatever else comes is what this benchmark looks for
        kind, cause = "fault", _crash(error)
    outcome = _from_files(folder, kind, cause)
    outcome.wall, outcome.last = clock.perf_counter() - begin, last
    return _judged(outcome, end)


def _crash(error: Exception) -> str:
    """Error with the place where it was raised."""
    place = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__}: {error} ({Path(place.filename).name}:{place.lineno})"


def _from_files(folder: Path, kind: str, cause: str) -> Outcome:
    """Outcome as the files tell it; a fault where they do not."""
    missing = [name for name in FILES if not (folder / name).is_file()]
    if missing:
        return Outcome("fault", cause=f"no {', '.join(missing)} on disk; {cause}")
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    rows = read_table(folder / "steps.csv")
    energy = sum(rows[name] for name in rows if name.endswith("_J") and _is_energy(name))
    outcome = Outcome(
        kind, summary["time_reached_s"], len(rows["time_s"]) - 1, cause,
        summary["max_volume_change"], times=rows["time_s"], energies=energy,
    )  # fmt: skip
    if (kind == "finished") != (summary["status"] == "finished"):
        return _fault(outcome, f"summary.json says {summary['status']!r}")
    if abs(rows["time_s"][-1] - outcome.time) > 1e-12:
        return _fault(outcome, "the last accepted state is not in steps.csv")
    if not all(np.isfinite(values).all() for values in rows.values()):
        return _fault(outcome, "numbers that are not finite in steps.csv")
    return outcome


def _is_energy(name: str) -> bool:
    return not name.startswith(("work_", "balance", "exchanged"))


def _fault(outcome: Outcome, what: str) -> Outcome:
    outcome.kind, outcome.cause = "fault", f"{what}; {outcome.cause}".rstrip("; ")
    return outcome


def read_table(path: Path) -> dict[str, FloatArray]:
    """Columns of a CSV file of numbers."""
    with path.open(newline="", encoding="utf-8") as file:
        header, *rows = list(csv.reader(file))
    return dict(zip(header, np.array(rows, dtype=float).T, strict=True))


def _judged(outcome: Outcome, end: float) -> Outcome:
    """Check that an outcome is one of those that are allowed."""
    cause = outcome.cause
    if outcome.kind == "finished" and abs(outcome.time - end) > 1e-12:
        return _fault(outcome, f"finished at {outcome.time:g} s instead of {end:g} s")
    if outcome.kind == "finished" and not outcome.volume <= KEPT:
        outcome.kind, outcome.cause = "drifted", f"volumes to {outcome.volume:.1e} only"
    if outcome.kind == "stopped" and ("CONVERGED_" in cause.replace("DIVERGED_", "") or not cause):
        return _fault(outcome, "a cause that is none")
    return outcome


def attempt_march(
    scene: Scene,
    end: float,
    method: Method | TimeSteps,
    folder: Path | None = None,
    start: State | None = None,
    limit: float = 60.0,
    most: int | None = None,
) -> tuple[Outcome, list[State]]:
    """Run a scene by stepping through it here, with either solver.

    Parameters
    ----------
    scene : body, terms, supports.
    end : s.
    method : a method of the direct solver, or `TimeSteps` for FEniCSx.
    folder : for the tables of the run; None for no files.
    start : state to start from; default: at rest in the reference configuration.
    limit : wall time after which the run is given up, s.
    most : accepted steps after which it is given up.

    Returns
    -------
    (outcome, accepted states)
    """
    begin = clock.perf_counter()
    states: list[State] = []
    energies: list[float] = []
    kind, cause = "finished", ""
    recorder = None if folder is None else Recorder(folder, scene, end / 4)
    try:
        solver = Dynamics(scene, method) if isinstance(method, TimeSteps) else Direct(scene, method)
        for state, volume, energy in _observed(solver, scene, end, start):
            states.append(state)
            energies.append(energy)
            if recorder:
                recorder.record(state, {"max_volume_change": volume, "energy_J": energy})
            if state.time < end:
                _give_up(clock.perf_counter() - begin, limit, len(states), most)
    except GivenUp as error:
        kind, cause = "throttled", f"{error}, at a step of {states[-1].step:.1e} s"
    except NotConverged as error:
        kind, cause = "stopped", str(error)
    except TongueError as error:
        kind, cause = ("stopped" if states else "refused"), str(error)
    except Exception as error:  # whatever else comes is what this benchmark looks for
        kind, cause = "fault", _crash(error)
    finally:
        if recorder:
            recorder.close()
    outcome = _from_states(scene, states, kind, cause)
    outcome.energies, outcome.wall = np.array(energies), clock.perf_counter() - begin
    return _judged(outcome, end), states


def _give_up(wall: float, limit: float, steps: int, most: int | None) -> None:
    """Raise GivenUp for a run that takes too long or too many steps."""
    if wall > limit:
        raise GivenUp(f"given up after {limit:g} s of wall time")
    if most and steps > most:
        raise GivenUp(f"given up after {most} steps")


def _observed(
    solver: Any, scene: Scene, end: float, start: State | None
) -> Iterator[tuple[State, float, float]]:
    """March; yields accepted states with volume change and energy (0 from FEniCSx)."""
    model = getattr(solver, "model", None)
    for state in solver.march(end, start):
        volume = float(np.abs(volume_changes(scene.body, state.displacement)).max())
        energy = model.energy(state.displacement, state.velocity) if model else 0.0
        yield state, volume, energy


def _from_states(scene: Scene, states: list[State], kind: str, cause: str) -> Outcome:
    if not states:
        return Outcome(kind, cause=cause)
    changes = [np.abs(volume_changes(scene.body, s.displacement)).max() for s in states]
    outcome = Outcome(
        kind, states[-1].time, len(states) - 1, cause, float(max(changes)),
        times=np.array([s.time for s in states]), last=states[-1],
    )  # fmt: skip
    fields = [x for s in states for x in (s.displacement, s.velocity, s.pressure)]
    if not all(np.isfinite(x).all() for x in fields):
        return _fault(outcome, "numbers that are not finite in accepted states")
    if not all(b.time > a.time for a, b in pairwise(states)):
        return _fault(outcome, "times that do not increase")
    return outcome
