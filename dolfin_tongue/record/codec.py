"""Scenes and methods as JSON and arrays, and back: nothing but data is read, no code is run.

A dataclass becomes the name of its class and its fields, an array a name in a file beside. What is
read are classes of this package, and those that the caller hands over. A function cannot be kept in
a file: its name is, and the caller hands it over too.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields, is_dataclass
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.base.errors import BadScene
from dolfin_tongue.record.code import code_of

#: Modules whose classes scenes and methods are made of; the solvers are asked last: they load much.
ROOMS = (
    "dolfin_tongue.base.values",
    "dolfin_tongue.body",
    "dolfin_tongue.control",
    "dolfin_tongue.constitutive",
    "dolfin_tongue.boundary",
    "dolfin_tongue.rigid",
    "dolfin_tongue.surfaces",
    "dolfin_tongue.surfaces.retraction",
    "dolfin_tongue.scene",
)
SOLVERS = ("dolfin_tongue.direct", "dolfin_tongue.fenicsx")


class Encoder:
    """Turns values into JSON, and collects arrays by name.

    Attributes
    ----------
    arrays : those met so far; equal objects once.
    """

    def __init__(self) -> None:
        self.arrays: dict[str, FloatArray] = {}
        self._names: dict[int, str] = {}

    def encode(self, value: Any) -> Any:
        """JSON for a value."""
        if value is None or isinstance(value, bool | int | float | str):
            return value
        if isinstance(value, np.generic):
            return value.item()
        if isinstance(value, np.ndarray):
            return {"array": self._array(value)}
        if isinstance(value, tuple):
            return {"tuple": [self.encode(item) for item in value]}
        if isinstance(value, list):
            return [self.encode(item) for item in value]
        if isinstance(value, Mapping):
            return {"mapping": [[self.encode(k), self.encode(v)] for k, v in value.items()]}
        if isinstance(value, Path):
            return str(value)
        if is_dataclass(value) and not isinstance(value, type):
            own = {f.name: self.encode(getattr(value, f.name)) for f in fields(value)}
            return {"class": _name(type(value)), "fields": own}
        if inspect.isroutine(value) or isinstance(value, partial):
            return {"function": _name(value), "code": code_of(value, self.encode)}
        own = {name: self.encode(part) for name, part in getattr(value, "__dict__", {}).items()}
        return {"class": _name(type(value)), "state": own}

    def _array(self, array: FloatArray) -> str:
        if id(array) not in self._names:
            name = f"array_{len(self.arrays)}"
            self._names[id(array)], self.arrays[name] = name, array
        return self._names[id(array)]


def _name(thing: Any) -> str:
    """Name of a class or function: its own for one of this package, else with its module."""
    if isinstance(thing, partial):
        return f"partial of {_name(thing.func)}"
    known = thing.__module__.startswith("dolfin_tongue.") and not inspect.isroutine(thing)
    return thing.__qualname__ if known else f"{thing.__module__}.{thing.__qualname__}"


class Decoder:
    """Turns JSON back into values.

    Parameters
    ----------
    arrays : by name.
    own : classes and functions of the caller's.

    Raises
    ------
    BadScene : from `decode`, for classes and functions that are not known.
    """

    def __init__(self, arrays: Mapping[str, FloatArray], own: Iterable[Any] = ()):
        self._arrays, self._own = arrays, {_name(thing): thing for thing in own}

    def decode(self, value: Any) -> Any:
        """Value of JSON."""
        if isinstance(value, list):
            return [self.decode(item) for item in value]
        if not isinstance(value, dict):
            return value
        if "array" in value:
            return self._arrays[value["array"]]
        if "tuple" in value:
            return tuple(self.decode(item) for item in value["tuple"])
        if "mapping" in value:
            return {self.decode(k): self.decode(v) for k, v in value["mapping"]}
        if "function" in value:
            return self._function(value["function"])
        return self._instance(value)

    def _function(self, name: str) -> Callable[..., Any]:
        if name not in self._own:
            raise BadScene(
                f"the scene holds the function {name}, which no file can: hand it over, "
                "own=(the_function,), or the whole scene, scene=..."
            )
        return self._own[name]

    def _class(self, name: str) -> type:
        if name in self._own:
            return self._own[name]
        if "." not in name:
            for room in (*ROOMS, *SOLVERS):
                try:
                    found = getattr(import_module(room), name, None)
                except ImportError:  # a solver that is not installed
                    continue
                if isinstance(found, type):
                    return found
        raise BadScene(
            f"the scene holds a {name}, which this program does not know: hand the class over, "
            "own=(TheClass,), or read the folder with the version that wrote it"
        )

    def _instance(self, value: dict[str, Any]) -> Any:
        kind = self._class(value["class"])
        if "state" in value:
            made: Any = object.__new__(kind)
            made.__dict__.update({k: self.decode(part) for k, part in value["state"].items()})
            return made
        given = {name: self.decode(part) for name, part in value["fields"].items()}
        names = [field.name for field in fields(kind) if field.init]
        taken = inspect.signature(kind).parameters
        variable = any(p.kind is p.VAR_POSITIONAL for p in taken.values())
        if list(taken) == names and not variable:
            return kind(**{name: given[name] for name in names})
        made = object.__new__(kind)  # its __init__ takes other arguments than its fields
        for name, part in given.items():
            object.__setattr__(made, name, part)
        return made
