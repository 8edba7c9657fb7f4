"""How demos and benchmarks are found, what they are given, and how a demo is played."""

from __future__ import annotations

import ast
import importlib.util
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from dolfin_tongue.app.pictures import picture_run
from dolfin_tongue.base.errors import TongueError, UnknownName, require_positive
from dolfin_tongue.direct import TrBdf2
from dolfin_tongue.march.solver import Method
from dolfin_tongue.record.run import Run, simulate
from dolfin_tongue.scene.scene import Scene

#: Demos and benchmarks stand beside the package in a checkout, each a file with a `main`.
CHECKOUT = Path(__file__).resolve().parent.parent.parent
FOLDERS = {"demo": CHECKOUT / "demos", "benchmark": CHECKOUT / "benchmarks"}


@dataclass(frozen=True)
class Options:
    """What a demo is given.

    Parameters
    ----------
    folder : for its results.
    data : folder of a published tongue, if one was named.
    dt : time step, s; None for the demo's own.
    refinement : elements per edge of each element of the report's tongue.
    pictures : whether to draw.
    resume : continue the run that is in the folder.
    solver : ``"fenicsx"`` or ``"direct"``.
    """

    folder: Path
    data: Path | None = None
    dt: float | None = None
    refinement: int = 1
    pictures: bool = True
    resume: bool = False
    solver: str = "fenicsx"

    def __post_init__(self) -> None:
        if self.solver not in ("fenicsx", "direct"):
            raise UnknownName("solver", self.solver, ("fenicsx", "direct"))
        if self.dt is not None:
            require_positive(self, "s", dt=self.dt)

    def method(self, dt: float) -> Method:
        """Return the method of the chosen solver, with the step asked for, or else `dt` (s)."""
        chosen = self.dt if self.dt is not None else dt
        if self.solver == "direct":
            return TrBdf2(chosen)
        from dolfin_tongue.fenicsx import GeneralisedAlpha  # loads UFL, DOLFINx and PETSc

        return GeneralisedAlpha(chosen)

    def need_data(self) -> Path:
        """Folder of the published tongue; TongueError says how to name it."""
        if self.data is None:
            raise TongueError(
                "this demo needs the folder of a published tongue: --data PATH, or the variable "
                "DOLFIN_TONGUE_DATA"
            )
        return self.data


def available(kind: str = "demo") -> dict[str, str]:
    """Names of the demos (or benchmarks) and the first line of what they say of themselves."""
    folder = FOLDERS[kind]
    if not folder.is_dir():
        raise TongueError(f"the {kind}s are part of a checkout; there is no folder {folder}")
    found = {}
    for path in sorted(folder.glob("*.py")):
        text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
        found[path.stem] = text.partition("\n")[0]
    return found


def load(name: str, kind: str = "demo") -> Callable[[Options], dict[str, Any]]:
    """Return the `main` of a demo or benchmark; UnknownName lists the known ones."""
    if name not in available(kind):
        raise UnknownName(kind, name, available(kind))
    path = FOLDERS[kind] / f"{name}.py"
    spec = importlib.util.spec_from_file_location(f"tongue_{kind}_{name}", path)
    if spec is None or spec.loader is None:
        raise TongueError(f"the {kind} {name} cannot be loaded from {path}")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # where dataclasses look for the names of their fields
    spec.loader.exec_module(module)
    return module.main


def play(
    scene: Scene,
    end: float,
    options: Options,
    dt: float,
    title: str,
    *,
    folder: Path | None = None,
    method: Method | None = None,
    frame_interval: float = 0.02,
    draw: Callable[[Run, str], None] | None = picture_run,
) -> Run:
    """Simulate a scene under a progress bar and draw it.

    Parameters
    ----------
    scene : what moves.
    end : s.
    options : of the demo.
    dt : step of the demo, s, where none was asked for.
    title : over the pictures.
    folder : default that of the options.
    method : default that of the options.
    frame_interval : s.
    draw : draws the run; None for nothing.
    """
    with progress_bar("simulated", end) as progress:
        run = simulate(
            scene, end, folder or options.folder, method or options.method(dt),
            frame_interval=frame_interval, resume=options.resume, progress=progress,
        )  # fmt: skip
    if options.pictures and draw is not None:
        draw(run, title)
    return run


@contextmanager
def progress_bar(label: str, end: float) -> Iterator[Callable[[float], None]]:
    """Show a bar of simulated time; gives the function to call with the time reached, s."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed:.3f} of {task.total:.3f} s"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns) as bar:
        task = bar.add_task(label, total=end)
        yield lambda time: bar.update(task, completed=time)
