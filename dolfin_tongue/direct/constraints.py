"""Constraints A(U) = 0: the volumes of the cells (53), and sliding nodes (49), alike.

A constraint belongs to an element: a cell with its volume change, or a single node with its
distance from a surface. Values, gradients and Hessians are arrays over the elements of a part.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from itertools import pairwise

import numpy as np

from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.body.block import Block
from dolfin_tongue.body.body import Body
from dolfin_tongue.direct import volume
from dolfin_tongue.scene.scene import Scene
from dolfin_tongue.surfaces.base import Surface


class ConstraintPart(ABC):
    """Constraints of one kind of elements.

    Attributes
    ----------
    cells : ndarray, shape (m, k) -- nodes of each element.
    numbers : slice -- their numbers among all constraints.
    sizes : ndarray, shape (m,), m3 -- to which their errors are compared.
    """

    cells: IntArray
    numbers: slice
    sizes: FloatArray

    @abstractmethod
    def evaluate(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Values, shape (m,), m3, and gradients, shape (m, k, 3), m2, at positions (n, 3)."""

    @abstractmethod
    def gradients(self, x: FloatArray) -> FloatArray:
        """Gradients, shape (m, k, 3), m2."""

    @abstractmethod
    def curvatures(self, x: FloatArray, velocity: FloatArray) -> FloatArray:
        """v.H v, the part of A'' without acceleration, shape (m,), m3/s2."""

    @abstractmethod
    def add_hessians(self, x: FloatArray, factor: FloatArray, out: FloatArray) -> None:
        """Add factor[m] times the Hessians to element matrices, shape (m, 3k, 3k)."""


