"""What is observed of a state besides the state itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.body.point_set import PointSet


@dataclass(frozen=True, eq=False)
class Touch:
    """What a contact does at one instant.

    Parameters
    ----------
    area : reference area of the points nearer than the range of the law, m2.
    force : ndarray, shape (3,) -- resultant on the tissue, N.
    traction : the largest at a point, Pa.
    gap : the smallest, m; inf where the obstacle does not reach.
    pressure : ndarray, shape (n,) -- at the nodes of the body, Pa, zero away from the surface:
        means of the tractions around a node, whose integral over the surface is that of the
        tractions.
    """

    area: float
    force: FloatArray
    traction: float
    gap: float
    pressure: FloatArray


@dataclass(frozen=True, eq=False)
class MuscleState:
    """A muscle at one instant, at the quadrature points of its cells.

    Parameters
    ----------
    activation : in [0, 1].
    points : ndarray, shape (k,) -- which of all quadrature points of the body.
    stretch, rate : ndarray, shape (k,) -- fibre stretch (30) and its rate, 1/s, positive in
        lengthening.
    stress : ndarray, shape (k,) -- active Cauchy stress along the fibres, Pa.
    tension : ndarray, shape (k,) -- the same per reference area, J stress / stretch, Pa.
    force : along its fibres, N: the integral of the tension over the fibre length, so that each
        fibre counts with its own cross-section.
    """

    activation: float
    points: IntArray
    stretch: FloatArray
    rate: FloatArray
    stress: FloatArray
    tension: FloatArray
    force: float


@dataclass(frozen=True, eq=False)
class Strain:
    """Deformation at all quadrature points of a state.

    Parameters
    ----------
    points : the quadrature points, Q of them, with means over cells and around nodes.
    deformation_gradient : ndarray, shape (Q, 3, 3) -- F (1).
    """

    points: PointSet
    deformation_gradient: FloatArray

    @property
    def volume_ratio(self) -> FloatArray:
        """Det F, shape (Q,)."""
        return np.linalg.det(self.deformation_gradient)

    @property
    def green_strain(self) -> FloatArray:
        """E = (F^T F - I)/2, shape (Q, 3, 3)."""
        F = self.deformation_gradient
        return (F.swapaxes(-1, -2) @ F - np.eye(3)) / 2


@dataclass(frozen=True, eq=False)
class PointFields(Strain):
    """Strain, pressure and stress at all quadrature points of a state.

    Parameters
    ----------
    pressure : ndarray, shape (Q,), Pa, positive in compression.
    parts : first Piola-Kirchhoff stress of each term that is a stress, by its name, shape
        (Q, 3, 3), Pa; the pressure is not one of them.
    """

    pressure: FloatArray
    parts: dict[str, FloatArray]

    @property
    def first_piola(self) -> FloatArray:
        """P of all terms and the pressure, shape (Q, 3, 3), Pa."""
        F = self.deformation_gradient
        cofactor = self.volume_ratio[:, None, None] * np.linalg.inv(F).swapaxes(-1, -2)
        total = -self.pressure[:, None, None] * cofactor
        return total + sum(self.parts.values())

    @property
    def second_piola(self) -> FloatArray:
        """S = F^-1 P, shape (Q, 3, 3), Pa."""
        return np.linalg.solve(self.deformation_gradient, self.first_piola)

    @property
    def cauchy(self) -> FloatArray:
        """T = P F^T / J, shape (Q, 3, 3), Pa."""
        F = self.deformation_gradient
        return self.first_piola @ F.swapaxes(-1, -2) / self.volume_ratio[:, None, None]

    def on_cells(self, values: FloatArray) -> FloatArray:
        """Means over the cells, weighted with volume, shape (m, ...)."""
        return self.points.on_cells(values)

    def on_nodes(self, values: FloatArray) -> FloatArray:
        """Means around the nodes, weighted with volume and shape functions, shape (n, ...)."""
        return self.points.on_nodes(values)
