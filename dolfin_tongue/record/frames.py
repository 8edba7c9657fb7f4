"""Frames of a run on disk: raw arrays per frame and an XDMF index for ParaView.

Each frame is complete before the index names it, and the index is replaced at once, so that what
is on disk can be opened at any time of the run and after any kind of stop.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np

from dolfin_tongue.base.files import write_array, write_text
from dolfin_tongue.body.body import Body
from dolfin_tongue.march.state import State

#: Fields of a frame: name, place, components.
FIELDS = (("displacement", "Node", 3), ("velocity", "Node", 3), ("pressure", "Cell", 1))

#: Coordinates and rates of no rigid bodies.
NO_BODIES = np.zeros((2, 0, 3))


class Frames:
    """The frames in a folder.

    Parameters
    ----------
    folder : gets ``fields.xdmf`` and ``frames/``.
    body : the body that moves.
    bones : number of rigid bodies.
    """

    def __init__(self, folder: Path, body: Body, bones: int = 0):
        self.folder, self.body, self.bones = folder, body, bones
        self.times: list[float] = []

    def _path(self, name: str) -> Path:
        return self.folder / "frames" / f"{name}.bin"

    def append(self, state: State) -> None:
        """Write a state as the next frame."""
        number = len(self.times)
        if not number:
            write_array(self._path("points"), self.body.points)
            write_array(self._path("cells"), self.body.cells.astype(np.int64))
        for name, _, _ in FIELDS:
            write_array(self._path(f"{name}_{number:05d}"), getattr(state, name))
        if self.bones:
            both = np.stack([state.rigid, state.rigid_rate])
            write_array(self._path(f"rigid_{number:05d}"), both)
        self.times.append(state.time)
        write_text(self.folder / "fields.xdmf", self._index())

    def keep_until(self, times: list[float], time: float) -> None:
        """Take over the frames of an earlier run up to a time (s)."""
        self.times = [t for t in times if t <= time]

    def read(self, number: int) -> State:
        """Read a frame back."""
        arrays = {
            name: np.fromfile(self._path(f"{name}_{number:05d}"), dtype="<f8")
            for name, _, _ in FIELDS
        }
        shape, rigid = self.body.points.shape, NO_BODIES
        if self.bones:
            rigid = np.fromfile(self._path(f"rigid_{number:05d}"), dtype="<f8").reshape(2, -1, 3)
        return State(
            self.times[number],
            arrays["displacement"].reshape(shape),
            arrays["velocity"].reshape(shape),
            arrays["pressure"],
            rigid=rigid[0],
            rigid_rate=rigid[1],
        )

    def read_all(self) -> list[State]:
        """Read all frames back, in order of time."""
        return [self.read(number) for number in range(len(self.times))]

    # -- the XDMF index ------------------------------------------------------------------------

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
        nodes, cells = len(self.body.points), len(self.body.cells)
        grid = ET.SubElement(series, "Grid", Name=self.body.name, GridType="Uniform")
        ET.SubElement(grid, "Time", Value=repr(float(time)))
        topology = ET.SubElement(
            grid, "Topology", TopologyType="Hexahedron", NumberOfElements=str(cells)
        )
        self._item(topology, "cells", f"{cells} 8", "Int")
        self._item(ET.SubElement(grid, "Geometry", GeometryType="XYZ"), "points", f"{nodes} 3")
        for name, place, components in FIELDS:
            kind = "Vector" if components == 3 else "Scalar"
            attribute = ET.SubElement(
                grid, "Attribute", Name=name, AttributeType=kind, Center=place
            )
            count = nodes if place == "Node" else cells
            size = f"{count} {components}" if components > 1 else f"{count}"
            self._item(attribute, f"{name}_{number:05d}", size)

    def _item(self, parent: ET.Element, name: str, size: str, number: str = "Float") -> None:
        item = ET.SubElement(
            parent, "DataItem", Dimensions=size, NumberType=number, Precision="8",
            Format="Binary", Endian="Little",
        )  # fmt: skip
        item.text = f"frames/{name}.bin"
