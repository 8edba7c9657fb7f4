"""Where forms are integrated: the cells of a body, and the faces of its surfaces.

A domain is a DOLFINx mesh of its cells alone, on this process alone, with the space of its unknowns
and our number of each of its dofs. A system is a sum over domains (`blocks`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import basix.ufl
import numpy as np
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI

from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.fenicsx.numbering import Numbering, pressure_element
from dolfin_tongue.fenicsx.pairs import TENSOR_ORDER


@dataclass(frozen=True, eq=False)
class Domain:
    """Cells of one kind, or faces.

    Parameters
    ----------
    numbering : our numbers.
    mesh : the DOLFINx mesh.
    space : of its unknowns: (u, p), or u on a surface.
    dofs : ndarray -- our number of each dof of the space.
    points : ndarray, shape (cells, k) -- our points of each DOLFINx cell.
    owners : ndarray -- cell of the body to which each DOLFINx cell belongs.
    surface : name of the surface; None for the volume.
    """

    numbering: Numbering
    mesh: mesh.Mesh
    space: fem.FunctionSpace
    dofs: IntArray
    points: IntArray
    owners: IntArray
    surface: str | None = None

    @cached_property
    def dx(self) -> ufl.Measure:
        """Measure of the domain with the rule of the pair."""
        degree = self.numbering.pair.quadrature_degree
        return ufl.Measure("dx", self.mesh, metadata={"quadrature_degree": degree})

    @property
    def cell(self) -> str:
        """Basix' name of its cells."""
        return str(self.mesh.topology.cell_name())

    def coefficient(self, values: FloatArray) -> fem.Function:
        """Cell-wise constant function of values of the body's cells, shape (m,) or (m, k)."""
        shape = values.shape[1:]
        element = basix.ufl.element("DG", self.cell, 0, shape=shape)
        function = fem.Function(fem.functionspace(self.mesh, element))
        self.set_coefficient(function, values)
        return function

    def set_coefficient(self, function: fem.Function, values: FloatArray) -> None:
        """Write values of the body's cells, shape (m,) or (m, k), into a cell function."""
        components = values.shape[1] if values.ndim > 1 else 1
        ordered = values.reshape(len(values), components)[self.owners]
        function.x.array.reshape(-1, components)[function.function_space.dofmap.list[:, 0]] = (
            ordered
        )


def volume_domain(numbering: Numbering) -> Domain:
    """Return all cells of a body."""
    pair, corners = numbering.pair, numbering.cells
    grid = _mesh(pair.shape, corners, numbering.body.points)
    vector = basix.ufl.element("Lagrange", pair.shape, pair.degree, shape=(3,))
    mixed = basix.ufl.mixed_element([vector, pressure_element(pair)])
    space = fem.functionspace(grid, mixed)
    order = np.asarray(grid.topology.original_cell_index, dtype=np.intp)
    points = numbering.points_of(pair.shape, corners[order])
    dofs = np.empty(space.dofmap.index_map.size_local, dtype=np.intp)
    _number(dofs, space.sub(0), 3 * points[:, :, None] + np.arange(3))
    _number(dofs, space.sub(1), numbering.cell_pressures[order][:, :, None])
    return Domain(numbering, grid, space, dofs, points, order // pair.children)


def surface_domain(numbering: Numbering, surface: str) -> Domain:
    """Return the faces of a named surface of a body."""
    pair, body = numbering.pair, numbering.body
    faces = pair.faces(body, surface)
    corners = faces[:, TENSOR_ORDER[pair.face]]
    grid = _mesh(pair.face, corners, body.points)
    space = fem.functionspace(grid, ("Lagrange", pair.degree, (3,)))
    order = np.asarray(grid.topology.original_cell_index, dtype=np.intp)
    points = numbering.points_of(pair.face, corners[order])
    dofs = np.empty(3 * space.dofmap.index_map.size_local, dtype=np.intp)
    dofs.reshape(-1, 3)[space.dofmap.list] = 3 * points[:, :, None] + np.arange(3)
    owners = pair.owners(body, surface)[order]
    return Domain(numbering, grid, space, dofs, points, owners, surface)


def _mesh(shape: str, corners: IntArray, points: FloatArray) -> mesh.Mesh:
    """Mesh of some cells; nodes that none of them has are left out."""
    used, local = np.unique(corners, return_inverse=True)
    coordinates = basix.ufl.element("Lagrange", shape, 1, shape=(3,))
    return mesh.create_mesh(MPI.COMM_SELF, local.reshape(corners.shape), points[used], coordinates)


def _number(dofs: IntArray, part: fem.FunctionSpace, numbers: IntArray) -> None:
    """Write our numbers of a part of a mixed space; (cells, dofs of the element, components)."""
    collapsed, to_mixed = part.collapse()
    table = np.asarray(to_mixed, dtype=np.intp).reshape(-1, numbers.shape[2])
    dofs[table[collapsed.dofmap.list]] = numbers
