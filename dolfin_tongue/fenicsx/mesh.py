"""From a body to DOLFINx: mesh, mixed space, and the numbering in between.

DOLFINx renumbers nodes and cells. All arrays outside this file are in the order of the body.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import basix
import basix.ufl
import numpy as np
from dolfinx import fem, mesh
from mpi4py import MPI

from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.base.errors import BadMesh, UnknownName
from dolfin_tongue.body.body import Body
from dolfin_tongue.body.faces import row_places

#: From the brick (VTK) order of hexahedron nodes to the tensor-product order of basix.
TENSOR_ORDER = np.array([0, 1, 3, 2, 4, 5, 7, 6])

#: Kuhn's six tetrahedra of a brick, all along the diagonal from corner 0 to corner 6.
TETRAHEDRA = np.array(
    [[0, 1, 2, 6], [0, 2, 3, 6], [0, 3, 7, 6], [0, 7, 4, 6], [0, 4, 5, 6], [0, 5, 1, 6]]
)


@dataclass(frozen=True)
class Pair:
    """A pair of displacement and pressure spaces.

    Parameters
    ----------
    shape : cells of the mesh.
    degree : of the displacement, Lagrange.
    pressure : family and degree of the pressure.
    quadrature_degree : of all integrals.
    """

    shape: str
    degree: int
    pressure: tuple[str, int]
    quadrature_degree: int


#: The pairs by name. Q1/P0 is the report's: each cell keeps its mean volume, on 2x2x2 Gauss points.
#: The others are inf-sup stable and show what a mesh is worth: triquadratic with discontinuous
#: linear pressure, and Taylor-Hood on tetrahedra (each hexahedron is cut into six).
PAIRS = {
    "Q1/P0": Pair("hexahedron", 1, ("DG", 0), 3),
    "Q2/P1": Pair("hexahedron", 2, ("DPC", 1), 5),
    "P2/P1": Pair("tetrahedron", 2, ("Lagrange", 1), 4),
}


@dataclass(frozen=True, eq=False)
class MixedSpace:
    """A mixed displacement-pressure space on a body.

    One process holds the whole mesh: the models are small, and studies run many of them.

    Parameters
    ----------
    body : the body.
    pair : the spaces.
    mesh : the DOLFINx mesh.
    space : the mixed function space, unknown y = (u, p).
    parents : ndarray -- cell of the body in which each DOLFINx cell lies.
    """

    body: Body
    pair: Pair
    mesh: mesh.Mesh
    space: fem.FunctionSpace
    parents: IntArray

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.space.dofmap.index_map.size_local * self.space.dofmap.index_map_bs

    @cached_property
    def _displacement(self) -> tuple[fem.FunctionSpace, IntArray]:
        part, to_mixed = self.space.sub(0).collapse()
        return part, np.asarray(to_mixed, dtype=np.int64).reshape(-1, 3)

    @cached_property
    def nodal_only(self) -> bool:
        """Whether the displacement has its dofs at the nodes of the body and nowhere else."""
        return self.pair.degree == 1

    @cached_property
    def displacement_dofs(self) -> IntArray:
        """Dofs of the displacement at the nodes of the body, shape (n, 3)."""
        part, to_mixed = self._displacement
        vertices = self._vertices
        dofs = np.empty((len(self.body.points), 3), dtype=np.int64)
        dofs[vertices] = to_mixed[part.dofmap.list[:, : vertices.shape[1]]]
        return dofs

    @cached_property
    def all_displacement_dofs(self) -> IntArray:
        """All dofs of the displacement, shape (number of points, 3)."""
        return self._displacement[1]

    @cached_property
    def displacement_element(self) -> basix.finite_element.FiniteElement:
        """Scalar element of each component of the displacement."""
        return self._displacement[0].element.basix_element

    def cell_displacement_dofs(self, cells: IntArray) -> IntArray:
        """Displacement dofs of DOLFINx cells, shape (f, k, 3), in the order of the element."""
        part, to_mixed = self._displacement
        return to_mixed[part.dofmap.list[cells]]

    @cached_property
    def _vertices(self) -> IntArray:
        """Node of the body at each local vertex of each DOLFINx cell."""
        node_of = np.asarray(self.mesh.geometry.input_global_indices)
        return node_of[self.mesh.geometry.dofmap]

    @cached_property
    def pressure_dofs(self) -> IntArray:
        """All dofs of the pressure; for Q1/P0 the one of each cell of the body, shape (m,)."""
        part, to_mixed = self.space.sub(1).collapse()
        numbers = np.asarray(to_mixed, dtype=np.int64)
        if self.pair.pressure != ("DG", 0):
            return numbers
        dofs = np.empty(len(self.parents), dtype=np.int64)
        dofs[self.parents] = numbers[part.dofmap.list[:, 0]]
        return dofs

    def cell_pressure(self, mixed: FloatArray) -> FloatArray:
        """Pressure in the middle of each cell of the body, shape (m,), Pa."""
        if self.pair.pressure == ("DG", 0):
            return mixed[self.pressure_dofs]
        values = mixed[self._pressure_of_cells] @ self._pressure_in_the_middle
        total = np.bincount(self.parents, values, len(self.body.cells))
        return total / np.bincount(self.parents, minlength=len(self.body.cells))

    @cached_property
    def _pressure_of_cells(self) -> IntArray:
        part, to_mixed = self.space.sub(1).collapse()
        return np.asarray(to_mixed, dtype=np.int64)[part.dofmap.list]

    @cached_property
    def _pressure_in_the_middle(self) -> FloatArray:
        """Values of the pressure's shape functions in the middle of the master element."""
        element = self.space.sub(1).collapse()[0].element.basix_element
        middle = np.asarray(basix.geometry(element.cell_type)).mean(axis=0)[None]
        return element.tabulate(0, middle)[0, 0, :, 0]

    def facets(self, faces: IntArray) -> IntArray:
        """Facets of the mesh that lie in quadrilaterals of the body.

        Parameters
        ----------
        faces : ndarray, shape (k, 4) -- outer faces of the body, as node numbers.

        Returns
        -------
        ndarray, shape (f, 2) -- cell and local facet; each quadrilateral is one facet of a
        hexahedron or two of tetrahedra.
        """
        local = np.array(basix.topology(basix.CellType[self.pair.shape])[2])
        count = local.shape[1]
        corners = np.array(list(combinations(range(4), count)))
        wanted = np.unique(np.sort(faces[:, corners].reshape(-1, count), axis=1), axis=0)
        nodes = np.sort(self._vertices[:, local].reshape(-1, count), axis=1)
        number = np.flatnonzero(row_places(nodes, wanted) >= 0)
        return np.stack([number // len(local), number % len(local)], axis=1)

    def held(self, nodes: IntArray) -> list[tuple[IntArray, IntArray]]:
        """Dofs that follow held nodes.

        Parameters
        ----------
        nodes : ndarray, shape (k,) -- held nodes of the body.

        Returns
        -------
        list of (dofs, corners) -- arrays of shape (j, 3) and (j, c): each row of dofs moves with
        the mean of the c nodes, given as positions in `nodes`. Rows with c > 1 are the points of a
        quadratic displacement in the middle of an edge or face whose corners are all held.
        """
        place = np.full(len(self.body.points), -1)
        place[nodes] = np.arange(len(nodes))
        result = [(self.displacement_dofs[nodes], np.arange(len(nodes))[:, None])]
        if not self.nodal_only:
            result += [part for d in (1, 2) if len((part := self._held_between(d, place))[0])]
        return result

    def cells_of_stuck_pressures(self, held_dofs: IntArray) -> IntArray:
        """Cells of the body with a pressure dof around which every displacement dof is held."""
        part, to_mixed = self._displacement
        is_free: IntArray = np.logical_not(np.isin(to_mixed, held_dofs).all(axis=1))
        cell_is_free = is_free[part.dofmap.list].any(axis=1)
        pressures = self._pressure_of_cells
        free = np.unique(pressures[cell_is_free])
        return np.unique(self.parents[~np.isin(pressures, free).all(axis=1)])

    def _held_between(self, dimension: int, place: IntArray) -> tuple[IntArray, IntArray]:
        """Dofs inside edges (1) or faces (2) whose corners are all held, and these corners."""
        part, to_mixed = self._displacement
        cell = basix.CellType[self.pair.shape]
        local = part.element.basix_element.entity_dofs[dimension]
        vertices = place[self._vertices]
        dofs, corners = {}, {}
        for number, entity in enumerate(basix.topology(cell)[dimension]):
            if not local[number]:
                continue
            own = vertices[:, entity]
            for row in np.flatnonzero((own >= 0).all(axis=1)):
                key = int(part.dofmap.list[row, local[number][0]])
                dofs[key], corners[key] = to_mixed[key], own[row]
        count = len(basix.topology(cell)[dimension][0])
        rows = np.array(list(dofs.values())).reshape(-1, 3)
        return rows, np.array(list(corners.values())).reshape(-1, count)


def mixed_space(body: Body, pair: str = "Q1/P0") -> MixedSpace:
    """Build mesh and space of a body.

    Parameters
    ----------
    body : hexahedra.
    pair : name of the spaces; UnknownName lists the known ones.
    """
    if pair not in PAIRS:
        raise UnknownName("pair of spaces", pair, PAIRS)
    chosen = PAIRS[pair]
    cells = body.cells[:, TENSOR_ORDER] if chosen.shape == "hexahedron" else tetrahedra(body)
    coordinates = basix.ufl.element("Lagrange", chosen.shape, 1, shape=(3,))
    grid = mesh.create_mesh(MPI.COMM_SELF, cells, body.points, coordinates)
    displacement = basix.ufl.element("Lagrange", chosen.shape, chosen.degree, shape=(3,))
    family, degree = chosen.pressure
    discontinuous = family != "Lagrange"
    pressure = basix.ufl.element(family, chosen.shape, degree, discontinuous=discontinuous)
    space = fem.functionspace(grid, basix.ufl.mixed_element([displacement, pressure]))
    children = len(cells) // len(body.cells)
    parents = np.asarray(grid.topology.original_cell_index, dtype=np.int64) // children
    return MixedSpace(body, chosen, grid, space, parents)


def tetrahedra(body: Body) -> IntArray:
    """Cut every hexahedron into six tetrahedra, shape (6 m, 4).

    Raises
    ------
    BadMesh : neighbours would cut their common face along different diagonals; the cells must all
        be numbered alike, as in a block.
    """
    cells = body.cells[:, TETRAHEDRA].reshape(-1, 4)
    faces = np.sort(cells[:, [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]].reshape(-1, 3), axis=1)
    single = (np.unique(faces, axis=0, return_counts=True)[1] == 1).sum()
    if single != 2 * len(body.boundary):
        raise BadMesh(
            f"{body.name}: its hexahedra are not numbered alike, so that cutting them into "
            "tetrahedra does not fit together; use the pair Q2/P1"
        )
    return cells


def cell_function(grid: mesh.Mesh, components: int) -> fem.Function:
    """Cell-wise constant function with that many components (1: a scalar)."""
    shape = (components,) if components > 1 else ()
    element = basix.ufl.element("DG", grid.topology.cell_name(), 0, shape=shape)
    return fem.Function(fem.functionspace(grid, element))


def set_cell_values(function: fem.Function, values: FloatArray, parents: IntArray) -> None:
    """Write values of shape (m,) or (m, k), in the body's order, into a cell function."""
    components = values.shape[1] if values.ndim > 1 else 1
    ordered = values.reshape(len(values), components)[parents]
    function.x.array.reshape(-1, components)[function.function_space.dofmap.list[:, 0]] = ordered
