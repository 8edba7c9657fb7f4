"""Sliding nodes in the mixed system: a multiplier for each (49), (50)."""

from __future__ import annotations

import numpy as np

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.boundary.sliding import Sliding
from dolfin_tongue.fenicsx.arguments import Arguments, Shifts
from dolfin_tongue.fenicsx.coupling import Coupling, Sparse, scattered
from dolfin_tongue.fenicsx.numbering import Numbering

#: Distance from the surface at which Newton's method may stop, m.
TOLERANCE = 1e-11


class SlidingNodes(Coupling):
    """The nodes of one `Sliding` and their multipliers.

    The force lambda dg/dy is stated at the stage, the condition g(y) = 0 at the end of the step,
    like the volumes; divided by the first |dg/dy|, so that its rows are lengths. Points of a
    quadratic displacement between the nodes, which do not start on a curved surface, keep the value
    of g that they start with.
    """

    def __init__(self, support: Sliding, numbering: Numbering, begin: int):
        nodes = support.nodes(numbering.body)
        points = np.concatenate([part for part, _ in numbering.following(nodes)])
        self.label, self.surface = support.label, support.surface
        self._dofs = 3 * points[:, None] + np.arange(3)
        self._points = numbering.positions[points]
        self._scale = 1.0 / np.linalg.norm(self.surface.gradient(self._points), axis=1)
        self._start = self.surface.value(self._points)
        self._start[: len(nodes)] = 0.0
        self.multipliers = begin + np.arange(len(points))

    def _places(self, y: FloatArray) -> FloatArray:
        return self._points + y[self._dofs]

    def add_residual(self, at: Arguments, out: FloatArray) -> None:
        """Add -lambda dg/dy in rows of u, and the distance in the own rows."""
        force = at.state[self.multipliers][:, None] * self.surface.gradient(self._places(at.state))
        out[self._dofs] -= force
        end = self._places(at.end)
        out[self.multipliers] = self._scale * (self.surface.value(end) - self._start)

    def pattern(self, entries: Sparse) -> Sparse:
        """Nodes with themselves and their multiplier."""
        return entries + self._blocks(entries.shape[0], 1.0, 1.0, 1.0)

    def with_tangent(
        self, matrix: Sparse, at: Arguments, shifts: Shifts, rows: FloatArray
    ) -> Sparse:
        """Add the derivatives, with the Hessian of g (52)."""
        place, multiplier = self._places(at.state), at.state[self.multipliers]
        hessian = -multiplier[:, None, None] * self.surface.hessian(place)
        push = -self.surface.gradient(place)
        slope = shifts.end * self._scale[:, None] * self.surface.gradient(self._places(at.end))
        return matrix + self._blocks(matrix.shape[0], hessian, push, slope)

    def _blocks(
        self, size: int, hessian: FloatArray | float, push: FloatArray | float,
        slope: FloatArray | float,
    ) -> Sparse:  # fmt: skip
        own = self.multipliers[:, None]
        return (
            scattered(self._dofs[:, :, None], self._dofs[:, None, :], hessian, size)
            + scattered(self._dofs, own, push, size)
            + scattered(own, self._dofs, slope, size)
        )

    def converged(self, residual: FloatArray) -> bool:
        """Whether all nodes are on the surface."""
        return bool(np.abs(residual[self.multipliers]).max() <= TOLERANCE)
