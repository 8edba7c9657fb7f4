"""The unit block of the report's fig. 11 and its refinements, meshed by gmsh.

The block has 7 x 3 x 2 *parent* elements along r, s and t. Each of them is a volume of the gmsh
model, so that muscles and attachments that are defined on parents carry over to every refinement:
regions are gmsh physical groups made of whole volumes, faces, edges or corners of parents.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import product

import gmsh
import numpy as np

from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.base.errors import BadMesh, OutOfRange

#: Parent elements along r, s and t (report, fig. 11).
DIVISIONS = (7, 3, 2)

#: A box of the parents' node lattice: first and last node index along r, s and t. Equal indices
#: flatten it, so that a box can be a part of the volume, of a face, of a line, or one node.
Box = tuple[tuple[int, int], tuple[int, int], tuple[int, int]]


@dataclass(frozen=True)
class UnitBlock:
    """A hexahedral mesh of the unit cube.

    Parameters
    ----------
    rst : ndarray, shape (n, 3), dimensionless -- coordinates of the nodes, in [0, 1].
    cells : ndarray, shape (m, 8) -- VTK order, local axes along r, s and t.
    parents : ndarray, shape (m, 3) -- the parent element (i, j, k) of every cell.
    regions : node numbers of every named region, sorted.
    """

    rst: FloatArray
    cells: IntArray
    parents: IntArray
    regions: Mapping[str, IntArray]

    @property
    def centres(self) -> FloatArray:
        """Centres of the cells, shape (m, 3), in block coordinates."""
        return self.rst[self.cells].mean(axis=1)

    def node_at(self, rst: Sequence[float]) -> int:
        """Return the number of the node at (r, s, t); BadMesh if there is none."""
        distance = np.abs(self.rst - np.asarray(rst)).max(axis=1)
        nearest = int(distance.argmin())
        if distance[nearest] > 1e-9:
            raise BadMesh(f"the block has no node at {tuple(rst)}")
        return nearest


def unit_block(
    refinement: int | Sequence[int] = 1,
    regions: Mapping[str, Sequence[Box]] | None = None,
    divisions: Sequence[int] = DIVISIONS,
) -> UnitBlock:
    """Mesh the unit block with transfinite hexahedra.

    Parameters
    ----------
    refinement : cells per parent element along every axis, or one number per axis (r, s, t).
    regions : region name -> boxes of the parents' node lattice, all of the same dimension.
    divisions : number of parent elements along r, s and t.

    Returns
    -------
    UnitBlock
        Nodes and cells are numbered with r fastest, then s, then t.

    Raises
    ------
    OutOfRange : a refinement < 1 or not a whole number.
    BadMesh : a region outside the block, or with boxes of several dimensions.
    """
    factors = _factors(refinement)
    with gmsh_model("unit_block"):
        entities = _Lattice(tuple(divisions))
        entities.build(factors)
        for name, boxes in (regions or {}).items():
            entities.add_group(name, boxes)
        gmsh.model.mesh.generate(3)
        return _extract(np.asarray(divisions), np.asarray(factors), entities)


def _factors(refinement: int | Sequence[int]) -> tuple[int, int, int]:
    """Refinement along r, s and t; checked."""
    values = list(refinement) if isinstance(refinement, Sequence) else [refinement] * 3
    whole = len(values) == 3 and all(isinstance(v, int | np.integer) for v in values)
    if not whole or min(values) < 1:
        raise OutOfRange("refinement", refinement, "a whole number >= 1, or three of them")
    return int(values[0]), int(values[1]), int(values[2])


@contextmanager
def gmsh_model(name: str) -> Iterator[None]:
    """Open a silent gmsh model; a caller's gmsh session and model come back as they were."""
    outer = bool(gmsh.isInitialized())
    if not outer:
        gmsh.initialize(["-noenv"], readConfigFiles=False, interruptible=False)
    previous = gmsh.model.getCurrent() if outer else ""
    options = ("General.Terminal", "General.Verbosity")
    saved = [gmsh.option.getNumber(option) for option in options]
    try:
        for option in options:
            gmsh.option.setNumber(option, 0)
        gmsh.model.add(name)
        yield
    finally:
        if outer:
            gmsh.model.remove()
            gmsh.model.setCurrent(previous)
            for option, value in zip(options, saved, strict=True):
                gmsh.option.setNumber(option, value)
        else:
            gmsh.finalize()


