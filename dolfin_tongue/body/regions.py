"""Values on the cells of a body: numbers, regions, arrays and parameters become arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.base.errors import BadScene, is_number, listing
from dolfin_tongue.base.values import ELSEWHERE, Number, Parameter, Value
from dolfin_tongue.body.fibres import Slots


class Regions(Protocol):
    """What a body knows of its cells."""

    @property
    def name(self) -> str:
        """Name of the body."""

    @property
    def cell_count(self) -> int:
        """Number of cells, m."""

    @property
    def point_counts(self) -> IntArray:
        """Number of quadrature points of every cell, shape (m,)."""

    def region_cells(self, name: str) -> IntArray:
        """Cells of a region; UnknownName lists the known ones."""


@dataclass(frozen=True, eq=False)
class CellValues:
    """A value on cells: `base` plus the sum of parameters times their `shares`.

    Parameters
    ----------
    base : ndarray of shape (), (m, 1) or (m, q); on the s fibre slots of the cells (m, 1 or q, s).
    shares : parameters, each with an ndarray of shape () or of those: where it counts.
    """

    base: FloatArray
    shares: tuple[tuple[Parameter, FloatArray], ...] = ()

    @property
    def array(self) -> FloatArray:
        """All of it as numbers, of the shape of `base`."""
        total = self.base
        for parameter, share in self.shares:
            total = total + parameter.value * share
        return np.asarray(total)

    def part(self, cells: slice | IntArray) -> CellValues:
        """Return the values of some of the cells."""

        def of(array: FloatArray) -> FloatArray:
            return array[cells] if array.ndim else array

        return CellValues(of(self.base), tuple((p, of(share)) for p, share in self.shares))

    @property
    def contiguous(self) -> FloatArray:
        """Numbers for loops over cells and points, shape (k or 1, q or 1, ...)."""
        values = self.array
        return np.ascontiguousarray(values if values.ndim else values.reshape(1, 1))


def on_cells(what: str, value: Value, body: Regions) -> CellValues:
    """Spread a value over the cells of a body.

    Parameters
    ----------
    what : for messages, e.g. ``"ReportTissue.a0"``.
    value : see `base.values`.
    body : with its regions.

    Raises
    ------
    UnknownName : a region that the body does not have.
    BadScene : cells of two regions, or of none without "elsewhere"; arrays of another size.
    """
    if isinstance(value, Mapping):
        return _by_region(what, value, body)
    if isinstance(value, Parameter):
        return CellValues(np.zeros(()), ((value, np.ones(())),))
    array = np.asarray(value, dtype=float)
    if array.ndim:
        _check_size(what, array, body)
    return CellValues(array[:, None] if array.ndim == 1 else array)


def _check_size(what: str, array: FloatArray, body: Regions) -> None:
    if len(array) != body.cell_count:
        raise BadScene(
            f"{what} has values for {len(array)} cells, and {body.name} has {body.cell_count}"
        )
    counts = np.unique(body.point_counts)
    if array.ndim == 2 and not np.array_equal(counts, [array.shape[1]]):
        raise BadScene(
            f"{what} has values at {array.shape[1]} quadrature points of each cell, and cells of "
            f"{body.name} have {listing(counts)}"
        )


def _by_region(what: str, value: Mapping[str, Number], body: Regions) -> CellValues:
    owner = np.full(body.cell_count, -1)
    names = [name for name in value if name != ELSEWHERE]
    for number, name in enumerate(names):
        cells = body.region_cells(name)
        taken = cells[owner[cells] >= 0]
        if taken.size:
            raise BadScene(
                f"{what}: cell(s) {listing(taken)} belong to {names[owner[taken[0]]]!r} and to "
                f"{name!r}; name regions that do not overlap"
            )
        owner[cells] = number
    left = np.flatnonzero(owner < 0)
    if left.size and ELSEWHERE not in value:
        raise BadScene(
            f"{what}: cell(s) {listing(left)} belong to none of {', '.join(map(repr, names))}; add "
            f"{ELSEWHERE!r} for all other cells"
        )
    owner[left] = len(names)
    numbers = [value[name] for name in names] + [value.get(ELSEWHERE, 0.0)]
    return combined(numbers, owner[:, None])


def on_slots(what: str, values: Sequence[Value], slots: Slots, body: Regions) -> CellValues:
    """Spread values of muscles over the fibre slots of the cells.

    Parameters
    ----------
    what : for messages.
    values : of each muscle, in the order of `slots.names`.
    slots : of s slots in each cell.
    body : with its regions.

    Returns
    -------
    CellValues of shape (), (m, 1, s) or (m, q, s).
    """
    if all(is_number(value) and value == values[0] for value in values):
        return CellValues(np.asarray(values[0], dtype=float))
    parts = [
        on_cells(f"{what} of {name!r}", value, body)
        for name, value in zip(slots.names, values, strict=True)
    ]
    masks = [(slots.muscle == number).astype(float)[:, None] for number in range(len(parts))]
    base = _summed([(part.base, mask) for part, mask in zip(parts, masks, strict=True)])
    shares: dict[Parameter, list[tuple[FloatArray, FloatArray]]] = {}
    for part, mask in zip(parts, masks, strict=True):
        for parameter, share in part.shares:
            shares.setdefault(parameter, []).append((share, mask))
    return CellValues(base, tuple((name, _summed(pairs)) for name, pairs in shares.items()))


def _summed(pairs: list[tuple[FloatArray, FloatArray]]) -> FloatArray:
    """Sum over muscles of values () or (m, 1 or q) times masks of slots (m, 1, s)."""
    total: FloatArray = np.zeros(())
    for values, mask in pairs:
        total = total + (values[..., None] if values.ndim else values) * mask
    return total


def by_muscle(value: Any, names: Sequence[str]) -> list[Any]:
    """Turn a value into one for each muscle.

    Parameters
    ----------
    value : a mapping from muscles (and "elsewhere") to values, or one value for all.
    names : the muscles.

    Raises
    ------
    BadScene : a mapping that leaves a muscle out, or mixes muscles with other names.
    """
    known = {*names, ELSEWHERE}
    if not isinstance(value, Mapping) or not known.intersection(value) - {ELSEWHERE}:
        return [value] * len(names)
    if strangers := sorted(set(value) - known):
        raise BadScene(
            f"{listing(map(repr, strangers))}: not among the muscles that take part, "
            f"{', '.join(names)}"
        )
    if ELSEWHERE not in value and (missing := [name for name in names if name not in value]):
        raise BadScene(
            f"no value for {', '.join(map(repr, missing))}; add {ELSEWHERE!r} for all other muscles"
        )
    return [value[name] if name in value else value[ELSEWHERE] for name in names]


def combined(numbers: list[Number], owner: IntArray) -> CellValues:
    """Value whose entries are picked from a list.

    Parameters
    ----------
    numbers : to pick from.
    owner : ndarray of any shape -- which one counts where.
    """
    plain = [0.0 if isinstance(x, Parameter) else float(x) for x in numbers]
    shares: dict[Parameter, FloatArray] = {}
    for place, number in enumerate(numbers):
        if isinstance(number, Parameter):
            here = (owner == place).astype(float)
            shares[number] = shares[number] + here if number in shares else here
    return CellValues(np.array(plain)[owner], tuple(shares.items()))
