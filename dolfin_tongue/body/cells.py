"""The table of cells: hexahedra with 8 and 20 nodes, tetrahedron 4, prism 6 (A.1 of the report).

What a body, its faces, pictures and both solvers know of a kind of cell is here.

Volume of an element. With the current node positions x^K, F = sum_K x^K (x) grad N_K (90), so the
volume A = int det F (91) is a cubic form in the positions. Its coefficients

    kappa_KLM = int grad N_K . (grad N_L x grad N_M) dxi                                  (97)

are totally antisymmetric. Under the change of variables X(xi) the triple product takes a factor
1/det J and the volume element a factor det J: kappa does not depend on where the nodes are. One
integration over the master element therefore serves all elements of a kind, deformed or not:

    A         = 1/6 sum kappa_KLM [x^K, x^L, x^M]
    dA/dx^M   = sum_{K<L} kappa_KLM x^K x x^L                                             (96)
    d2A/dx_j^N dx_l^M = sum_K kappa_KNM eps_jls x_s^K                                     (101)

Quadrature. A rule is good enough for the volume constraint if it integrates det(dx/dxi) exactly:

- hexahedron 8: the determinant has degree 2 in each coordinate; 2x2x2 Gauss points (exact to 3).
- hexahedron 20: degree 5 in each coordinate; 3x3x3 Gauss points (exact to 5).
- tetrahedron 4: constant; one point. Its mass (degree 2) has a rule of its own, four points.
- prism 6: degree 1 in the triangle, 2 along the axis; 3 x 2 points (exact to 2 and 3), since a
  single point in the triangle would leave hourglass modes without stiffness.

The mass of hexahedron 8 is integrated with its 2x2x2 points, like the stress; of a parallelepiped
that is exact. On hexahedra, prisms and tetrahedra with flat parallel faces so are all masses.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from dolfin_tongue.base.arrays import FloatArray, IntArray

#: Corners of the master brick [-1, 1]^3: 0-3 bottom counter-clockwise, 4-7 above them.
BRICK_CORNERS = np.array(
    [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1],
     [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]], dtype=float)  # fmt: skip

#: Edges of the brick that carry the mid-nodes 8-19: bottom, top, upright (VTK order).
BRICK_EDGES = np.array(
    [[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4],
     [0, 4], [1, 5], [2, 6], [3, 7]])  # fmt: skip


@dataclass(frozen=True)
class Rule:
    """Quadrature on a master element.

    Parameters
    ----------
    points : ndarray, shape (q, 3).
    weights : ndarray, shape (q,) -- their sum is the volume of the master element.
    """

    points: FloatArray
    weights: FloatArray


@dataclass(frozen=True, eq=False)
class CellKind:
    """One kind of isoparametric cell.

    Parameters
    ----------
    name : e.g. ``"hexahedron8"``.
    nodes : ndarray, shape (k, 3) -- node positions in the master element.
    shapes : points of shape (q, 3) -> values N_K of shape (q, k).
    gradients : points of shape (q, 3) -> gradients of shape (q, k, 3).
    rule : quadrature of stress and volume.
    mass_rule : quadrature of the mass.
    faces : faces of three, then those of four corners, each ndarray of shape (s, 3) or (s, 4):
        places of the corners among the nodes, outward by the right-hand rule.
    """

    name: str
    nodes: FloatArray
    shapes: Callable[[FloatArray], FloatArray] = field(repr=False)
    gradients: Callable[[FloatArray], FloatArray] = field(repr=False)
    rule: Rule = field(repr=False)
    mass_rule: Rule = field(repr=False)
    faces: tuple[IntArray, ...] = field(repr=False)

    @property
    def node_count(self) -> int:
        """Number of nodes k."""
        return len(self.nodes)

    @cached_property
    def kappa(self) -> FloatArray:
        """Coefficients kappa_KLM of the volume (97), ndarray of shape (k, k, k), dimensionless."""
        gradient = self.gradients(self.rule.points)
        wedge = np.cross(gradient[:, :, None], gradient[:, None])
        kappa = np.einsum("q,qKi,qLMi->KLM", self.rule.weights, gradient, wedge)
        kappa[np.abs(kappa) < 1e-14 * np.abs(kappa).max()] = 0.0
        return kappa

    @cached_property
    def triples(self) -> tuple[IntArray, FloatArray]:
        """Nonzero coefficients with K < L: indices of shape (t, 3) and values of shape (t,)."""
        index = np.argwhere(self.kappa)
        index = index[index[:, 0] < index[:, 1]].astype(np.int64)
        return index, self.kappa[tuple(index.T)]

    @cached_property
    def corner_count(self) -> int:
        """Number of corners; they are the first nodes."""
        return 1 + max(int(faces.max()) for faces in self.faces)

    @cached_property
    def at_points(self) -> tuple[FloatArray, FloatArray]:
        """Values (q, k) and gradients (q, k, 3) of the shapes at the points of the rule."""
        return self.shapes(self.rule.points), self.gradients(self.rule.points)

    def jacobians(self, corners: FloatArray, xi: FloatArray | None = None) -> FloatArray:
        """dX/dxi at points of the master element.

        Parameters
        ----------
        corners : ndarray, shape (m, k, 3), m -- node positions of m cells.
        xi : ndarray, shape (q, 3); default: the points of the rule.

        Returns
        -------
        ndarray, shape (m, q, 3, 3), m -- index i of X, index j of xi.
        """
        gradient = self.at_points[1] if xi is None else self.gradients(xi)
        # one large product is fastest
        return np.tensordot(corners.swapaxes(1, 2), gradient, axes=(2, 1)).swapaxes(1, 2)

    def reference_gradients(self, corners: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Gradients of the shape functions by X (19), and quadrature weights times det J.

        Parameters
        ----------
        corners : ndarray, shape (m, k, 3), m.

        Returns
        -------
        gradients : ndarray, shape (m, q, k, 3), 1/m.
        weights : ndarray, shape (m, q), m3.
        """
        jacobian = self.jacobians(corners)
        by_position = np.einsum("qkj,mqji->mqki", self.at_points[1], np.linalg.inv(jacobian))
        return np.ascontiguousarray(by_position), self.rule.weights * np.linalg.det(jacobian)

    def masses(self, corners: FloatArray, density: FloatArray) -> FloatArray:
        """Consistent element masses int rho N_K N_L (40), shape (m, k, k), kg.

        Parameters
        ----------
        corners : ndarray, shape (m, k, 3), m.
        density : ndarray, shape (m, q) at the points of `mass_rule`, or (m, 1); kg/m3.
        """
        shape = self.shapes(self.mass_rule.points)
        volume = determinants(self.jacobians(corners, self.mass_rule.points))
        weights = density * self.mass_rule.weights * volume
        return np.einsum("mq,qK,qL->mKL", weights, shape, shape)


