"""A body: points, cells, named regions, density and fibres. Plain arrays, no solver."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from dolfin_tongue.base.arrays import FloatArray, IntArray, real_numbers
from dolfin_tongue.base.errors import BadMesh, UnknownName
from dolfin_tongue.base.values import Value, require_positive_values
from dolfin_tongue.body import checks
from dolfin_tongue.body.block import Block, blocks_of
from dolfin_tongue.body.faces import BOUNDARY, as_surface, outer_faces, owners_of
from dolfin_tongue.body.fibres import Fibres
from dolfin_tongue.body.regions import on_cells

#: Mass density of tongue tissue, kg/m3 (as in Buchaillard et al. 2009).
TISSUE_DENSITY = 1040.0


@dataclass(frozen=True)
class Body:
    """A meshed body in its reference configuration.

    Parameters
    ----------
    points : ndarray, shape (n, 3), m.
    cells : ndarray, shape (m, 8) -- node numbers of 8-node hexahedra in the usual brick (VTK, gmsh)
        order: 0-3 bottom counter-clockwise, 4-7 above them. Or a mapping from kinds of cells
        (`cells.KINDS`) to such arrays; cells are numbered through in its order.
    node_sets : named regions of nodes, each ndarray of node numbers: attachments, landmark lines.
    landmarks : named single nodes, e.g. ``{"tip": 12}``.
    density : mass density rho_0, kg/m3; see `base.values` for what it may be.
    fibres : the muscles.
    name : for messages and file names.
    surfaces : named parts of the boundary, each ndarray of shape (k, 4): quadrilaterals as node
        numbers, outward by the right-hand rule; -1 as the fourth makes a triangle.
        ``"boundary"`` is always known: all outer faces.
    cell_sets : named regions of cells, each ndarray of cell numbers. A muscle is one too.

    Raises
    ------
    BadMesh : wrong shapes, NaN coordinates, cells that name missing nodes, inverted cells (listed),
        surfaces that are empty, inside the body or point inward (listed).
    OutOfRange : density not finite or <= 0.
    UnknownName : a kind of cells that does not exist, a density of an unknown region.
    """

    points: FloatArray
    cells: IntArray | Mapping[str, IntArray]
    node_sets: Mapping[str, IntArray] = field(default_factory=dict)
    landmarks: Mapping[str, int] = field(default_factory=dict)
    density: Value = TISSUE_DENSITY
    fibres: Fibres = field(default_factory=Fibres)
    name: str = "body"
    surfaces: Mapping[str, IntArray] = field(default_factory=dict)
    cell_sets: Mapping[str, IntArray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        require_positive_values(self, "kg/m3", density=self.density)
        for name, value in (
            ("points", real_numbers(f"{self.name}: points", self.points)),
            ("cells", checks.as_cells(self.name, self.cells)),
            ("node_sets", checks.as_sets(self.name, "region", self.node_sets)),
            ("cell_sets", checks.as_sets(self.name, "cell set", self.cell_sets)),
            ("landmarks", checks.as_landmarks(self.name, self.landmarks)),
        ):
            object.__setattr__(self, name, value)
        checks.check_points(self.name, self.points)
        checks.check_cells(self.name, self.points, self.cells_by_kind)
        checks.check_inverted(self.name, self.blocks)
        marks = {name: np.array([node]) for name, node in self.landmarks.items()}
        checks.check_sets(self.name, "region", {**self.node_sets, **marks}, len(self.points))
        checks.check_sets(self.name, "cell set", self.cell_sets, self.cell_count)
        checks.check_muscles(self.name, self.fibres, self.cell_sets, self.cell_count)
        self._check_surfaces()
        on_cells(f"{self.name}: density", self.density, self)

    def _check_surfaces(self) -> None:
        if BOUNDARY in self.surfaces:
            raise BadMesh(
                f"{self.name}: the surface name {BOUNDARY!r} is taken by all outer faces; choose "
                "another one"
            )
        surfaces = {
            name: as_surface(f"{self.name}: the surface {name!r}", np.asarray(x), self.boundary)
            for name, x in self.surfaces.items()
        }
        object.__setattr__(self, "surfaces", surfaces)

    # -- cells -------------------------------------------------------------------------------------

    @property
    def cells_by_kind(self) -> Mapping[str, IntArray]:
        """Node numbers of the cells of each kind, shape (m, k)."""
        return self.cells if isinstance(self.cells, Mapping) else {"hexahedron8": self.cells}

    @cached_property
    def blocks(self) -> tuple[Block, ...]:
        """Cells by kind."""
        return blocks_of(self.points, self.cells_by_kind)

    @cached_property
    def cell_count(self) -> int:
        """Number of cells of all kinds, m."""
        return sum(len(block.cells) for block in self.blocks)

    @property
    def hexahedra(self) -> IntArray:
        """Cells of a body that has 8-node hexahedra only, shape (m, 8); BadMesh for others."""
        if set(self.cells_by_kind) != {"hexahedron8"}:
            raise BadMesh(
                f"{self.name} is made of {', '.join(self.cells_by_kind)}; only hexahedron8 can be "
                "used here"
            )
        return self.blocks[0].cells

    @cached_property
    def point_counts(self) -> IntArray:
        """Number of quadrature points of every cell, shape (m,)."""
        return np.concatenate([np.full(*block.shape) for block in self.blocks])

    @property
    def quadrature_points(self) -> FloatArray:
        """Reference positions of the quadrature points, shape (m, q, 3), m.

        Values of arrays over quadrature points belong to these. One kind of cells only.
        """
        if len(self.blocks) > 1:
            raise BadMesh(f"{self.name} has several kinds of cells; see Body.blocks[i].places")
        return self.blocks[0].places

    # -- names -------------------------------------------------------------------------------------

    def nodes(self, region: str) -> IntArray:
        """Node numbers of a region; UnknownName lists the known ones."""
        if region not in self.node_sets:
            raise UnknownName("region", region, self.node_sets)
        return self.node_sets[region]

    def landmark(self, name: str) -> int:
        """Node number of a landmark; UnknownName lists the known ones."""
        if name not in self.landmarks:
            raise UnknownName("landmark", name, self.landmarks)
        return int(self.landmarks[name])

    def surface(self, name: str) -> IntArray:
        """Faces of a surface, shape (k, 4); UnknownName lists the known ones."""
        if name == BOUNDARY:
            return self.boundary
        if name not in self.surfaces:
            raise UnknownName("surface", name, (*self.surfaces, BOUNDARY))
        return self.surfaces[name]

    def region_cells(self, name: str) -> IntArray:
        """Cells of a cell set or of a muscle; UnknownName lists the known ones."""
        if name in self.cell_sets:
            return self.cell_sets[name]
        if name in self.fibres.names:
            return self.fibres[name].cells
        raise UnknownName("region of cells", name, (*self.cell_sets, *self.fibres.names))

    # -- geometry ----------------------------------------------------------------------------------

    @cached_property
    def _outer_faces(self) -> tuple[IntArray, IntArray]:
        return outer_faces(self.cells_by_kind)

    @property
    def boundary(self) -> IntArray:
        """All outer faces, shape (k, 4): node numbers, outward by the right-hand rule."""
        return self._outer_faces[0]

    def owners(self, faces: IntArray) -> IntArray:
        """Return the cell of each of some outer faces, shape (k,)."""
        return owners_of(faces, *self._outer_faces)

    @cached_property
    def volumes(self) -> FloatArray:
        """Reference volume of every cell, ndarray of shape (m,), m3 (exact)."""
        return np.concatenate([block.weights.sum(axis=1) for block in self.blocks])

    @cached_property
    def scaled_jacobians(self) -> FloatArray:
        """Smallest corner Jacobian of each cell over its edge lengths, shape (m,); 1 is a brick."""
        return np.concatenate([block.scaled_jacobians.min(axis=1) for block in self.blocks])

    @cached_property
    def mass(self) -> float:
        """Mass, kg."""
        density = on_cells("density", self.density, self)
        parts = [density.part(block.numbers).array * block.weights for block in self.blocks]
        return float(sum(part.sum() for part in parts))