class _Lattice:
    """The gmsh entities of the parents, each known by its box in the node lattice."""

    def __init__(self, divisions: tuple[int, ...]):
        self.divisions = divisions
        self.tags: dict[Box, int] = {}

    def build(self, factors: Sequence[int]) -> None:
        """Add points, lines, faces and volumes, from low to high dimension, all transfinite."""
        geo = gmsh.model.geo
        for box in self._boxes(dimension=0):
            corner = [box[a][0] / self.divisions[a] for a in range(3)]
            self.tags[box] = geo.addPoint(*corner)
        for box in self._boxes(dimension=1):
            axis = next(a for a in range(3) if box[a][0] != box[a][1])
            ends = [self.tags[_flatten(box, axis, side)] for side in (0, 1)]
            self.tags[box] = geo.addLine(*ends)
            geo.mesh.setTransfiniteCurve(self.tags[box], factors[axis] + 1)
        for box in self._boxes(dimension=2):
            self._add_face(box)
        for box in self._boxes(dimension=3):
            faces = [self.tags[_flatten(box, a, side)] for a in range(3) for side in (0, 1)]
            self.tags[box] = geo.addVolume([geo.addSurfaceLoop(faces)])
            geo.mesh.setTransfiniteVolume(self.tags[box])
        geo.synchronize()

    def _add_face(self, box: Box) -> None:
        """Add a transfinite face of quadrilaterals; its loop runs around the two free axes."""
        geo = gmsh.model.geo
        a, b = (axis for axis in range(3) if box[axis][0] != box[axis][1])
        around = [(b, 0, 1), (a, 1, 1), (b, 1, -1), (a, 0, -1)]
        lines = [sign * self.tags[_flatten(box, axis, side)] for axis, side, sign in around]
        self.tags[box] = geo.addPlaneSurface([geo.addCurveLoop(lines)])
        geo.mesh.setTransfiniteSurface(self.tags[box])
        geo.mesh.setRecombine(2, self.tags[box])

    def _boxes(self, dimension: int, within: Box | None = None) -> Iterator[Box]:
        """Elementary boxes of one dimension, inside a larger one (default: the whole block)."""
        limits = within or tuple((0, count) for count in self.divisions)
        intervals = [
            [(i, i) for i in range(first, last + 1)] + [(i, i + 1) for i in range(first, last)]
            for first, last in limits
        ]
        for box in product(intervals[0], intervals[1], intervals[2]):
            if _dimension(box) == dimension:
                yield box

    def add_group(self, name: str, boxes: Sequence[Box]) -> None:
        """Make a physical group of all entities in the boxes, of the boxes' own dimension."""
        dimensions = {_dimension(box) for box in boxes}
        inside = all(
            0 <= first <= last <= count
            for box in boxes
            for (first, last), count in zip(box, self.divisions, strict=True)
        )
        if len(dimensions) != 1 or not inside:
            raise BadMesh(f"region {name!r}: needs boxes of one dimension inside the block")
        dimension = dimensions.pop()
        members = {self.tags[part] for box in boxes for part in self._boxes(dimension, box)}
        gmsh.model.addPhysicalGroup(dimension, sorted(members), name=name)

    def volumes(self) -> Iterator[tuple[Box, int]]:
        """Boxes and tags of the parents."""
        return ((box, self.tags[box]) for box in self._boxes(dimension=3))


def _flatten(box: Box, axis: int, side: int) -> Box:
    """Return the lower (side 0) or upper (side 1) end of a box along an axis."""
    ends = list(box)
    ends[axis] = (box[axis][side], box[axis][side])
    return ends[0], ends[1], ends[2]


def _dimension(box: Box) -> int:
    """Return how many axes a box extends along."""
    return sum(last > first for first, last in box)


def _extract(divisions: IntArray, factors: IntArray, entities: _Lattice) -> UnitBlock:
    """Read the mesh back, renumbered with r fastest so that the numbering is ours, not gmsh's."""
    fine = divisions * factors
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    lattice = np.rint(coordinates.reshape(-1, 3) * fine).astype(np.int64)
    order = np.lexsort(lattice.T)
    number = np.zeros(int(tags.max()) + 1, dtype=np.int64)
    number[tags[order].astype(np.int64)] = np.arange(len(tags))
    lattice = lattice[order]
    cells, parents = [], []
    for box, tag in entities.volumes():
        _, _, (nodes,) = gmsh.model.mesh.getElements(3, tag)
        cells.append(_brick_order(number[nodes.astype(np.int64)].reshape(-1, 8), lattice))
        parents.append(np.tile([first for first, _ in box], (len(cells[-1]), 1)))
    joined = np.concatenate(cells)
    by_place = np.argsort(joined[:, 0])
    regions = {
        gmsh.model.getPhysicalName(dimension, tag): np.sort(
            number[gmsh.model.mesh.getNodesForPhysicalGroup(dimension, tag)[0].astype(np.int64)]
        )
        for dimension, tag in gmsh.model.getPhysicalGroups()
    }
    return UnitBlock(lattice / fine, joined[by_place], np.concatenate(parents)[by_place], regions)


def _brick_order(cells: IntArray, lattice: IntArray) -> IntArray:
    """Turn every cell so that its local axes are r, s and t (gmsh may start at any corner)."""
    corners = lattice[cells]
    offset = corners - corners.min(axis=1, keepdims=True)
    place = np.array([0, 1, 3, 2, 4, 5, 7, 6])[offset @ np.array([1, 2, 4])]
    turned = np.empty_like(cells)
    np.put_along_axis(turned, place, cells, axis=1)
    return turned