def determinants(matrices: FloatArray) -> FloatArray:
    """Take determinants of 3x3 matrices, shape (...); faster than a LAPACK call for each."""
    a, b, c = matrices[..., 0, :], matrices[..., 1, :], matrices[..., 2, :]
    return (
        a[..., 0] * (b[..., 1] * c[..., 2] - b[..., 2] * c[..., 1])
        + a[..., 1] * (b[..., 2] * c[..., 0] - b[..., 0] * c[..., 2])
        + a[..., 2] * (b[..., 0] * c[..., 1] - b[..., 1] * c[..., 0])
    )


# -- master elements -----------------------------------------------------------------------------


def _gauss_brick(count: int) -> Rule:
    """Tensor product of Gauss-Legendre rules on [-1, 1]^3."""
    point, weight = np.polynomial.legendre.leggauss(count)
    x, y, z = np.meshgrid(point, point, point, indexing="ij")
    wx, wy, wz = np.meshgrid(weight, weight, weight, indexing="ij")
    return Rule(np.stack([x, y, z], axis=-1).reshape(-1, 3), (wx * wy * wz).ravel())


def _hexahedron8_shapes(xi: FloatArray) -> FloatArray:
    """N_K = prod_i (1 + c_i xi_i) / 8 with the corner c of node K."""
    return np.prod(1.0 + BRICK_CORNERS * xi[:, None], axis=-1) / 8.0


def _hexahedron8_gradients(xi: FloatArray) -> FloatArray:
    """dN_K/dxi_i = c_i (1 + c_j xi_j)(1 + c_k xi_k) / 8."""
    factor = 1.0 + BRICK_CORNERS * xi[:, None]
    columns = [
        BRICK_CORNERS[:, i] * factor[..., i - 2] * factor[..., i - 1] / 8.0 for i in range(3)
    ]
    return np.stack(columns, axis=-1)


_HEXAHEDRON20_NODES = np.concatenate([BRICK_CORNERS, BRICK_CORNERS[BRICK_EDGES].mean(axis=1)])


