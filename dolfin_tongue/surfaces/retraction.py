"""Local dents of a wall that make room for a body which overlaps it at rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from dolfin_tongue.base.arrays import FloatArray

#: Least radius of a dent over its depth: its slope is at most 1.72 / 12 = 0.14.
FLATNESS = 12.0

#: Part of the largest depth that is added to all, for what splines miss between samples.
ROUNDING = 1e-3


@dataclass(frozen=True, eq=False)
class Retraction:
    """Smooth dents, sum_i depth_i (1 - r_i^2)^3 with r_i = |y - centre_i| / radius_i < 1 (C2).

    Parameters
    ----------
    centres : ndarray, shape (b, 3), m.
    depths : ndarray, shape (b,), m, > 0 -- by which the wall yields at the centre.
    radii : ndarray, shape (b,), m.
    """

    centres: FloatArray
    depths: FloatArray
    radii: FloatArray

    def at(self, points: FloatArray) -> FloatArray:
        """How far the wall yields at points of shape (k, 3), shape (k,), m."""
        total = np.zeros(len(points))
        if not len(self.centres):
            return total
        reach = float(self.radii.max())
        nearest, _ = cKDTree(self.centres).query(points, distance_upper_bound=reach)
        near = np.flatnonzero(np.isfinite(nearest))
        for number, centre in enumerate(self.centres):
            dent = _dent(points[near], np.asarray(centre), float(self.radii[number]))
            total[near] += self.depths[number] * dent
        return total

    def joined(self, other: Retraction | None) -> Retraction:
        """Dents of both."""
        if other is None:
            return self
        pairs = ((self.centres, other.centres), (self.depths, other.depths))
        centres, depths = (np.concatenate(pair) for pair in pairs)
        return Retraction(centres, depths, np.concatenate([self.radii, other.radii]))


def _dent(points: FloatArray, centre: FloatArray, radius: float) -> FloatArray:
    """Shape of one dent, 1 in its middle."""
    squared = ((points - centre) ** 2).sum(axis=1) / radius**2
    return np.maximum(1.0 - squared, 0.0) ** 3


def retraction_for(points: FloatArray, needs: FloatArray, radius: float) -> Retraction:
    """Find dents that give each point the room it needs: the worst point first.

    Parameters
    ----------
    points : ndarray, shape (k, 3), m.
    needs : ndarray, shape (k,), m -- how far the wall must yield there; <= 0 if it need not.
    radius : of the dents, m; it is enlarged to `FLATNESS` times the largest need if it is smaller.
    """
    worst = float(needs.max(initial=0.0))
    left = np.where(needs > 0, needs + ROUNDING * worst, 0.0)
    radius = max(radius, FLATNESS * worst)
    rows, depths = [], []
    while left.max(initial=0.0) > 0:
        row = int(left.argmax())
        rows.append(row)
        depths.append(float(left[row]))
        left = left - depths[-1] * _dent(points, points[row], radius)
        left[row] = 0.0
    return Retraction(points[rows], np.array(depths), np.full(len(rows), radius))
