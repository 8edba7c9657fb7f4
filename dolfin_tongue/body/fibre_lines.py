"""Lengths of muscle fibres: lines traced through the direction field of a muscle.

A muscle of parallel fibres of length l and volume V has the cross-section V / l. In a field of
directions each point has a fibre of its own length l(X), and the muscle the cross-section
int dV / l(X). So its force is int T dV / l with the tension T along the fibres: each fibre counts
with its own cross-section.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from dolfin_tongue.base.arrays import FloatArray, sums_at
from dolfin_tongue.body.body import Body

#: Step of the lines, in edges of a cube of the mean volume of the muscle's cells.
STEP = 0.1

#: Most steps of a line in one direction.
MOST_STEPS = 2000


def fibre_lengths(body: Body, muscle: str) -> FloatArray:
    """Length of the fibre through the centre of each cell of a muscle, shape (k,), m.

    Lines follow the direction of the cell in which they are (the one with the nearest quadrature
    point) until they leave the cells of the muscle; to about a tenth of a cell.

    Parameters
    ----------
    body : the body.
    muscle : its name; UnknownName lists the known ones.
    """
    fibres = body.fibres[muscle]
    places = np.concatenate([block.places.reshape(-1, 3) for block in body.blocks])
    owner = np.repeat(np.arange(body.cell_count), body.point_counts)
    tree = cKDTree(places)
    number = np.full(body.cell_count, -1)
    number[fibres.cells] = np.arange(len(fibres.cells))
    weights = np.concatenate([block.weights.ravel() for block in body.blocks])
    sums = [sums_at(owner, weights * x) for x in places.T]
    centres = (np.stack(sums, axis=1) / body.volumes[:, None])[fibres.cells]
    step = STEP * float(body.volumes[fibres.cells].mean()) ** (1 / 3)
    lengths = np.zeros(len(centres))
    for sign in (1.0, -1.0):
        x, way = centres.copy(), sign * fibres.directions
        inside = np.arange(len(centres))
        for _ in range(MOST_STEPS):
            x[inside] += step * way[inside]
            distance, nearest = tree.query(x[inside])
            at = number[owner[nearest]]
            # the surface is not farther from a quadrature point than its cell is wide
            reach = body.volumes[owner[nearest]] ** (1 / 3)
            stays = (at >= 0) & (distance < _outside(reach))
            lengths[inside[stays]] += step
            inside, at = inside[stays], at[stays]
            if not inside.size:
                break
            turned = fibres.directions[at]
            along = np.sign((turned * way[inside]).sum(axis=1))
            way[inside] = np.where(along == 0, 1.0, along)[:, None] * turned
    return np.maximum(lengths + step, step)


def _outside(width: FloatArray) -> FloatArray:
    """Distance from the nearest quadrature point beyond which a place counts as outside, m.

    A corner of a cube of width 1 is 0.37 from the nearest of its 2x2x2 Gauss points, the middle of
    a face 0.46: half a width lies between inside and the next cell that is not there.
    """
    return 0.45 * width
