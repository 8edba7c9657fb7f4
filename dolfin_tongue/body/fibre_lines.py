"""Lengths of muscle fibres: lines traced through the cells of a muscle.

A muscle of parallel fibres of length l and volume V has the cross-section V / l. In a field of
directions each point has a fibre of its own length l(X), and the muscle the cross-section
int dV / l(X). So its force is int T dV / l with the tension T along the fibres: each fibre counts
with its own cross-section.

A direction is constant in a cell, so that a fibre is straight there: it leaves the cell through the
face that it meets first, and goes on in the neighbour, until it leaves the cells of the muscle or
would turn back. A face that is not plane counts as the plane through the middle of its corners.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.body.body import Body
from dolfin_tongue.body.faces import all_faces, corners_of

#: Most cells that a line crosses in one direction: one that circles would never end.
MOST_CELLS = 10_000


def fibre_lengths(body: Body, muscle: str) -> FloatArray:
    """Length of the fibre through the centre of each cell of a muscle, shape (k,), m.

    Parameters
    ----------
    body : the body.
    muscle : its name; UnknownName lists the known ones.
    """
    fibres, walls = body.fibres[muscle], _Walls.of(body)
    directions = np.full((body.cell_count, 3), np.nan)
    directions[fibres.cells] = fibres.directions
    lengths = np.zeros(len(fibres.cells))
    for sign in (1.0, -1.0):
        active, cell = np.arange(len(fibres.cells)), fibres.cells
        place, way = walls.centres[cell], sign * fibres.directions
        before = np.full(len(cell), -1)
        for _ in range(MOST_CELLS):
            length, following = walls.leave(cell, place, way)
            lengths[active] += length
            turned = directions[following]
            # NaN outside of the muscle; -1 outside of the body is the last cell, or NaN too
            on = (following >= 0) & (following != before) & np.isfinite(turned[:, 0])
            if not on.any():
                break
            place = (place + length[:, None] * way)[on]
            along = (turned * way).sum(axis=1)[on]
            way = np.where(along < 0, -1.0, 1.0)[:, None] * turned[on]
            before, cell, active = cell[on], following[on], active[on]
    return lengths


@dataclass(frozen=True, eq=False)
class _Walls:
    """Faces of all cells as planes.

    Parameters
    ----------
    centres : ndarray, shape (m, 3), m -- middle of the corners of each cell.
    faces : ndarray, shape (m, f) -- numbers of the faces of each cell; the last one again where a
        cell has fewer.
    middles, normals : ndarray, shape (k, 3) -- of the faces, m and m2; outward.
    others : ndarray, shape (k,) -- the cell beyond each face; -1 for none.
    """

    centres: FloatArray
    faces: IntArray
    middles: FloatArray
    normals: FloatArray
    others: IntArray

    @classmethod
    def of(cls, body: Body) -> _Walls:
        """Those of a body."""
        faces, owners = all_faces(body.cells_by_kind)
        order = np.argsort(owners, kind="stable")
        faces, owners = faces[order], owners[order]
        first = np.searchsorted(owners, np.arange(body.cell_count))
        count = np.bincount(owners)
        table = first[:, None] + np.minimum(np.arange(count.max()), count[:, None] - 1)
        corners = body.points[corners_of(faces)]
        normals = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
        centres = np.concatenate([body.points[b.corners].mean(axis=1) for b in body.blocks])
        return cls(centres, table, corners.mean(axis=1), normals, _beyond(faces, owners))

    def leave(
        self, cell: IntArray, place: FloatArray, way: FloatArray
    ) -> tuple[FloatArray, IntArray]:
        """How far it is along unit vectors to the way out of cells, m, and the cells beyond."""
        own = self.faces[cell]
        speed = np.einsum("kfi,ki->kf", self.normals[own], way)
        apart = np.einsum("kfi,kfi->kf", self.normals[own], self.middles[own] - place[:, None])
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = np.where(speed > 0, np.maximum(apart, 0.0) / speed, np.inf)
        exit_ = distance.argmin(axis=1)
        rows = np.arange(len(cell))
        return distance[rows, exit_], self.others[own[rows, exit_]]


def _beyond(faces: IntArray, owners: IntArray) -> IntArray:
    """For each face of a cell the cell on its other side, shape (k,); -1 for none."""
    _, key = np.unique(np.sort(faces, axis=1), axis=0, return_inverse=True)
    order = np.argsort(key.ravel(), kind="stable")
    same = np.flatnonzero(np.diff(key.ravel()[order]) == 0)
    others = np.full(len(faces), -1)
    a, b = order[same], order[same + 1]
    others[a], others[b] = owners[b], owners[a]
    return others
