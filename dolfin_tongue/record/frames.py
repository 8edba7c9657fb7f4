"""Frames of a run on disk: raw arrays per frame and an XDMF index for ParaView.

Each frame is complete before the index names it, and the index is replaced at once, so that what
is on disk can be opened at any time of the run and after any kind of stop.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from pathlib import Path
from typing import overload

import numpy as np

from dolfin_tongue.base.files import replacing, write_array, write_text
from dolfin_tongue.body.body import Body
from dolfin_tongue.body.state import State
from dolfin_tongue.record.state_file import arrays_of, state_from

#: Fields that ParaView shows: name, place, components.
FIELDS = (("displacement", "Node", 3), ("velocity", "Node", 3), ("pressure", "Cell", 1))

#: XDMF's name and number of each kind of cell.
XDMF_CELLS = {
    "hexahedron8": ("Hexahedron", 9),
    "hexahedron20": ("Hexahedron_20", 48),
    "tetrahedron4": ("Tetrahedron", 6),
    "prism6": ("Wedge", 8),
}


class Frames(Sequence[State]):
    """The frames in a folder, read one by one as they are asked for.

    Parameters
    ----------
    folder : has, or gets, ``fields.xdmf`` and ``frames/``.
    body : the body that moves.

    Attributes
    ----------
    times : of the frames, s; those that the folder has, until `clear` or `keep_until`.

    Raises
    ------
    ValueError : an index that is none.
    """

    def __init__(self, folder: Path, body: Body):
        self.folder, self.body = Path(folder), body
        self.times: list[float] = []
        index = self.folder / "fields.xdmf"
        if index.exists():
            try:
                found = ET.parse(index).iter("Time")
                self.times = [float(time.attrib["Value"]) for time in found]
            except (ET.ParseError, KeyError) as error:
                raise ValueError(f"{index} is no index of frames: {error}") from error

    def clear(self) -> None:
        """Forget the frames of an earlier run."""
        self.times = []
        (self.folder / "fields.xdmf").unlink(missing_ok=True)

    def keep_until(self, times: list[float], time: float) -> None:
        """Take over the frames of an earlier run up to a time (s)."""
        self.times = [t for t in times if t <= time]

    # -- one frame ---------------------------------------------------------------------------------

    def _path(self, name: str) -> Path:
        return self.folder / "frames" / f"{name}.bin"

    def _rest(self, number: int) -> Path:
        return self.folder / "frames" / f"rest_{number:05d}.npz"

    def append(self, state: State) -> None:
        """Write a state as the next frame."""
        number = len(self.times)
        if not number:
            write_array(self._path("points"), self.body.points)
            write_array(self._path("cells"), self._cells())
        arrays = arrays_of(state)
        for name, _, _ in FIELDS:
            write_array(self._path(f"{name}_{number:05d}"), arrays.pop(name))
        with replacing(self._rest(number)) as path:
            np.savez(path, **arrays)
        self.times.append(state.time)
        write_text(self.folder / "fields.xdmf", self._index())

    def read(self, number: int) -> State:
        """Read a frame.

        Raises
        ------
        OSError, ValueError, KeyError : files that are missing or damaged.
        """
        with np.load(self._rest(number)) as file:
            arrays = {name: file[name] for name in file.files}
        for name, _, components in FIELDS:
            values = np.fromfile(self._path(f"{name}_{number:05d}"), dtype="<f8")
            arrays[name] = values.reshape(-1, 3) if components == 3 else values
        if arrays["displacement"].shape != self.body.points.shape:
            raise ValueError(f"frame {number} does not belong to {self.body.name}")
        return state_from(arrays)

    def __len__(self) -> int:
        return len(self.times)

    @overload
    def __getitem__(self, place: int) -> State: ...

    @overload
    def __getitem__(self, place: slice) -> list[State]: ...

    def __getitem__(self, place: int | slice) -> State | list[State]:
        numbers = range(len(self.times))[place]
        if isinstance(numbers, range):
            return [self.read(number) for number in numbers]
        return self.read(numbers)

    # -- the XDMF index ----------------------------------------------------------------------------

    def _cells(self) -> np.ndarray:
        """Node numbers cell after cell; where there are several kinds, behind XDMF's number."""
        kinds = self.body.cells_by_kind
        if len(kinds) == 1:
            (cells,) = kinds.values()
            return cells.astype(np.int64)
        parts = [
            np.insert(cells, 0, XDMF_CELLS[kind][1], axis=1).ravel()
            for kind, cells in kinds.items()
        ]
        return np.concatenate(parts).astype(np.int64)

    def _size_of_cells(self) -> str:
        kinds = self.body.cells_by_kind
        if len(kinds) == 1:
            (cells,) = kinds.values()
            return f"{cells.shape[0]} {cells.shape[1]}"
        return str(sum(cells.size + len(cells) for cells in kinds.values()))

    def _index(self) -> str:
        root = ET.Element("Xdmf", Version="3.0")
        series = ET.SubElement(
            ET.SubElement(root, "Domain"), "Grid", GridType="Collection", CollectionType="Temporal"
        )
        for number, time in enumerate(self.times):
            self._grid(series, number, time)
        ET.indent(root)
        return '<?xml version="1.0" ?>\n' + ET.tostring(root, encoding="unicode") + "\n"

    def _grid(self, series: ET.Element, number: int, time: float) -> None:
        nodes, kinds = len(self.body.points), self.body.cells_by_kind
        grid = ET.SubElement(series, "Grid", Name=self.body.name, GridType="Uniform")
        ET.SubElement(grid, "Time", Value=repr(float(time)))
        kind = XDMF_CELLS[next(iter(kinds))][0] if len(kinds) == 1 else "Mixed"
        count = str(self.body.cell_count)
        topology = ET.SubElement(grid, "Topology", TopologyType=kind, NumberOfElements=count)
        self._item(topology, "cells", self._size_of_cells(), "Int")
        self._item(ET.SubElement(grid, "Geometry", GeometryType="XYZ"), "points", f"{nodes} 3")
        for name, place, components in FIELDS:
            kind = "Vector" if components == 3 else "Scalar"
            attribute = ET.SubElement(
                grid, "Attribute", Name=name, AttributeType=kind, Center=place
            )
            own = nodes if place == "Node" else self.body.cell_count
            shape = f"{own} {components}" if components > 1 else f"{own}"
            self._item(attribute, f"{name}_{number:05d}", shape)

    def _item(self, parent: ET.Element, name: str, size: str, number: str = "Float") -> None:
        item = ET.SubElement(
            parent, "DataItem", Dimensions=size, NumberType=number, Precision="8",
            Format="Binary", Endian="Little",
        )  # fmt: skip
        item.text = f"frames/{name}.bin"