def _hexahedron20_factors(xi: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Factor of each coordinate and its derivative: 1 + c x, or 1 - x^2 along the node's edge."""
    c, x = _HEXAHEDRON20_NODES, xi[:, None]
    along = c == 0
    return np.where(along, 1.0 - x**2, 1.0 + c * x), np.where(along, -2.0 * x, c)


def _hexahedron20_shapes(xi: FloatArray) -> FloatArray:
    """Serendipity: corners f (c.xi - 2) / 8, mid-nodes f / 4, with f the product of factors."""
    product = _hexahedron20_factors(xi)[0].prod(axis=-1)
    corner = (xi @ BRICK_CORNERS.T - 2.0) / 8.0
    return np.concatenate([product[:, :8] * corner, product[:, 8:] / 4.0], axis=1)


def _hexahedron20_gradients(xi: FloatArray) -> FloatArray:
    """Product rule on `_hexahedron20_shapes`."""
    factor, slope = _hexahedron20_factors(xi)
    columns = [slope[..., i] * factor[..., i - 2] * factor[..., i - 1] for i in range(3)]
    gradient = np.stack(columns, axis=-1) / 4.0
    corner = (xi @ BRICK_CORNERS.T - 2.0)[..., None] / 2.0
    product = factor[:, :8].prod(axis=-1)[..., None]
    gradient[:, :8] = gradient[:, :8] * corner + product * BRICK_CORNERS / 8.0
    return gradient


def _tetrahedron_shapes(xi: FloatArray) -> FloatArray:
    """Barycentric coordinates 1 - x - y - z, x, y, z."""
    return np.concatenate([1.0 - xi.sum(axis=1, keepdims=True), xi], axis=1)


_TETRAHEDRON_GRADIENTS = np.concatenate([-np.ones((1, 3)), np.eye(3)])


def _prism_shapes(xi: FloatArray) -> FloatArray:
    """Barycentric coordinates of the triangle times (1 -+ z) / 2, bottom then top."""
    triangle = np.column_stack([1.0 - xi[:, 0] - xi[:, 1], xi[:, 0], xi[:, 1]])
    z = xi[:, 2:]
    return np.concatenate([triangle * (1.0 - z), triangle * (1.0 + z)], axis=1) / 2.0


def _prism_gradients(xi: FloatArray) -> FloatArray:
    """Product rule on `_prism_shapes`."""
    triangle = np.column_stack([1.0 - xi[:, 0] - xi[:, 1], xi[:, 0], xi[:, 1]])
    slope = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])
    gradient = np.empty((len(xi), 6, 3))
    for first, sign in ((0, -1.0), (3, 1.0)):
        nodes = slice(first, first + 3)
        gradient[:, nodes, :2] = slope * (1.0 + sign * xi[:, 2, None, None]) / 2.0
        gradient[:, nodes, 2] = sign * triangle / 2.0
    return gradient


def _prism_rule() -> Rule:
    """Three points in the triangle (degree 2) times two Gauss points along the axis (degree 3)."""
    corner = np.array([[1 / 6, 1 / 6], [2 / 3, 1 / 6], [1 / 6, 2 / 3]])
    height = np.array([-1.0, 1.0]) / np.sqrt(3.0)
    points = [[x, y, z] for z in height for x, y in corner]
    return Rule(np.array(points), np.full(6, 1.0 / 6.0))


def _tetrahedron_rule() -> Rule:
    """Four points, exact to degree 2."""
    near, far = (5.0 - np.sqrt(5.0)) / 20.0, (5.0 + 3.0 * np.sqrt(5.0)) / 20.0
    points = np.full((4, 3), near)
    points[np.arange(1, 4), np.arange(3)] = far
    return Rule(points, np.full(4, 1.0 / 24.0))


_GAUSS2, _GAUSS3, _PRISM = _gauss_brick(2), _gauss_brick(3), _prism_rule()

#: Faces of the brick, outward by the right-hand rule.
BRICK_FACES = np.array(
    [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]
)

HEXAHEDRON8 = CellKind(
    "hexahedron8", BRICK_CORNERS, _hexahedron8_shapes, _hexahedron8_gradients, _GAUSS2, _GAUSS2,
    (BRICK_FACES,),
)  # fmt: skip
HEXAHEDRON20 = CellKind(
    "hexahedron20", _HEXAHEDRON20_NODES, _hexahedron20_shapes, _hexahedron20_gradients, _GAUSS3,
    _GAUSS3, (BRICK_FACES,),
)  # fmt: skip
TETRAHEDRON4 = CellKind(
    "tetrahedron4",
    np.concatenate([np.zeros((1, 3)), np.eye(3)]),
    _tetrahedron_shapes,
    lambda xi: np.tile(_TETRAHEDRON_GRADIENTS, (len(xi), 1, 1)),
    Rule(np.full((1, 3), 0.25), np.array([1.0 / 6.0])),
    _tetrahedron_rule(),
    (np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]),),
)
PRISM6 = CellKind(
    "prism6",
    np.array([[x, y, z] for z in (-1.0, 1.0) for x, y in ((0, 0), (1, 0), (0, 1))], dtype=float),
    _prism_shapes,
    _prism_gradients,
    _PRISM,
    _PRISM,
    (
        np.array([[0, 2, 1], [3, 4, 5]]),
        np.array([[0, 1, 4, 3], [1, 2, 5, 4], [2, 0, 3, 5]]),
    ),
)

#: All kinds by name.
KINDS = {kind.name: kind for kind in (HEXAHEDRON8, HEXAHEDRON20, TETRAHEDRON4, PRISM6)}
