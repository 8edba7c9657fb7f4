"""Our own numbers of the unknowns: y = (displacements, pressures, unknowns of the couplings).

The points of the displacement come first, three unknowns each: the nodes of the body in its order,
then the points of a quadratic displacement between them. Each such point lies in the middle of an
edge, face or cell and is known by the corners of that. Pressures follow in the order of the cells
(or, where the pressure is continuous, of the nodes). DOLFINx renumbers nodes and cells for itself;
nothing of that is seen outside of `domains`.
"""

from __future__ import annotations

from functools import cached_property

import basix
import basix.ufl
import numpy as np

from dolfin_tongue.base.arrays import FloatArray, IntArray, sums_at
from dolfin_tongue.body.body import Body
from dolfin_tongue.body.faces import row_places
from dolfin_tongue.fenicsx.pairs import TENSOR_ORDER, Pair


class Numbering:
    """Points of the displacement and pressures of a pair of spaces on a body.

    Parameters
    ----------
    body : hexahedra.
    pair : the spaces.

    Attributes
    ----------
    cells : ndarray, shape (children m, c) -- corners of the cells of the mesh in basix' order.
    corners : for each number of corners (1, 2, 4, 8) the points that are the middle of as many
        nodes: ndarray, shape (k, corners), of sorted node numbers; numbered through in this order.
    """

    def __init__(self, body: Body, pair: Pair):
        self.body, self.pair = body, pair
        self.cells = pair.cells(body)[:, TENSOR_ORDER[pair.shape]]
        self.corners: dict[int, IntArray] = {1: np.arange(len(body.points))[:, None]}
        for entity in self._entities(pair.shape):
            if len(entity[0]) > 1:
                rows = np.sort(self.cells[:, np.array(entity)], axis=-1)
                rows = rows.reshape(-1, rows.shape[-1])
                self.corners[rows.shape[1]] = np.unique(rows, axis=0)
        counts = [len(rows) for rows in self.corners.values()]
        self._first = dict(zip(self.corners, np.cumsum([0, *counts[:-1]]), strict=True))
        self.point_count = sum(counts)
        #: Numbers of the pressures of each cell of the mesh, shape (children m, k).
        self.cell_pressures = 3 * self.point_count + self._pressures()
        self.size = 1 + int(self.cell_pressures.max())

    def _pressures(self) -> IntArray:
        family, degree = self.pair.pressure
        if family == "Lagrange":
            return self.cells
        count = 1 if degree == 0 else 4
        return np.arange(count * len(self.cells)).reshape(-1, count)

    def _entities(self, shape: str) -> list[list[list[int]]]:
        """Corners of the vertices, edges, faces and insides that carry a point, by dimension."""
        cell = basix.CellType[shape]
        element = basix.create_element(basix.ElementFamily.P, cell, self.pair.degree)
        topology = basix.topology(cell)
        dofs = element.entity_dofs
        return [topology[d] for d in range(len(topology)) if dofs[d][0]]

    def points_of(self, shape: str, corners: IntArray) -> IntArray:
        """Points of cells or faces, shape (k, points), in the order of basix' Lagrange element.

        Parameters
        ----------
        shape : basix' name of the cells or faces.
        corners : ndarray, shape (k, c) -- node numbers, in basix' order.
        """
        columns = []
        for entities in self._entities(shape):
            rows = np.sort(corners[:, np.array(entities)], axis=-1)
            count = rows.shape[-1]
            place = row_places(rows.reshape(-1, count), self.corners[count])
            columns.append(self._first[count] + place.reshape(rows.shape[:-1]))
        return np.concatenate(columns, axis=1)

    # -- slices and tables of unknowns -------------------------------------------------------------

    @property
    def nodal_only(self) -> bool:
        """Whether the displacement has points at the nodes of the body and nowhere else."""
        return self.pair.degree == 1

    @property
    def nodes(self) -> slice:
        """Displacement of the nodes of the body: reshape to (n, 3)."""
        return slice(0, 3 * len(self.body.points))

    @property
    def displacements(self) -> slice:
        """Displacement of all points: reshape to (points, 3)."""
        return slice(0, 3 * self.point_count)

    @property
    def pressures(self) -> slice:
        """All pressures."""
        return slice(3 * self.point_count, self.size)

    @cached_property
    def positions(self) -> FloatArray:
        """Reference positions of all points, shape (points, 3), m."""
        points = self.body.points
        return np.concatenate([points[rows].mean(axis=1) for rows in self.corners.values()])

    def following(self, nodes: IntArray) -> list[tuple[IntArray, IntArray]]:
        """Points that follow some nodes.

        Parameters
        ----------
        nodes : ndarray, shape (k,) -- nodes of the body.

        Returns
        -------
        list of (points, corners) -- arrays of shape (j,) and (j, c): each point moves with the mean
        of c nodes, given as positions in `nodes`. With c > 1 those are points of a quadratic
        displacement, on edges and faces whose corners are all among the nodes.
        """
        place = np.full(len(self.body.points), -1)
        place[nodes] = np.arange(len(nodes))
        result = [(nodes, np.arange(len(nodes))[:, None])]
        for count, rows in self.corners.items():
            if 1 < count < 8:
                inside = np.flatnonzero((place[rows] >= 0).all(axis=1))
                if inside.size:
                    result.append((self._first[count] + inside, place[rows[inside]]))
        return result

    def cell_pressure(self, y: FloatArray) -> FloatArray:
        """Pressure in the middle of each cell of the body, shape (m,), Pa."""
        values = y[self.cell_pressures]
        if values.shape[1] == 1:
            return values[:, 0]
        middle = values @ self._middle
        return middle.reshape(-1, self.pair.children).mean(axis=1)

    def pressures_of(self, pressure: FloatArray | float) -> FloatArray:
        """Pressures of all cells' values, shape (m,) or one number; at nodes the means of cells."""
        cells = np.broadcast_to(pressure, self.body.cell_count)
        places = self.cell_pressures - self.pressures.start
        values = np.broadcast_to(np.repeat(cells, self.pair.children)[:, None], places.shape)
        return sums_at(places, values) / np.bincount(places.ravel())

    @cached_property
    def _middle(self) -> FloatArray:
        """Values of the pressure's shape functions in the middle of the master element."""
        cell = basix.CellType[self.pair.shape]
        element = pressure_element(self.pair).basix_element
        middle = np.asarray(basix.geometry(cell)).mean(axis=0)[None]
        return np.asarray(element.tabulate(0, middle))[0, 0, :, 0]

    def cells_of_stuck_pressures(self, held: IntArray) -> IntArray:
        """Cells of the body with a pressure around which every displacement is held.

        Parameters
        ----------
        held : points whose displacement is prescribed.
        """
        free = np.ones(self.point_count, dtype=bool)
        free[held] = False
        cell_is_free = free[self.points_of(self.pair.shape, self.cells)].any(axis=1)
        determined = np.unique(self.cell_pressures[cell_is_free])
        stuck = ~np.isin(self.cell_pressures, determined).all(axis=1)
        return np.unique(np.flatnonzero(stuck) // self.pair.children)


def pressure_element(pair: Pair) -> basix.ufl._BasixElement:
    """Element of the pressure."""
    family, degree = pair.pressure
    discontinuous = family != "Lagrange"
    return basix.ufl.element(family, pair.shape, degree, discontinuous=discontinuous)
