"""How demos are found, and what they are given."""

from __future__ import annotations

import ast
import importlib.util
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from dolfin_tongue.errors import TongueError, UnknownName

#: Demos stand beside the package in a checkout.
FOLDER = Path(__file__).resolve().parent.parent / "demos"


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
    """

    folder: Path
    data: Path | None = None
    dt: float | None = None
    refinement: int = 1
    pictures: bool = True
    resume: bool = False

    def need_data(self) -> Path:
        """Folder of the published tongue; TongueError says how to name it."""
        if self.data is None:
            raise TongueError(
                "this demo needs the folder of a published tongue: --data PATH, or the variable "
                "DOLFIN_TONGUE_DATA"
            )
        return self.data


def available() -> dict[str, str]:
    """Names of the demos and the first line of what they say of themselves."""
    if not FOLDER.is_dir():
        raise TongueError(f"the demos are part of a checkout; there is no folder {FOLDER}")
    found = {}
    for path in sorted(FOLDER.glob("*.py")):
        text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
        found[path.stem] = text.splitlines()[0]
    return found


def load(name: str) -> Callable[[Options], dict[str, Any]]:
    """Return the `main` of a demo; UnknownName lists the known ones."""
    if name not in available():
        raise UnknownName("demo", name, available())
    spec = importlib.util.spec_from_file_location(f"tongue_demo_{name}", FOLDER / f"{name}.py")
    if spec is None or spec.loader is None:
        raise TongueError(f"the demo {name} cannot be loaded from {FOLDER}")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.main


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
