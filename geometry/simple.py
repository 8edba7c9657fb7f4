"""Boxes of hexahedra with named faces: bodies for tests and for comparison with other programs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.base.errors import BadMesh, OutOfRange
from dolfin_tongue.body.body import TISSUE_DENSITY, Body
from dolfin_tongue.body.cells import BRICK_FACES
from dolfin_tongue.body.faces import faces_between, outer_faces
from dolfin_tongue.body.fibres import Fibres, MuscleFibres


def brick_cells(cells: Sequence[int]) -> IntArray:
    """Node numbers of a regular grid of hexahedra; nodes are numbered with x fastest.

    Parameters
    ----------
    cells : number of cells along x, y and z.

    Returns
    -------
    ndarray, shape (nx ny nz, 8) -- VTK order; cells too are numbered with x fastest.
    """
    nx, ny, nz = cells
    k, j, i = np.meshgrid(np.arange(nz), np.arange(ny), np.arange(nx), indexing="ij")
    first = (i + (nx + 1) * (j + (ny + 1) * k)).ravel()
    up = (nx + 1) * (ny + 1)
    bottom = np.array([0, 1, nx + 2, nx + 1])
    return first[:, None] + np.concatenate([bottom, bottom + up])


def block_body(
    size: Sequence[float] = (0.04, 0.02, 0.01),
    cells: Sequence[int] = (4, 2, 2),
    *,
    muscles: Mapping[str, ArrayLike] | None = None,
    density: float = TISSUE_DENSITY,
    name: str = "block",
) -> Body:
    """Build a box with one corner at the origin, cut into equal hexahedra.

    Parameters
    ----------
    size : edge lengths along x, y and z, m.
    cells : number of cells along x, y and z.
    muscles : muscle name -> fibre direction, shape (3,), of any length > 0; the muscle fills all
        cells with fibre density 1.
    density : mass density, kg/m3.
    name : name of the body.

    Returns
    -------
    Body
        Node sets and surfaces ``x0, x1, y0, y1, z0, z1`` are the faces at the lower and upper end
        of each axis;
        landmark ``end`` is the node of ``x1`` nearest to the centre of that face.

    Raises
    ------
    OutOfRange : an edge length <= 0 or fewer than one cell.
    BadMesh : a muscle direction of length zero or of a wrong shape.
    """
    extent, counts = np.asarray(size, dtype=float), tuple(int(count) for count in cells)
    if extent.shape != (3,) or not (extent > 0).all():
        raise OutOfRange("size", size, "three lengths > 0", "m")
    if len(counts) != 3 or min(counts) < 1:
        raise OutOfRange("cells", cells, "three numbers >= 1")
    x, y, z = (np.linspace(0.0, extent[i], counts[i] + 1) for i in range(3))
    grid_z, grid_y, grid_x = np.meshgrid(z, y, x, indexing="ij")
    points = np.stack([grid_x, grid_y, grid_z], axis=-1).reshape(-1, 3)
    node_sets = {
        f"{axis}{end}": np.flatnonzero(points[:, i] == end * extent[i])
        for i, axis in enumerate("xyz")
        for end in (0, 1)
    }
    centre = extent * [1.0, 0.5, 0.5]
    end = int(np.linalg.norm(points - centre, axis=1).argmin())
    fibres = Fibres(
        tuple(
            _uniform(muscle, direction, int(np.prod(counts)))
            for muscle, direction in (muscles or {}).items()
        )
    )
    cells_of_block = brick_cells(counts)
    outer, _ = outer_faces(cells_of_block)
    surfaces = {side: faces_between(outer, nodes) for side, nodes in node_sets.items()}
    return Body(points, cells_of_block, node_sets, {"end": end}, density, fibres, name, surfaces)


def ball_body(
    radius: float = 0.01, cells: int = 2, *, density: float = 1000.0, name: str = "ball"
) -> Body:
    """Build a ball of a rounded cube and layers of hexahedra around it, all of good shape.

    Parameters
    ----------
    radius : of the sphere on which the outer nodes lie, m.
    cells : number of cells along each edge of the cube; half as many layers around it.
    density : mass density, kg/m3.
    name : name of the body.

    Returns
    -------
    Body
        Centred at the origin. cells = 2, 4, 6 makes 32, 256, 864 hexahedra.

    Raises
    ------
    OutOfRange : radius <= 0 or fewer than one cell.
    """
    if not 0 < radius < np.inf:
        raise OutOfRange("radius", radius, "finite and > 0", "m")
    if int(cells) < 1:
        raise OutOfRange("cells", cells, ">= 1")
    line = np.tan(np.linspace(-np.pi / 4, np.pi / 4, int(cells) + 1))  # equal angles
    cube = np.stack(np.meshgrid(line, line, line, indexing="ij"), axis=-1)
    cube = cube.transpose(2, 1, 0, 3).reshape(-1, 3)
    length = np.maximum(np.linalg.norm(cube, axis=1, keepdims=True), 1e-300)
    round_cube = cube * np.abs(cube).max(axis=1, keepdims=True) / length
    inner = radius * (0.25 * cube + 0.3 * round_cube)
    blocks = [brick_cells((int(cells),) * 3)]
    faces, _ = outer_faces(blocks[0])
    skin = np.unique(faces)
    count, layers = len(cube), max(1, int(cells) // 2)
    points, below = [inner], faces
    for layer in range(1, layers + 1):
        share = layer / layers
        points.append((1 - share) * inner[skin] + share * radius * (cube / length)[skin])
        above = np.searchsorted(skin, faces) + count + (layer - 1) * len(skin)
        blocks.append(np.concatenate([below, above], axis=1))
        below = above
    return Body(np.concatenate(points), np.concatenate(blocks), density=density, name=name)


def _uniform(name: str, direction: ArrayLike, cell_count: int) -> MuscleFibres:
    """Parallel fibres of density 1 in all cells."""
    vector = np.asarray(direction, dtype=float)
    length = np.linalg.norm(vector)
    if vector.shape != (3,) or not (0 < length < np.inf):
        raise BadMesh(f"muscle {name!r}: the direction must be a vector (3,) of length > 0")
    directions = np.tile(vector / length, (cell_count, 1))
    return MuscleFibres(name, np.arange(cell_count), directions, np.ones(cell_count))


def surface_nodes(body: Body) -> IntArray:
    """Nodes of faces that belong to one cell only, sorted."""
    return np.setdiff1d(body.boundary, [-1])  # -1 stands for the fourth node of a triangle


def distort(body: Body, amplitude: float = 0.2, seed: int = 0) -> Body:
    """Move the interior nodes of a body at random; its surface stays.

    Parameters
    ----------
    body : any body.
    amplitude : largest displacement per axis over the shortest edge of the mesh, in [0, 0.5).
    seed : of the random numbers.

    Returns
    -------
    Body
        A copy with other coordinates; fibres are not changed.

    Raises
    ------
    OutOfRange : amplitude outside [0, 0.5).
    """
    if not 0 <= amplitude < 0.5:
        raise OutOfRange("amplitude", amplitude, "in [0, 0.5)")
    inside = np.setdiff1d(np.arange(len(body.points)), surface_nodes(body))
    points = body.points.copy()
    step = amplitude * _shortest_edge(body)
    points[inside] += step * np.random.default_rng(seed).uniform(-1.0, 1.0, (len(inside), 3))
    return replace(body, points=points)


def _shortest_edge(body: Body) -> float:
    """Length of the shortest cell edge, m."""
    corners: FloatArray = body.points[body.hexahedra[:, BRICK_FACES]]
    return float(np.linalg.norm(corners - np.roll(corners, 1, axis=2), axis=-1).min())
