"""From a body to DOLFINx: mesh, mixed space, and the numbering in between.

DOLFINx renumbers nodes and cells. All arrays outside this file are in the order of the body.
"""

from __future__ import annotations

from dataclasses import dataclass

import basix.ufl
import numpy as np
from dolfinx import fem, mesh
from mpi4py import MPI

from dolfin_tongue.arrays import FloatArray, IntArray
from dolfin_tongue.body import Body

#: From the brick (VTK) order of hexahedron nodes to the tensor-product order of basix.
TENSOR_ORDER = np.array([0, 1, 3, 2, 4, 5, 7, 6])


@dataclass(frozen=True, eq=False)
class MixedSpace:
    """Trilinear displacement and cell-wise constant pressure (Q1/P0) on a body.

    One process holds the whole mesh: the models are small, and studies run many of them.

    Parameters
    ----------
    body : the body.
    mesh : its DOLFINx mesh.
    space : the mixed function space, unknown y = (u, p).
    displacement_dofs : ndarray, shape (n, 3) -- dofs of node k of the body.
    pressure_dofs : ndarray, shape (m,) -- dof of cell k of the body.
    cell_order : ndarray, shape (m,) -- number in the body of each DOLFINx cell.
    """

    body: Body
    mesh: mesh.Mesh
    space: fem.FunctionSpace
    displacement_dofs: IntArray
    pressure_dofs: IntArray
    cell_order: IntArray

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.space.dofmap.index_map.size_local * self.space.dofmap.index_map_bs


def mixed_space(body: Body) -> MixedSpace:
    """Build mesh and space of a body."""
    coordinate_element = basix.ufl.element("Lagrange", "hexahedron", 1, shape=(3,))
    grid = mesh.create_mesh(
        MPI.COMM_SELF, body.cells[:, TENSOR_ORDER], body.points, coordinate_element
    )
    displacement = basix.ufl.element("Lagrange", "hexahedron", 1, shape=(3,))
    pressure = basix.ufl.element("DG", "hexahedron", 0)
    space = fem.functionspace(grid, basix.ufl.mixed_element([displacement, pressure]))
    cell_order = np.asarray(grid.topology.original_cell_index, dtype=np.int64)
    return MixedSpace(
        body,
        grid,
        space,
        _displacement_dofs(body, space, cell_order),
        _pressure_dofs(space, cell_order),
        cell_order,
    )


def _displacement_dofs(body: Body, space: fem.FunctionSpace, cell_order: IntArray) -> IntArray:
    """Dofs of the nodes, shape (n, 3): local vertex k of a cell carries local dof k."""
    part, to_mixed = space.sub(0).collapse()
    blocks = part.dofmap.list  # (m, 8), in units of three dofs
    dofs = np.empty((len(body.points), 3), dtype=np.int64)
    nodes = body.cells[cell_order][:, TENSOR_ORDER]
    for component in range(3):
        dofs[nodes, component] = np.asarray(to_mixed)[3 * blocks + component]
    return dofs


def _pressure_dofs(space: fem.FunctionSpace, cell_order: IntArray) -> IntArray:
    """Dof of each cell's pressure, shape (m,)."""
    part, to_mixed = space.sub(1).collapse()
    dofs = np.empty(len(cell_order), dtype=np.int64)
    dofs[cell_order] = np.asarray(to_mixed)[part.dofmap.list[:, 0]]
    return dofs


def cell_function(grid: mesh.Mesh, components: int) -> fem.Function:
    """Cell-wise constant function with that many components (1: a scalar)."""
    shape = (components,) if components > 1 else ()
    element = basix.ufl.element("DG", "hexahedron", 0, shape=shape)
    return fem.Function(fem.functionspace(grid, element))


def set_cell_values(function: fem.Function, values: FloatArray, cell_order: IntArray) -> None:
    """Write values of shape (m,) or (m, k), in the body's order, into a cell function."""
    components = values.size // len(cell_order)
    ordered = values.reshape(len(cell_order), components)[cell_order]
    function.x.array.reshape(-1, components)[function.function_space.dofmap.list[:, 0]] = ordered
