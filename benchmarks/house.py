"""How the code is laid out: rooms, floors, arrows, circles; modules, functions and signatures.

A room is a folder of the package, `geometry` among them. An arrow goes from a room to one that it
imports, wherever the import stands: at the top, in a function, or for type checking alone. The
floor of a room is the longest way down from it. Reads the sources only; as a script it takes the
path of another checkout to compare with: ``python3 benchmarks/house.py PATH``.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

CHECKOUT = Path(__file__).resolve().parent.parent
PACKAGE = "dolfin_tongue"

#: Most lines of a module and of a function, most parameters.
LINES, BODY, PARAMETERS = 400, 40, 7

Graph = dict[str, set[str]]


@dataclass(frozen=True)
class Function:
    """A function or method.

    Parameters
    ----------
    name : with its module and class.
    lines : without decorators, docstring and comments.
    parameters : without self and cls.
    """

    name: str
    lines: int
    parameters: int


@dataclass(frozen=True)
class Module:
    """A file of the package.

    Parameters
    ----------
    name : dotted.
    text : its source.
    """

    name: str
    text: str

    @property
    def room(self) -> str:
        """Folder below the package; the file itself at the top."""
        parts = self.name.split(".")
        return parts[1] if len(parts) > 1 else PACKAGE

    @property
    def lines(self) -> int:
        """Number of lines."""
        return len(self.text.splitlines())

    @cached_property
    def tree(self) -> ast.Module:
        """Its syntax."""
        return ast.parse(self.text)

    def imports(self, known: Mapping[str, Any]) -> set[str]:
        """Modules of the package that it imports, anywhere."""
        found: set[str] = set()
        for node in ast.walk(self.tree):
            if isinstance(node, ast.Import):
                found |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
                inner = {f"{node.module}.{alias.name}" for alias in node.names}
                found |= {name if name in known else node.module for name in inner}
        return {name for name in found if name in known and name != self.name}

    def functions(self) -> Iterator[Function]:
        """All functions, with inner ones and methods."""
        for node in ast.walk(self.tree):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                arguments = node.args
                named = [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs]
                count = sum(argument.arg not in ("self", "cls") for argument in named)
                yield Function(f"{self.name}.{node.name}", _body_lines(node), count)

    def sites(self, what: str) -> int:
        """How often ``isinstance`` or ``is None`` (with ``is not None``) is asked."""
        if what == "isinstance":
            return sum(
                isinstance(node, ast.Call) and getattr(node.func, "id", "") == "isinstance"
                for node in ast.walk(self.tree)
            )
        return sum(
            isinstance(node, ast.Compare)
            and isinstance(node.ops[0], ast.Is | ast.IsNot)
            and isinstance(node.comparators[0], ast.Constant)
            and node.comparators[0].value is None
            for node in ast.walk(self.tree)
        )


def _body_lines(node: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Lines of a body without docstring, counted as they would be written one statement each."""
    body = node.body
    first = body[0]
    if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant):
        body = body[1:]
    return (body[-1].end_lineno or 0) - body[0].lineno + 1 if body else 0


class House:
    """The package of a checkout.

    Parameters
    ----------
    checkout : folder that has the package.
    """

    def __init__(self, checkout: Path = CHECKOUT):
        self.modules: dict[str, Module] = {}
        for folder, prefix in ((PACKAGE, ""), ("geometry", f"{PACKAGE}.")):
            for path in sorted((checkout / folder).rglob("*.py")):
                parts = path.relative_to(checkout).with_suffix("").parts
                name = prefix + ".".join(part for part in parts if part != "__init__")
                if folder == PACKAGE and parts[1:2] == ("geometry",):
                    continue  # a link to the folder at the top
                self.modules[name] = Module(name, path.read_text(encoding="utf-8"))

    @cached_property
    def files(self) -> Graph:
        """Which module imports which."""
        return {name: module.imports(self.modules) for name, module in self.modules.items()}

    @cached_property
    def rooms(self) -> Graph:
        """Which room imports which."""
        graph: Graph = {module.room: set() for module in self.modules.values()}
        for name, imported in self.files.items():
            graph[self.modules[name].room] |= {self.modules[other].room for other in imported}
        return {room: others - {room} for room, others in graph.items()}

    @cached_property
    def floors(self) -> dict[str, int]:
        """Floor of each room, from 1; rooms of one circle share a floor."""
        groups = {room: group for group in circles(self.rooms, least=1) for room in group}
        found: dict[tuple[str, ...], int] = {}

        def floor(room: str) -> int:
            group = groups[room]
            if group not in found:
                below = {other for member in group for other in self.rooms[member]} - {*group}
                found[group] = 1 + max((floor(other) for other in below), default=0)
            return found[group]

        return {room: floor(room) for room in self.rooms}

    def table(self) -> dict[str, Any]:
        """Return what is worth printing."""
        functions = [f for module in self.modules.values() for f in module.functions()]
        modules = list(self.modules.values())
        arrows = sum(len(others) for others in self.rooms.values())
        return {
            "modules": len(modules),
            "lines": sum(module.lines for module in modules),
            "rooms": len(self.rooms),
            "floors": max(self.floors.values()),
            "arrows between rooms": arrows,
            "circles of rooms": len(circles(self.rooms)),
            "circles of files": len(circles(self.files)),
            f"modules over {LINES} lines": sum(module.lines > LINES for module in modules),
            f"functions over {BODY} lines": sum(f.lines > BODY for f in functions),
            f"functions of more than {PARAMETERS} parameters": sum(
                f.parameters > PARAMETERS for f in functions
            ),
            "isinstance sites": sum(module.sites("isinstance") for module in modules),
            "is None sites": sum(module.sites("is None") for module in modules),
        }


def circles(graph: Graph, least: int = 2) -> list[tuple[str, ...]]:
    """Strongly connected parts of a graph that have at least so many members (Tarjan 1972)."""
    order: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found: list[tuple[str, ...]] = []

    def visit(node: str) -> None:
        order[node] = low[node] = len(order)
        stack.append(node)
        for other in sorted(graph[node]):
            if other not in order:
                visit(other)
                low[node] = min(low[node], low[other])
            elif other in stack:
                low[node] = min(low[node], order[other])
        if low[node] == order[node]:
            place = stack.index(node)
            group = tuple(sorted(stack[place:]))
            del stack[place:]
            if len(group) >= least:
                found.append(group)

    for node in sorted(graph):
        if node not in order:
            visit(node)
    return found


def main(options: Any = None) -> dict[str, Any]:
    """Print rooms by floor; returns the table."""
    del options
    house = House()
    print_rooms(house)
    return house.table()


def print_rooms(house: House) -> None:
    """Print the rooms, floor by floor from the ground, each with what it stands on."""
    for floor in range(1, max(house.floors.values()) + 1):
        for room in sorted(room for room, own in house.floors.items() if own == floor):
            below = ", ".join(sorted(house.rooms[room])) or "nothing"
            print(f"floor {floor:2}: {room:13} on {below}")
    for circle in circles(house.rooms):
        print(f"circle: {', '.join(circle)}")


if __name__ == "__main__":
    checkouts = [Path(argument) for argument in sys.argv[1:]] or [CHECKOUT]
    tables = [House(checkout).table() for checkout in checkouts]
    print_rooms(House(checkouts[0]))
    for name, value in tables[0].items():
        print(f"{name:40}", *(f"{table[name]:8}" for table in (tables or [{name: value}])))