class Volumes(ConstraintPart):
    """Volume changes (53), (91) of the cells of a block."""

    def __init__(self, block: Block):
        self.cells, self.numbers, self._triples = block.cells, block.numbers, block.kind.triples
        self._count = len(block.cells)
        self.sizes = np.zeros(self._count)
        self.sizes = self.evaluate(block.points)[0]

    def gradients(self, x: FloatArray) -> FloatArray:
        """dA/dU (96)."""
        out = np.empty((*self.cells.shape, 3))
        volume.volume_gradients(x, self.cells, *self._triples, out)
        return out

    def evaluate(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Volume changes and their gradients."""
        gradients, values = self.gradients(x), np.empty(self._count)
        volume.volumes(x, self.cells, gradients, values)
        return values - self.sizes, gradients

    def curvatures(self, x: FloatArray, velocity: FloatArray) -> FloatArray:
        """v.H v with the Hessian (101)."""
        out = np.empty(self._count)
        volume.volume_accelerations(x, velocity, self.cells, *self._triples, out)
        return out

    def add_hessians(self, x: FloatArray, factor: FloatArray, out: FloatArray) -> None:
        """Add the Hessians (101)."""
        volume.add_volume_hessians(x, self.cells, *self._triples, factor, out)


class Slides(ConstraintPart):
    """Nodes on surfaces, g(y) = 0 (49): constraints on elements of one node.

    A sliding node is treated as a cell with one node, whose "volume" is s g with
    s = L^2 / |dg/dX| and L the mean size of the cells. Gradient and Hessian (51), (52) then have
    the shapes of those of the volumes, and the multiplier of s g the unit of a pressure, so that
    all that solves for pressures serves here too. The multiplier lambda of (50) is s times it.

    Parameters
    ----------
    scene : with sliding nodes.
    first : number of the first of these constraints.
    """

    def __init__(self, scene: Scene, first: int):
        parts = [(part.surface, part.nodes(scene.body)) for part in scene.sliding]
        self.nodes = np.concatenate([nodes for _, nodes in parts]).astype(np.int64)
        ends = np.cumsum([0, *(len(nodes) for _, nodes in parts)])
        self._parts: list[tuple[Surface, slice]] = [
            (surface, slice(begin, end))
            for (surface, _), (begin, end) in zip(parts, pairwise(ends), strict=True)
        ]
        self.cells = self.nodes[:, None]
        self.numbers = slice(first, first + len(self.nodes))
        size = float(np.mean(scene.body.volumes)) ** (1 / 3)
        self.scale = np.ones(len(self.nodes))
        gradients = self.gradients(scene.body.points)[:, 0]
        self.scale = size**2 / np.linalg.norm(gradients, axis=1)
        #: Constraint of a node that is a length L away, m3.
        self.sizes = np.full(len(self.nodes), size**3)

    def evaluate(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return s g and s dg/dy (51)."""
        value = [surface.value(x[self.nodes[part]]) for surface, part in self._parts]
        return self.scale * np.concatenate(value), self.gradients(x)

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

    def add_hessians(self, x: FloatArray, factor: FloatArray, out: FloatArray) -> None:
        """Add factor times s d2g/dy2 (52)."""
        out += factor[:, None, None] * self.hessians(x)


class Constraints:
    """All constraints of a scene: those of the cells, then sliding nodes.

    Attributes
    ----------
    parts : by kind of elements.
    count : number of constraints, c.
    sizes : ndarray, shape (c,), m3 -- to which errors are compared.
    """

    def __init__(self, scene: Scene):
        body: Body = scene.body
        self._points = body.points
        self.cell_count = body.cell_count
        self.parts: list[ConstraintPart] = [Volumes(block) for block in body.blocks]
        self._slides: list[Slides] = []
        if any(len(part.nodes(body)) for part in scene.sliding):
            self._slides = [Slides(scene, self.cell_count)]
            self.parts += self._slides
        self.count = self.parts[-1].numbers.stop
        self.sizes = np.concatenate([part.sizes for part in self.parts])
        #: Factor from multipliers to forces along dg/dy of sliding nodes.
        self.slide_scale = np.concatenate([np.zeros(0), *(part.scale for part in self._slides)])

    def positions(self, displacement: FloatArray) -> FloatArray:
        """Positions of the nodes, shape (n, 3), m."""
        return self._points + displacement[: len(self._points)]

    def gradients(self, displacement: FloatArray) -> list[FloatArray]:
        """Gradients of all constraints: (96), then (s, 1, 3) of sliding nodes, m2."""
        x = self.positions(displacement)
        return [part.gradients(x) for part in self.parts]

    def evaluate(self, displacement: FloatArray) -> tuple[FloatArray, list[FloatArray]]:
        """Constraints A, shape (c,), m3, and their gradients: volume changes (53), then slides."""
        x = self.positions(displacement)
        if len(self.parts) == 1:
            value, gradient = self.parts[0].evaluate(x)
            return value, [gradient]
        values, gradients = zip(*(part.evaluate(x) for part in self.parts), strict=True)
        return np.concatenate(values), list(gradients)

    def rate(self, gradients: list[FloatArray], velocity: FloatArray) -> FloatArray:
        """dA/dU . v of all constraints, shape (c,), m3/s."""
        rate = np.empty(self.count)
        for part, gradient in zip(self.parts, gradients, strict=True):
            volume.volume_rates(velocity, part.cells, gradient, rate[part.numbers])
        return rate

    def curvature(self, displacement: FloatArray, velocity: FloatArray) -> FloatArray:
        """v.H v of all constraints with the Hessians (101), (52), shape (c,), m3/s2."""
        x = self.positions(displacement)
        return np.concatenate([part.curvatures(x, velocity) for part in self.parts])

    def add_force(self, gradients: list[FloatArray], pressure: FloatArray, out: FloatArray) -> None:
        """Add the nodal forces p dA/dU of all constraints to out, shape (n, 3), N."""
        for part, gradient in zip(self.parts, gradients, strict=True):
            volume.add_pressure_forces(pressure[part.numbers], part.cells, gradient, out)

    def add_hessians(
        self, displacement: FloatArray, factor: FloatArray, matrices: list[FloatArray]
    ) -> None:
        """Add factor[c] times the Hessian (101), (52) of each constraint to its element matrix."""
        x = self.positions(displacement)
        for part, out in zip(self.parts, matrices, strict=True):
            part.add_hessians(x, factor[part.numbers], out)
