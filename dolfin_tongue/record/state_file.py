"""A state as named arrays and back; what frames and checkpoints hold."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.base.errors import BadScene
from dolfin_tongue.body.state import State

#: Fields that are saved as they are.
PLAIN = ("displacement", "velocity", "pressure", "rigid", "rigid_rate", "sliding")


def arrays_of(state: State) -> dict[str, Any]:
    """Arrays and numbers of a state by name; those of its memory are numbered.

    Raises
    ------
    BadScene : a memory that holds something else than arrays and numbers.
    """
    found: dict[str, Any] = {name: getattr(state, name) for name in PLAIN}
    found |= {"time": state.time, "step": state.step, "iterations": state.iterations}
    found["load"] = state.load
    if state.unknowns is not None:
        found["unknowns"], found["unknown_rates"] = state.unknowns
    leaves = list(_leaves(state.memory))
    found |= {f"memory_{i}": value for i, (_, value) in enumerate(leaves)}
    found["memory_paths"] = json.dumps([path for path, _ in leaves])
    return found


def state_from(arrays: Mapping[str, Any]) -> State:
    """State of such arrays; KeyError or ValueError if they are none."""
    plain: dict[str, FloatArray] = {name: np.asarray(arrays[name], dtype=float) for name in PLAIN}
    unknowns = None
    if "unknowns" in arrays:
        unknowns = np.asarray(arrays["unknowns"]), np.asarray(arrays["unknown_rates"])
    memory: dict[str, Any] = {}
    for number, path in enumerate(json.loads(str(arrays["memory_paths"]))):
        *above, name = path
        place = memory
        for part in above:
            place = place.setdefault(part, {})
        value = np.asarray(arrays[f"memory_{number}"])
        place[name] = value if value.ndim else value.item()
    return State(
        float(arrays["time"]), **plain, step=float(arrays["step"]),
        iterations=int(arrays["iterations"]), load=float(arrays["load"]), unknowns=unknowns,
        memory=memory,
    )  # fmt: skip


def _leaves(memory: Mapping[str, Any], above: tuple[str, ...] = ()) -> Iterator[tuple[Any, Any]]:
    """Paths and values of a nested memory."""
    for name, value in memory.items():
        path = (*above, name)
        if isinstance(value, Mapping):
            yield from _leaves(value, path)
        elif np.asarray(value).dtype.kind in "biuf":
            yield path, value
        else:
            raise BadScene(
                f"the memory {'/'.join(path)} holds {value!r}, which cannot be saved; keep arrays "
                "and numbers, or mappings of them, in a memory"
            )
