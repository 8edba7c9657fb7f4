"""Run a scene in time, observed and recorded."""

from __future__ import annotations

import json
import signal
import threading
import time as clock
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from dolfin_tongue.base.errors import BadScene, OutOfRange, is_number
from dolfin_tongue.body.shape import volume_ratios
from dolfin_tongue.direct.integrate import Direct, Method
from dolfin_tongue.fenicsx.generalised_alpha import Dynamics, TimeSteps
from dolfin_tongue.fenicsx.system import System
from dolfin_tongue.march.state import State
from dolfin_tongue.record.observe import EnergyAudit, volume_changes
from dolfin_tongue.record.recorder import Recorder
from dolfin_tongue.scene.scene import Scene

#: Wall time between checkpoints, s.
CHECKPOINT_INTERVAL = 2.0


@dataclass
class Run:
    """A finished (or stopped) run.

    Parameters
    ----------
    scene : what was simulated.
    folder : where its files are.
    frames : states at the frame times.
    last : last accepted state.
    summary : what ``summary.json`` holds.
    """

    scene: Scene
    folder: Path
    frames: list[State]
    last: State
    summary: dict[str, Any] = field(default_factory=dict)


def simulate(
    scene: Scene,
    end: float,
    folder: Path,
    steps: TimeSteps | Method | None = None,
    *,
    frame_interval: float = 0.02,
    resume: bool = False,
    progress: Callable[[float], None] | None = None,
) -> Run:
    """March a scene to an end time and leave its files in a folder.

    Parameters
    ----------
    scene : body, terms, supports.
    end : s.
    folder : for the files; see `output.Recorder`.
    steps : step size and method: `TimeSteps` of the FEniCSx solver (default), or `Implicit`,
        `Adaptive`, `RungeKutta4` of the direct one.
    frame_interval : time between frames, s.
    resume : continue the run that is in the folder, where there is one.
    progress : called with the time reached (s) after every step.

    Raises
    ------
    NotConverged : after everything up to the last accepted state was written.
    OutOfRange : `end` or `frame_interval` not finite and > 0, before anything is written.
    BadScene : the folder cannot be resumed: another scene, another method, damaged files.
    TongueError : another run writes to the folder.
    """
    if not (is_number(end) and end > 0):
        raise OutOfRange("end", end, "a finite number > 0", "s")
    folder = Path(folder)
    set_up = clock.perf_counter()
    solver = _solver(scene, steps)
    system = solver.system if isinstance(solver, Dynamics) else System(scene, dynamic=True)
    audit = EnergyAudit(system)
    recorder = Recorder(folder, scene, frame_interval)
    watch = _Watch(method=repr(solver.steps if isinstance(solver, Dynamics) else solver.method))
    try:
        start = _resumed(recorder, audit, watch, end) if resume else None
        watch.set_up = clock.perf_counter() - set_up
        if start is not None and start.time >= end:
            summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
            return Run(scene, folder, recorder.frames.read_all(), start, summary)
        last, summary = _march(solver, end, start, audit, recorder, watch, progress)
        return Run(scene, folder, recorder.frames.read_all(), last, summary)
    finally:
        recorder.close()


def _march(
    solver: Dynamics | Direct,
    end: float,
    start: State | None,
    audit: EnergyAudit,
    recorder: Recorder,
    watch: _Watch,
    progress: Callable[[float], None] | None,
) -> tuple[State, dict[str, Any]]:
    """March, observe and record; whatever stops it, files and summary say how far it came."""
    status, last = "stopped", start
    try:
        for state in solver.march(end, start):
            with uninterrupted():
                if start is None or state.time > start.time:
                    _observe(state, audit, recorder, watch)
                last = state
            if progress:
                progress(state.time)
        status = "finished"
    except BaseException as error:
        status = f"stopped: {str(error) or type(error).__name__}"
        raise
    finally:
        if last is not None:
            recorder.checkpoint(last, _memory(audit, watch))
            summary = _summary(solver, audit, watch, last, status) | _described(recorder.scene)
            recorder.summary(summary)
    assert last is not None
    return last, summary


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Hold back Ctrl-C until the block ends, so that a state is recorded whole or not at all."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    caught: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, _: caught.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if caught:
        raise KeyboardInterrupt


