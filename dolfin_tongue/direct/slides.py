"""Nodes on surfaces, g(y) = 0 (49): constraints like the volumes, on elements of one node.

A sliding node is treated as a cell with one node, whose "volume" is s g with s = L^2 / |dg/dX| and
L the mean size of the cells. Gradient and Hessian (51), (52) then have the shapes of those of the
volumes, and the multiplier of s g the unit of a pressure, so that all that solves for pressures
serves here too. The multiplier lambda of (50) is s times it.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.surfaces.base import Surface


class Slides:
    """The sliding nodes of a problem.

    Parameters
    ----------
    parts : surfaces with the numbers of their nodes.
    points : reference positions of all nodes, m.
    first : number of the first of these constraints.
    size : L, m.
    """

    def __init__(
        self,
        parts: Sequence[tuple[Surface, IntArray]],
        points: FloatArray,
        first: int,
        size: float,
    ):
        self.nodes = np.concatenate([nodes for _, nodes in parts]).astype(np.int64)
        ends = np.cumsum([0, *(len(nodes) for _, nodes in parts)])
        self._parts = [
            (surface, slice(begin, end))
            for (surface, _), (begin, end) in zip(parts, pairwise(ends), strict=True)
        ]
        #: Like those of a block of elements.
        self.cells = self.nodes[:, None]
        self.numbers = slice(first, first + len(self.nodes))
        self.scale = np.ones(len(self.nodes))
        self.scale = size**2 / np.linalg.norm(self.gradients(points)[:, 0], axis=1)
        #: Constraint of a node that is a length L away, m3.
        self.sizes = np.full(len(self.nodes), size**3)

    def values(self, x: FloatArray) -> FloatArray:
        """Return s g at the positions of the nodes, shape (s,), m3; x has shape (n, 3)."""
        value = [surface.value(x[self.nodes[part]]) for surface, part in self._parts]
        return self.scale * np.concatenate(value)

    def gradients(self, x: FloatArray) -> FloatArray:
        """Return s dg/dy (51), shape (s, 1, 3), m2."""
        gradient = [surface.gradient(x[self.nodes[part]]) for surface, part in self._parts]
        return (self.scale[:, None] * np.concatenate(gradient))[:, None]

    def hessians(self, x: FloatArray) -> FloatArray:
        """Return s d2g/dy2 (52), shape (s, 3, 3), m."""
        hessian = [surface.hessian(x[self.nodes[part]]) for surface, part in self._parts]
        return self.scale[:, None, None] * np.concatenate(hessian)

    def curvatures(self, x: FloatArray, velocity: FloatArray) -> FloatArray:
        """Return s v.H v, the part of (s g)'' without acceleration, shape (s,), m3/s2."""
        v = velocity[self.nodes]
        return np.einsum("si,sij,sj->s", v, self.hessians(x), v)
