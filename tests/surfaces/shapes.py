"""Triangulated bodies of known distance."""

import numpy as np
from scipy.spatial import ConvexHull

from dolfin_tongue.surfaces.nearest import tree_of
from dolfin_tongue.surfaces.samples import signed_distance

#: Corners of a cube of edge 2, and its triangles, outward.
CORNERS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])


def hull(points):
    """Triangles of a convex hull, outward."""
    triangles = ConvexHull(points).simplices.astype(np.int64)
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    outward = (np.cross(b - a, c - a) * (a + b + c - 3 * points.mean(axis=0))).sum(axis=1) > 0
    return np.where(outward[:, None], triangles, triangles[:, ::-1])


def ball(count, radius=0.03):
    """A sphere with `count` points, evenly spread."""
    k = np.arange(count) + 0.5
    polar, turn = np.arccos(1 - 2 * k / count), np.pi * (1 + 5**0.5) * k
    points = radius * np.stack(
        [np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)], axis=1
    )
    return points, hull(points)


def cube(half=0.01):
    """A cube of edge 2 half, 12 triangles."""
    return half * CORNERS, hull(CORNERS)


def cube_distance(points, half=0.01):
    """Signed distance from the cube."""
    beyond = np.abs(points) - half
    outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
    return outside + np.minimum(beyond.max(axis=1), 0.0)


def sheet(size=0.04, count=9, height=lambda x, y: 0 * x):
    """A square sheet z = height(x, y) around the origin whose normals point up."""
    line = np.linspace(-size / 2, size / 2, count)
    x, y = (grid.ravel() for grid in np.meshgrid(line, line, indexing="ij"))
    i, j = (grid.ravel() for grid in np.meshgrid(*[np.arange(count - 1)] * 2, indexing="ij"))
    corner = i * count + j
    lower = np.stack([corner, corner + count, corner + count + 1], axis=1)
    upper = np.stack([corner, corner + count + 1, corner + 1], axis=1)
    return np.stack([x, y, height(x, y)], axis=1), np.concatenate([lower, upper])


def exact(points, triangles, places):
    """Signed distance of places from triangles, and whether they are not beyond a rim."""
    return signed_distance(points, triangles, tree_of(points[triangles]), places)
