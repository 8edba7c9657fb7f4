"""Command line: ``python3 -m dolfin_tongue demo|bench ...``."""

from __future__ import annotations

import signal
import sys
import time as clock
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Column, Table

from dolfin_tongue.app import demo as demos
from dolfin_tongue.base.errors import TongueError

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
)


@app.callback()
def _root() -> None:
    """Simulate a muscle-activated tongue."""


Results = Annotated[Path, typer.Option(help="folder of all results")]
Data = Annotated[
    Path | None, typer.Option(envvar="DOLFIN_TONGUE_DATA", help="folder of a published tongue")
]
ShowList = Annotated[bool, typer.Option("--list", help="list the names and stop")]


@app.command()
def demo(
    name: Annotated[str, typer.Argument(help="which demo; see --list")] = "tongue",
    show_list: ShowList = False,
    results: Results = Path("results"),
    data: Data = None,
    dt: Annotated[float | None, typer.Option(help="time step, s; default: the demo's own")] = None,
    refinement: Annotated[int, typer.Option(help="elements per edge of each of the 42")] = 1,
    pictures: Annotated[bool, typer.Option(help="draw pictures")] = True,
    resume: Annotated[bool, typer.Option("--resume", help="continue a run that stopped")] = False,
    solver: Annotated[str, typer.Option(help="fenicsx or direct")] = "fenicsx",
) -> None:
    """Run a demo; its files are in RESULTS/NAME."""
    with _clear_errors():
        if show_list:
            return _print_table("demos", demos.available())
        options = demos.Options(results / name, data, dt, refinement, pictures, resume, solver)
        _run("demo", name, options)


@app.command()
def bench(
    name: Annotated[str, typer.Argument(help="which benchmark; see --list")] = "profile",
    show_list: ShowList = False,
    results: Results = Path("results"),
    data: Data = None,
    dt: Annotated[float | None, typer.Option(help="time step, s")] = None,
    refinement: Annotated[int, typer.Option(help="elements per edge of each of the 42")] = 1,
) -> None:
    """Run a benchmark; its files are in RESULTS/bench_NAME."""
    with _clear_errors():
        if show_list:
            return _print_table("benchmarks", demos.available("benchmark"))
        options = demos.Options(results / f"bench_{name}", data, dt, refinement)
        _run("benchmark", name, options)


def _run(kind: str, name: str, options: demos.Options) -> None:
    main = demos.load(name, kind)
    begin = clock.perf_counter()
    _print_table(f"{kind} {name}", main(options))
    Console(soft_wrap=True).print(
        f"{clock.perf_counter() - begin:.1f} s in all; results in {options.folder.resolve()}/"
    )


def _print_table(title: str, rows: Mapping[str, Any]) -> None:
    """Print names and values; values that are mappings themselves become columns."""
    columns = next((list(v) for v in rows.values() if isinstance(v, Mapping)), [])
    table = Table(Column("", no_wrap=True), *columns, title=title, show_header=bool(columns))
    for name, value in rows.items():
        values = value.values() if isinstance(value, Mapping) else [value]
        table.add_row(str(name), *(_text(x) for x in values))
    # a pipe has no width: wide enough that nothing is folded in a log
    console = Console() if sys.stdout.isatty() else Console(width=140)
    console.print(table)


def _text(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


@contextmanager
def _clear_errors() -> Iterator[None]:
    """End the command with one clear line instead of a traceback."""
    console = Console(stderr=True, soft_wrap=True)
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # a run saves what it has
    try:
        yield
    except (TongueError, OSError) as error:
        console.print(f"error: {error}", markup=False, style="red")
        raise typer.Exit(1) from error
    except KeyboardInterrupt as error:
        console.print("interrupted; a run goes on with --resume")
        raise typer.Exit(130) from error


if __name__ == "__main__":
    app()
