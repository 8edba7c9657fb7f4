"""Run a scene in time, observed and recorded; read a run back."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.base.errors import BadScene, OutOfRange, is_number
from dolfin_tongue.body.state import State
from dolfin_tongue.march.solver import Method, Solver
from dolfin_tongue.record.description import (
    add_session,
    read_description,
    write_description,
)
from dolfin_tongue.record.frames import Frames
from dolfin_tongue.record.interrupt import uninterrupted
from dolfin_tongue.record.observe import EnergyAudit
from dolfin_tongue.record.recorder import DAMAGED, Recorder
from dolfin_tongue.record.state_file import state_from
from dolfin_tongue.record.watch import Watch
from dolfin_tongue.scene.scene import Scene


@dataclass
class Run:
    """A finished (or stopped) run.

    Parameters
    ----------
    scene : what was simulated.
    method : how.
    folder : where its files are.
    frames : states at the frame times, read from disk as they are asked for.
    last : last accepted state.
    summary : what ``summary.json`` holds.
    """

    scene: Scene
    method: Method
    folder: Path
    frames: Frames
    last: State
    summary: dict[str, Any] = field(default_factory=dict)

    @cached_property
    def solver(self) -> Solver:
        """Solver of the run, for all that is asked about its states: `Solver.fields`, ..."""
        return self.method.solver(self.scene)


def simulate(
    scene: Scene,
    end: float,
    folder: Path | str,
    method: Method | None = None,
    *,
    start: State | FloatArray | None = None,
    pair: str | None = None,
    frame_interval: float = 0.02,
    resume: bool = False,
    progress: Callable[[float], None] | None = None,
) -> Run:
    """March a scene to an end time and leave its files in a folder.

    Parameters
    ----------
    scene : body, terms, supports.
    end : s.
    folder : for the files; see `recorder.Recorder`.
    method : step size and method: `GeneralisedAlpha` of the FEniCSx solver (default), or `TrBdf2`,
        `Adaptive`, `RungeKutta4` of the direct one.
    start : state to start from, of any solver, or an initial velocity of the undeformed body, m/s,
        shape (3,) or (n, 3); default: at rest.
    pair : displacement and pressure spaces of the FEniCSx solver, e.g. ``"Q2/P1"``; see
        `fenicsx.pairs.PAIRS`. Default: the method's own.
    frame_interval : time between frames, s.
    resume : continue the run that is in the folder, where there is one.
    progress : called with the time reached (s) after every step.

    Raises
    ------
    NotConverged : after everything up to the last accepted state was written.
    OutOfRange : `end` or `frame_interval` not finite and > 0, before anything is written.
    BadScene : a start that does not fit the body; the folder cannot be resumed: another scene,
        another method, damaged files.
    TongueError : another run writes to the folder.
    """
    if not (is_number(end) and end > 0):
        raise OutOfRange("end", end, "a finite number > 0", "s")
    watch, folder = Watch(), Path(folder)
    solver = _method(method, pair).solver(scene)
    first = _start(solver, start)
    if not end > first.time:
        raise OutOfRange("end", end, f"> {first.time:g} (the start)", "s")
    audit = EnergyAudit(solver, scene)
    recorder = Recorder(folder, scene, frame_interval)
    watch.method = repr(solver.method)
    try:
        resumed = _resumed(recorder, audit, watch, end) if resume else None
        if resumed is None:
            recorder.begin()
            write_description(folder, scene, solver.method, frame_interval)
        watch.start_marching(first if resumed is None else resumed)
        run = Run(scene, solver.method, folder, recorder.frames, resumed or first)
        if resumed is not None and resumed.time >= end:
            run.summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
            return run
        if resumed is not None:
            add_session(folder, resumed.time)
        run.last, run.summary = _march(
            solver, end, (first, resumed), audit, recorder, watch, progress
        )
        run.__dict__["solver"] = solver
        return run
    finally:
        recorder.close()


def _method(method: Method | None, pair: str | None) -> Method:
    if method is None:
        from dolfin_tongue.fenicsx import GeneralisedAlpha  # loads UFL, DOLFINx and PETSc

        method = GeneralisedAlpha()
    if pair is None:
        return method
    with_pair = getattr(method, "with_pair", None)
    if with_pair is None:
        raise BadScene(
            f"{type(method).__name__} has one pair of spaces, that of the report; leave out "
            f"pair={pair!r} or take GeneralisedAlpha"
        )
    return with_pair(pair)


def _start(solver: Solver, start: State | FloatArray | None) -> State:
    """State to start from; BadScene if it does not fit the body."""
    rest, body = solver.rest(), solver.scene.body
    if start is None:
        return rest
    if not isinstance(start, State):
        velocity = np.asarray(start, dtype=float)
        if velocity.shape not in ((3,), body.points.shape) or not np.isfinite(velocity).all():
            raise BadScene(
                f"start must be a State, or a velocity of shape (3,) or {body.points.shape} with "
                f"finite numbers, not {start!r}"
            )
        moving = np.broadcast_to(velocity, body.points.shape).copy()
        return replace(rest, velocity=moving, unknowns=None)
    for name in ("displacement", "velocity", "pressure"):
        given, own = getattr(start, name), getattr(rest, name)
        if np.shape(given) != own.shape or not np.isfinite(given).all():
            raise BadScene(
                f"the start's {name} must be finite and of shape {own.shape} for {body.name}, not "
                f"{np.shape(given)}"
            )
    return start


def _march(
    solver: Solver,
    end: float,
    starts: tuple[State, State | None],
    audit: EnergyAudit,
    recorder: Recorder,
    watch: Watch,
    progress: Callable[[float], None] | None,
) -> tuple[State, dict[str, Any]]:
    """March, observe and record; whatever stops it, files and summary say how far it came."""
    first, resumed = starts
    status, last = "stopped", resumed
    try:
        for state in solver.march(end, first if resumed is None else resumed):
            with uninterrupted():
                if resumed is None or state.time > resumed.time:
                    watch.observe(state, solver, audit, recorder)
                last = state
            if progress:
                progress(state.time)
        status = "finished"
    except BaseException as error:
        status = f"stopped: {str(error) or type(error).__name__}"
        raise
    finally:
        if last is not None:
            recorder.checkpoint(last, watch.account(audit))
            summary = watch.summary(solver, audit, last, status) | _described(recorder.scene)
            recorder.summary(summary)
    assert last is not None
    return last, summary


def _resumed(recorder: Recorder, audit: EnergyAudit, watch: Watch, end: float) -> State | None:
    """Take up the run in the folder, if there is one and it is the same."""
    found = recorder.resume()
    if found is None:
        return None
    state, account = found
    if account["method"] != watch.method:
        raise BadScene(
            f"the run in {recorder.folder} was made by {account['method']}; resume it with the "
            "same method, or start anew in another folder"
        )
    if state.time > end:
        raise OutOfRange("end", end, f"at least the {state.time:g} s that the run has reached")
    audit.restore(account["audit"], state)
    watch.restore(account)
    return state


def _described(scene: Scene) -> dict[str, Any]:
    """Return what was simulated, in short; ``scene.json`` has all of it."""
    return {
        "cells": scene.body.cell_count,
        "muscles": list(scene.body.fibres.names),
        "terms": [type(term).__name__ for term in scene.terms],
    }


def load_run(folder: Path | str, *, scene: Scene | None = None, own: Iterable[Any] = ()) -> Run:
    """Read a run back: scene, method, frames, last state, summary.

    Parameters
    ----------
    folder : of the run.
    scene : the scene itself, where its description holds functions.
    own : classes and functions of your own that the scene is made of.

    Raises
    ------
    BadScene : no run, damaged files, or a description that names unknown classes.
    """
    folder = Path(folder)
    described, method = read_description(folder, own, scene)
    try:
        frames = Frames(folder, described.body)
        with np.load(folder / "checkpoint.npz") as file:
            last = state_from(file)
        summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    except DAMAGED as error:
        raise BadScene(f"the run in {folder} cannot be read: {error}") from error
    return Run(described, method, folder, frames, last, summary)
