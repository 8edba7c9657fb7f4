"""Points of contact on a surface of the body, and how they move with the unknowns.

The points are those of a rule with points at the nodes: between Gauss points a corner or an edge
would pass a fifth of a face deep.
"""

from __future__ import annotations

from dataclasses import dataclass

import basix
import numpy as np
import scipy.sparse as sp

from dolfin_tongue.base.arrays import FloatArray, IntArray, sums_at
from dolfin_tongue.fenicsx.coupling import Sparse
from dolfin_tongue.fenicsx.numbering import Numbering
from dolfin_tongue.fenicsx.pairs import TENSOR_ORDER


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """Points on a surface of the reference body; one that several faces share is one point.

    Parameters
    ----------
    places : ndarray, shape (q, 3), m.
    weights : ndarray, shape (q,), m2 -- the reference area of each.
    moves : sparse, shape (3 q, unknowns of the forms) -- from unknowns to displacements there.
    hats : sparse, shape (q, n) -- from values at the nodes of the body, linear in between.
    """

    places: FloatArray
    weights: FloatArray
    moves: Sparse
    hats: Sparse


#: Of the triangle: corners, middles of edges, centre; exact to degree 3.
TRIANGLE = (
    np.array([[0, 0], [1, 0], [0, 1], [0.5, 0.5], [0, 0.5], [0.5, 0], [1 / 3, 1 / 3]]),
    np.array([1, 1, 1, 8 / 3, 8 / 3, 8 / 3, 9]) / 40,
)


def _rule(face: basix.CellType, degree: int) -> tuple[FloatArray, FloatArray]:
    """Points on a face, some at its nodes, and positive weights.

    Simpson's rule on quadrilaterals (degree 1), Gauss-Lobatto with four points (degree 2).
    """
    if face == basix.CellType.triangle:
        return TRIANGLE
    rule = basix.make_quadrature(face, 2 * degree + 1, rule=basix.QuadratureType.gll)
    return np.asarray(rule[0]), np.asarray(rule[1])


def surface_points(numbering: Numbering, surface: str) -> SurfacePoints:
    """Points on a named surface of the body."""
    pair, body = numbering.pair, numbering.body
    cell = basix.CellType[pair.face]
    corners = pair.faces(body, surface)[:, TENSOR_ORDER[pair.face]]
    rule, rule_weights = _rule(cell, pair.degree)
    linear = basix.create_element(basix.ElementFamily.P, cell, 1)
    flat = np.asarray(linear.tabulate(1, rule))[:, :, :, 0]
    x = body.points[corners]
    tangents = np.einsum("aqk,fkc->fqac", flat[1:], x)
    area = np.linalg.norm(np.cross(tangents[:, :, 0], tangents[:, :, 1]), axis=-1)
    element = basix.create_element(basix.ElementFamily.P, cell, pair.degree)
    table = np.asarray(element.tabulate(0, rule))[0, :, :, 0]
    points = numbering.points_of(pair.face, corners)
    columns = 3 * points[:, None, :] + np.arange(3)[:, None]
    return _merged(
        np.einsum("qk,fkc->fqc", flat[0], x).reshape(-1, 3),
        (area * rule_weights).ravel(),
        _table(table, columns, numbering.size),
        _table(flat[0], corners[:, None], len(body.points)),
    )


def _table(values: FloatArray, columns: IntArray, size: int) -> Sparse:
    """Matrix of values (q, k) at columns (f, c, k); a row for each face, point and component."""
    shape = (len(columns), len(values), *columns.shape[1:])
    column = np.broadcast_to(columns[:, None], shape).reshape(-1, shape[-1])
    value = np.broadcast_to(values[None, :, None], shape).reshape(-1, shape[-1])
    rows, k = np.nonzero(np.abs(value) > 1e-12)
    place = (rows, column[rows, k])
    return sp.coo_array((value[rows, k], place), shape=(len(value), size)).tocsr()


def _merged(places: FloatArray, weights: FloatArray, moves: Sparse, hats: Sparse) -> SurfacePoints:
    """Each point once; equal are those that move alike, whatever the motion."""
    trial = np.random.default_rng(0).random(moves.shape[1])
    key = (moves @ trial).reshape(-1, 3).round(9)
    _, first, group = np.unique(key, axis=0, return_index=True, return_inverse=True)
    return SurfacePoints(places[first], sums_at(group, weights), moves[rows_of(first)], hats[first])


def rows_of(points: IntArray) -> IntArray:
    """Rows of the three components of points."""
    return (3 * points[:, None] + np.arange(3)).ravel()