@dataclass
class _Watch:
    """Wall times, and the largest volume changes seen."""

    method: str
    set_up: float = 0.0
    start: float = 0.0
    begin: float = field(default_factory=clock.perf_counter)
    observing: float = 0.0
    last_checkpoint: float = -np.inf  # the first state is worth one
    volume: float = 0.0
    local_volume: float = 0.0
    smallest_ratio: float = 1.0
    balance: float = 0.0


def _memory(audit: EnergyAudit, watch: _Watch) -> dict[str, Any]:
    """Return what a resumed run must know besides the state."""
    extremes = [watch.volume, watch.local_volume, watch.smallest_ratio, watch.balance]
    return {"audit": audit.memory(), "extremes": extremes, "method": watch.method}


def _resumed(recorder: Recorder, audit: EnergyAudit, watch: _Watch, end: float) -> State | None:
    """Take up the run in the folder, if there is one and it is the same."""
    found = recorder.resume()
    if found is None:
        return None
    state, memory = found
    if memory["method"] != watch.method:
        raise BadScene(
            f"the run in {recorder.folder} was made by {memory['method']}; resume it with the same "
            "solver and steps, or start anew in another folder"
        )
    if state.time > end:
        raise OutOfRange("end", end, f"at least the {state.time:g} s that the run has reached")
    audit.restore(memory["audit"], state)
    watch.volume, watch.local_volume, watch.smallest_ratio, watch.balance = memory["extremes"]
    watch.start = state.time
    return state


def _observe(state: State, audit: EnergyAudit, recorder: Recorder, watch: _Watch) -> None:
    """Observe a new state, record it, and write a checkpoint where one is due."""
    begin = clock.perf_counter()
    body = recorder.scene.body
    volume = float(np.abs(volume_changes(body, state.displacement)).max())
    ratios = volume_ratios(body.points, state.displacement, body.cells)
    local, smallest = float(np.abs(ratios - 1).max()), float(ratios.min())
    energies = audit.update(state)
    volumes = {
        "max_volume_change": volume,
        "max_local_volume_change": local,
        "smallest_det_F": smallest,
    }
    recorder.record(state, volumes | energies)
    watch.volume = max(watch.volume, volume)
    watch.local_volume = max(watch.local_volume, local)
    watch.smallest_ratio = min(watch.smallest_ratio, smallest)
    watch.balance = max(watch.balance, abs(energies["balance_J"]))
    if clock.perf_counter() - watch.last_checkpoint > CHECKPOINT_INTERVAL:
        recorder.checkpoint(state, _memory(audit, watch))
        watch.last_checkpoint = clock.perf_counter()
    watch.observing += clock.perf_counter() - begin


def _solver(scene: Scene, steps: TimeSteps | Method | None) -> Dynamics | Direct:
    if steps is None or isinstance(steps, TimeSteps):
        return Dynamics(scene, steps)
    return Direct(scene, steps)


def _described(scene: Scene) -> dict[str, Any]:
    """Return what was simulated."""
    return {
        "cells": len(scene.body.cells),
        "muscles": list(scene.body.fibres.names),
        "terms": [type(term).__name__ for term in scene.terms],
    }


def _summary(
    solver: Dynamics | Direct, audit: EnergyAudit, watch: _Watch, last: State, status: str
) -> dict[str, Any]:
    """Return what came out, and what it cost."""
    wall = clock.perf_counter() - watch.begin
    solving = wall - watch.observing
    newton = solver.newton if isinstance(solver, Dynamics) else None
    simulated = last.time - watch.start
    return {
        "status": status,
        "time_reached_s": last.time,
        "solver": "FEniCSx" if newton else "direct",
        "method": watch.method,
        "set_up_wall_s": watch.set_up,
        "solving_wall_s": solving,
        "observing_wall_s": watch.observing,
        "simulated_seconds_per_wall_second": simulated / solving if solving > 0 else None,
        "newton_iterations": newton.iterations if newton else None,
        "residuals": newton.residuals if newton else None,
        "factorisations": newton.factorisations if newton else None,
        "max_volume_change": watch.volume,
        "max_local_volume_change": watch.local_volume,
        "smallest_det_F": watch.smallest_ratio,
        "max_balance_error_J": watch.balance,
        "exchanged_energy_J": audit.exchanged,
        "balance_error_per_exchanged": watch.balance / audit.exchanged if audit.exchanged else 0.0,
    }
