"""A body: points, cells, named regions, density and fibres. Plain arrays, no solver."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from dolfin_tongue.base.arrays import FloatArray, IntArray, real_numbers, whole_numbers
from dolfin_tongue.base.errors import BadMesh, UnknownName, listing, require_positive
from dolfin_tongue.body.faces import BOUNDARY, check_surface, outer_faces
from dolfin_tongue.body.fibres import Fibres
from dolfin_tongue.body.shape import FACES, corner_jacobians, gauss_jacobians

#: Length beyond which coordinates are taken for millimetres, m.
LARGEST_SIZE = 5.0

#: Mass density of tongue tissue, kg/m3 (as in Buchaillard et al. 2009).
TISSUE_DENSITY = 1040.0


@dataclass(frozen=True)
class Body:
    """A meshed body in its reference configuration.

    Parameters
    ----------
    points : ndarray, shape (n, 3), m.
    cells : ndarray, shape (m, 8) -- node numbers of 8-node hexahedra in the usual brick (VTK, gmsh)
        order: 0-3 bottom counter-clockwise, 4-7 above them.
    node_sets : named regions of nodes, each ndarray of node numbers: attachments, landmark lines.
    landmarks : named single nodes, e.g. ``{"tip": 12}``.
    density : mass density rho_0, kg/m3.
    fibres : the muscles.
    name : for messages and file names.
    surfaces : named parts of the boundary, each ndarray of shape (k, 4): quadrilaterals as node
        numbers, outward by the right-hand rule. ``"boundary"`` is always known: all outer faces.

    Raises
    ------
    BadMesh : wrong shapes, NaN coordinates, cells that name missing nodes, inverted cells (listed),
        surfaces that are empty, inside the body or point inward (listed).
    OutOfRange : density not finite or <= 0.
    """

    points: FloatArray
    cells: IntArray
    node_sets: Mapping[str, IntArray] = field(default_factory=dict)
    landmarks: Mapping[str, int] = field(default_factory=dict)
    density: float = TISSUE_DENSITY
    fibres: Fibres = field(default_factory=Fibres)
    name: str = "body"
    surfaces: Mapping[str, IntArray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        require_positive(self, "kg/m3", density=self.density)
        self._convert()
        self._check_arrays()
        self._check_names()
        inverted = np.flatnonzero(~(gauss_jacobians(self.points, self.cells).min(axis=1) > 0))
        if inverted.size:
            raise BadMesh(
                f"{self.name}: {inverted.size} inverted cell(s) (Jacobian <= 0 at a quadrature "
                f"point): {listing(inverted)}. Check the node order (0-3 bottom "
                "counter-clockwise, 4-7 above) and the node coordinates"
            )
        self._check_surfaces()

    def _convert(self) -> None:
        """Take lists and whole numbers of any kind; refuse what only looks like them."""
        sets = {
            name: np.atleast_1d(whole_numbers(f"{self.name}: the region {name!r}", nodes))
            for name, nodes in self.node_sets.items()
        }
        marks = {
            name: int(np.squeeze(whole_numbers(f"{self.name}: the landmark {name!r}", [node])))
            for name, node in self.landmarks.items()
            if np.ndim(node) == 0
        }
        if several := set(self.landmarks) - set(marks):
            raise BadMesh(f"{self.name}: landmark(s) {listing(several)} must be one node each")
        for name, value in (
            ("points", real_numbers(f"{self.name}: points", self.points)),
            ("cells", whole_numbers(f"{self.name}: cells", self.cells)),
            ("node_sets", sets),
            ("landmarks", marks),
        ):
            object.__setattr__(self, name, value)

    def _check_arrays(self) -> None:
        if self.points.ndim != 2 or self.points.shape[1] != 3:
            raise BadMesh(f"{self.name}: points must have shape (n, 3), not {self.points.shape}")
        if self.cells.ndim != 2 or self.cells.shape[1] != 8 or not len(self.cells):
            raise BadMesh(f"{self.name}: cells must have shape (m, 8), not {self.cells.shape}")
        bad = np.flatnonzero(~np.isfinite(self.points).all(axis=1))
        if bad.size:
            raise BadMesh(f"{self.name}: coordinates of node(s) {listing(bad)} are not finite")
        size = np.ptp(self.points, axis=0).max()
        if size > LARGEST_SIZE:
            raise BadMesh(
                f"{self.name}: it is {size:.3g} m long; coordinates are metres: multiply by 1e-3 "
                "if yours are millimetres"
            )
        self._check_cells()

    def _check_cells(self) -> None:
        used = np.unique(self.cells)
        if used[0] < 0 or used[-1] >= len(self.points):
            raise BadMesh(
                f"{self.name}: cells name nodes {used[0]} to {used[-1]}, but there are "
                f"{len(self.points)} points (numbers 0 to {len(self.points) - 1})"
            )
        if len(used) != len(self.points):
            unused = np.setdiff1d(np.arange(len(self.points)), used)
            raise BadMesh(f"{self.name}: node(s) {listing(unused)} belong to no cell")
        ordered = np.sort(self.cells, axis=1)
        twice = np.flatnonzero((np.diff(ordered, axis=1) == 0).any(axis=1))
        if twice.size:
            raise BadMesh(f"{self.name}: cell(s) {listing(twice)} name a node twice")
        _, first, count = np.unique(ordered, axis=0, return_index=True, return_counts=True)
        if (count > 1).any():
            raise BadMesh(f"{self.name}: cell(s) {listing(first[count > 1])} are listed twice")
        faces = np.sort(self.cells[:, FACES].reshape(-1, 4), axis=1)
        _, first, count = np.unique(faces, axis=0, return_index=True, return_counts=True)
        if (count > 2).any():
            owners = first[count > 2] // len(FACES)
            raise BadMesh(
                f"{self.name}: a face of cell(s) {listing(np.unique(owners))} belongs to more than "
                "two cells: cells overlap"
            )

    def _check_names(self) -> None:
        points = {name: np.array([node]) for name, node in self.landmarks.items()}
        for name, nodes in {**self.node_sets, **points}.items():
            if not nodes.size:
                raise BadMesh(f"{self.name}: the region {name!r} is empty")
            if nodes.min() < 0 or nodes.max() >= len(self.points):
                raise BadMesh(f"{self.name}: the region {name!r} names a node that does not exist")
        for muscle in self.fibres.muscles:
            if muscle.cells.size and not 0 <= muscle.cells.min() <= muscle.cells.max() < len(
                self.cells
            ):
                raise BadMesh(f"{self.name}: muscle {muscle.name!r} names a cell that is not there")

    def _check_surfaces(self) -> None:
        if BOUNDARY in self.surfaces:
            raise BadMesh(
                f"{self.name}: the surface name {BOUNDARY!r} is taken by all outer faces; choose "
                "another one"
            )
        for name, faces in self.surfaces.items():
            check_surface(f"{self.name}: the surface {name!r}", np.asarray(faces), self.boundary)

    def nodes(self, region: str) -> IntArray:
        """Node numbers of a region; UnknownName lists the known ones."""
        if region not in self.node_sets:
            raise UnknownName("region", region, self.node_sets)
        return np.asarray(self.node_sets[region], dtype=np.int64)

    def landmark(self, name: str) -> int:
        """Node number of a landmark; UnknownName lists the known ones."""
        if name not in self.landmarks:
            raise UnknownName("landmark", name, self.landmarks)
        return int(self.landmarks[name])

    def surface(self, name: str) -> IntArray:
        """Quadrilaterals of a surface, shape (k, 4); UnknownName lists the known ones."""
        if name == BOUNDARY:
            return self.boundary
        if name not in self.surfaces:
            raise UnknownName("surface", name, (*self.surfaces, BOUNDARY))
        return np.asarray(self.surfaces[name], dtype=np.int64)

    @cached_property
    def boundary(self) -> IntArray:
        """All outer faces, shape (k, 4): node numbers, outward by the right-hand rule."""
        return outer_faces(np.asarray(self.cells, dtype=np.int64))[0]

    @cached_property
    def volumes(self) -> FloatArray:
        """Reference volume of every cell, ndarray of shape (m,), m3 (2x2x2 Gauss points, exact)."""
        return gauss_jacobians(self.points, self.cells).sum(axis=1)

    @cached_property
    def scaled_jacobians(self) -> FloatArray:
        """Smallest corner Jacobian of each cell over its edge lengths, shape (m,); 1 is a brick."""
        return corner_jacobians(self.points, self.cells).min(axis=1)

    @cached_property
    def mass(self) -> float:
        """Mass, kg."""
        return float(self.density * self.volumes.sum())
