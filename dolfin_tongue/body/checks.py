"""What the arrays of a body are refused for, and why."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from dolfin_tongue.base.arrays import FloatArray, IntArray, whole_numbers
from dolfin_tongue.base.errors import BadMesh, UnknownName, listing
from dolfin_tongue.base.units import LARGEST_SIZE
from dolfin_tongue.body.block import Block
from dolfin_tongue.body.cells import KINDS
from dolfin_tongue.body.faces import all_faces
from dolfin_tongue.body.fibres import Fibres


def as_cells(name: str, cells: Any) -> IntArray | dict[str, IntArray]:
    """Node numbers of cells as arrays; BadMesh for what only looks like them."""
    if not isinstance(cells, Mapping):
        array = whole_numbers(f"{name}: cells", cells)
        _check_shape(name, "hexahedron8", array)
        return array
    result = {}
    for kind, nodes in cells.items():
        if kind not in KINDS:
            raise UnknownName("kind of cells", kind, KINDS)
        result[kind] = whole_numbers(f"{name}: cells of {kind}", nodes)
        _check_shape(name, kind, result[kind])
    if not result:
        raise BadMesh(f"{name}: no cells")
    return result


def _check_shape(name: str, kind: str, cells: IntArray) -> None:
    count = KINDS[kind].node_count
    if cells.ndim != 2 or cells.shape[1] != count or not len(cells):
        raise BadMesh(f"{name}: cells of {kind} must have shape (m, {count}), not {cells.shape}")


def as_sets(name: str, what: str, sets: Mapping[str, Any]) -> dict[str, IntArray]:
    """Named arrays of node or cell numbers."""
    return {
        key: np.atleast_1d(whole_numbers(f"{name}: the {what} {key!r}", numbers))
        for key, numbers in sets.items()
    }


def as_landmarks(name: str, landmarks: Mapping[str, Any]) -> dict[str, int]:
    """Named single nodes."""
    if several := [key for key, node in landmarks.items() if np.ndim(node)]:
        raise BadMesh(f"{name}: landmark(s) {listing(several)} must be one node each")
    return {
        key: int(whole_numbers(f"{name}: the landmark {key!r}", [node])[0])
        for key, node in landmarks.items()
    }


def check_points(name: str, points: FloatArray) -> None:
    """Refuse points that are not finite, or millimetres."""
    if points.ndim != 2 or points.shape[1] != 3:
        raise BadMesh(f"{name}: points must have shape (n, 3), not {points.shape}")
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if bad.size:
        raise BadMesh(f"{name}: coordinates of node(s) {listing(bad)} are not finite")
    size = np.ptp(points, axis=0).max(initial=0.0)
    if size > LARGEST_SIZE:
        raise BadMesh(
            f"{name}: it is {size:.3g} m long; coordinates are metres: multiply by 1e-3 "
            "if yours are millimetres"
        )


def check_cells(name: str, points: FloatArray, cells: Mapping[str, IntArray]) -> None:
    """Refuse cells that name missing nodes or one node twice, that occur twice or overlap."""
    used = np.unique(np.concatenate([nodes.ravel() for nodes in cells.values()]))
    if used[0] < 0 or used[-1] >= len(points):
        raise BadMesh(
            f"{name}: cells name nodes {used[0]} to {used[-1]}, but there are "
            f"{len(points)} points (numbers 0 to {len(points) - 1})"
        )
    if len(used) != len(points):
        unused = np.setdiff1d(np.arange(len(points)), used)
        raise BadMesh(f"{name}: node(s) {listing(unused)} belong to no cell")
    first = 0
    for nodes in cells.values():
        ordered = np.sort(nodes, axis=1)
        twice = np.flatnonzero((np.diff(ordered, axis=1) == 0).any(axis=1))
        if twice.size:
            raise BadMesh(f"{name}: cell(s) {listing(first + twice)} name a node twice")
        _, place, count = np.unique(ordered, axis=0, return_index=True, return_counts=True)
        if (count > 1).any():
            raise BadMesh(f"{name}: cell(s) {listing(first + place[count > 1])} are listed twice")
        first += len(nodes)
    _check_overlap(name, cells)


def _check_overlap(name: str, cells: Mapping[str, IntArray]) -> None:
    faces, owners = all_faces(cells)
    _, first, count = np.unique(
        np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True
    )
    if (count > 2).any():
        raise BadMesh(
            f"{name}: a face of cell(s) {listing(np.unique(owners[first[count > 2]]))} belongs to "
            "more than two cells: cells overlap"
        )


def check_inverted(name: str, blocks: Iterable[Block]) -> None:
    """Refuse cells with a Jacobian <= 0 at a quadrature point."""
    for block in blocks:
        inverted = np.flatnonzero(~(block.weights.min(axis=1) > 0)) + block.numbers.start
        if inverted.size:
            raise BadMesh(
                f"{name}: {inverted.size} inverted {block.kind.name} cell(s) (Jacobian <= 0 at a "
                f"quadrature point): {listing(inverted)}. Check the node order and the node "
                "coordinates (hexahedra: 0-3 bottom counter-clockwise, 4-7 above)"
            )


def check_sets(name: str, what: str, sets: Mapping[str, IntArray], count: int) -> None:
    """Refuse sets that are empty or name a node or cell beyond `count`."""
    part = "cell" if what == "cell set" else "node"
    for key, numbers in sets.items():
        if not numbers.size:
            raise BadMesh(f"{name}: the {what} {key!r} is empty")
        if numbers.min() < 0 or numbers.max() >= count:
            raise BadMesh(f"{name}: the {what} {key!r} names a {part} that does not exist")


def check_muscles(name: str, fibres: Fibres, cell_sets: Mapping[str, IntArray], count: int) -> None:
    """Refuse muscles in cells that are not there, or of the name of other cells."""
    for muscle in fibres.muscles:
        if not 0 <= muscle.cells.min() <= muscle.cells.max() < count:
            raise BadMesh(f"{name}: muscle {muscle.name!r} names a cell that is not there")
        if muscle.name in cell_sets:
            raise BadMesh(
                f"{name}: {muscle.name!r} is the name of a muscle and of a cell set; the cells of "
                "a muscle can be named by it, choose another name for the cell set"
            )
