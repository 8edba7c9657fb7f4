"""What became of a run: finished, refused, stopped for a named cause; or a fault."""

from __future__ import annotations

import csv
import json
import re
import time as clock
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.base.errors import NotConverged, TongueError
from dolfin_tongue.body.shape import volume_changes
from dolfin_tongue.body.state import State
from dolfin_tongue.march.solver import Method
from dolfin_tongue.record.run import simulate
from dolfin_tongue.scene.scene import Scene

#: Largest relative volume change of a cell of which we say that the volumes are kept.
KEPT = 1e-8

#: Files that every recorded run must leave, however it ends.
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
    reason : the same in a few words, where the run itself says so.
    volume : largest relative volume change of a cell at any accepted state.
    wall : wall time, s.
    times, energies : of the accepted states, s and J.
    last : last accepted state.
    """

    kind: str
    time: float = 0.0
    steps: int = 0
    cause: str = ""
    reason: str = ""
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
        return f"{self.kind}{at}: {self.reason or short_cause(self.cause)}"


def short_cause(text: str) -> str:
    """Cut a refusal to what allows which step; other messages lose their advice."""
    found = re.search(r"stability limit, which (.*?)( \(fastest [^)]*\))? sets to (\S+)", text)
    if found:
        return f"{found.group(1)} allows {1e3 * float(found.group(3)):.3g} ms"
    return text.partition(": try ")[0].strip().rstrip(".;")


def in_short(error: NotConverged) -> str:
    """Reason of a run that stopped, and how distorted the cells were by then."""
    found = error.diagnosis
    if not found.cells:
        return error.reason
    worst = f"det F {found.smallest_ratio:.2g} in cell {found.cells[0]}"
    return f"{error.reason}; {worst}, largest stretch {found.largest_stretch:.2g}"


@dataclass
class Ending:
    """How a run ended: `Outcome.kind`, cause and reason."""

    kind: str
    cause: str = ""
    reason: str = ""


def ending_of(run: Callable[[], None], begun: Callable[[], bool]) -> Ending:
    """Run something to its end.

    Parameters
    ----------
    run : may raise anything.
    begun : whether it came further than its start, asked when it was refused.
    """
    try:
        run()
    except GivenUp as error:
        return Ending("throttled", str(error))
    except NotConverged as error:
        return Ending("stopped", str(error), in_short(error))
    except TongueError as error:
        return Ending("stopped" if begun() else "refused", str(error))
    except Exception as error:  # whatever else comes is what this benchmark looks for
        return Ending("fault", _crash(error))
    return Ending("finished")


def attempt(
    scene: Scene,
    end: float,
    folder: Path,
    method: Method,
    start: State | None = None,
    limit: float = 60.0,
) -> Outcome:
    """Run a scene with `run.simulate` and judge what it left on disk.

    Parameters
    ----------
    scene, end, folder, method, start : as for `run.simulate`.
    limit : wall time after which the run is given up, s.
    """
    begin, reached, last = clock.perf_counter(), [], []

    def watch(time: float) -> None:
        reached.append(time)
        _give_up(clock.perf_counter() - begin, limit)

    def run() -> None:
        named = {"frame_interval": end / 4, "progress": watch}
        last.append(simulate(scene, end, folder, method, start=start, **named).last)

    ending = ending_of(run, lambda: bool(reached))
    if ending.kind == "refused":
        outcome = Outcome("refused", cause=ending.cause)
    else:
        outcome = _judged(_from_files(folder, ending), end)
    outcome.wall, outcome.last = clock.perf_counter() - begin, last[0] if last else None
    return outcome


def _give_up(wall: float, limit: float, steps: int = 0, most: int | None = None) -> None:
    """Raise GivenUp for a run that takes too long or too many steps."""
    if wall > limit:
        raise GivenUp(f"given up after {limit:g} s of wall time")
    if most and steps > most:
        raise GivenUp(f"given up after {most} steps")


def _crash(error: Exception) -> str:
    """Error with the place where it was raised."""
    place = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__}: {error} ({Path(place.filename).name}:{place.lineno})"


def _from_files(folder: Path, ending: Ending) -> Outcome:
    """Outcome as the files tell it; a fault where they do not."""
    missing = [name for name in FILES if not (folder / name).is_file()]
    if missing:
        return Outcome("fault", cause=f"no {', '.join(missing)} on disk; {ending.cause}")
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    rows = read_table(folder / "steps.csv")
    energy = sum(rows[name] for name in rows if name.endswith("_J") and _is_energy(name))
    outcome = Outcome(
        ending.kind, summary["time_reached_s"], len(rows["time_s"]) - 1, ending.cause,
        ending.reason, summary["max_volume_change"], times=rows["time_s"], energies=energy,
    )  # fmt: skip
    if (ending.kind == "finished") != (summary["status"] == "finished"):
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
    outcome.reason = ""
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
    method: Method,
    start: State | None = None,
    limit: float = 60.0,
    most: int | None = None,
) -> tuple[Outcome, list[State]]:
    """Run a scene by stepping through it here, without files.

    Parameters
    ----------
    scene : body, terms, supports.
    end : s.
    method : of either solver.
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

    def run() -> None:
        solver = method.solver(scene)
        for state in solver.march(end, start):
            states.append(state)
            energies.append(sum(solver.energies(state).values()))
            if state.time < end:
                _give_up(clock.perf_counter() - begin, limit, len(states), most)

    ending = ending_of(run, lambda: bool(states))
    if ending.kind == "throttled":
        ending.cause += f", at a step of {states[-1].step:.1e} s"
    outcome = _from_states(scene, states, ending)
    outcome.energies, outcome.wall = np.array(energies), clock.perf_counter() - begin
    return _judged(outcome, end), states


def _from_states(scene: Scene, states: list[State], ending: Ending) -> Outcome:
    if not states:
        return Outcome(ending.kind, cause=ending.cause, reason=ending.reason)
    changes = [np.abs(volume_changes(scene.body, s.displacement)).max() for s in states]
    outcome = Outcome(
        ending.kind, states[-1].time, len(states) - 1, ending.cause, ending.reason,
        float(max(changes)), times=np.array([s.time for s in states]), last=states[-1],
    )  # fmt: skip
    fields = [x for s in states for x in (s.displacement, s.velocity, s.pressure)]
    if not all(np.isfinite(x).all() for x in fields):
        return _fault(outcome, "numbers that are not finite in accepted states")
    if not all(b.time > a.time for a, b in pairwise(states)):
        return _fault(outcome, "times that do not increase")
    return outcome
