"""Thin films and skin by hand: energy, nodal forces (47) and tangent from the surface metric.

A face is x(s, t) = Y_K (X^K + U^K) (43). Its base vectors G_alpha = Y_K,alpha (X^K + U^K) (45) give
the metric A_ab = G_a . G_b (8); g and a are those of the reference configuration (5), (7). An
isotropic membrane has an energy w per parameter area ds dt that depends on a^ab A_ab and det A. In
components 11, 22, 12, with the shear 2 E_12 as third strain, m = (A_22, A_11, -A_12) (the inverted
metric times det A) and d(det A)/dE = 2 m,

    S = dw/dE = alpha a^ab + beta m,    dS/dE = gamma m m^T + beta Q,   Q = [0 2 0; 2 0 0; 0 0 -1].

Surface tension, w = sigma J with J = sqrt(det A): beta = sigma / J, S^ab = sigma A^1/2 A^ab (12),
gamma = -sigma / J^3. Skin, w = mu h/2 sqrt(det a) (a^ab A_ab + det a / det A - 3):
alpha = mu h sqrt(det a), beta = -alpha det a / (det A)^2, gamma = 4 alpha det a / (det A)^3.

The power S^ab dG_a/dt . G_b (14) gives the energy's gradient at node K, S^ab Y_K,a G_b (46); the
force is *minus* that, where (47) is printed with a plus. With B = dE/dU the tangent is

    B^T dS/dE B + S^ab Y_K,a Y_L,b I.
"""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.base.compiled import compiled
from dolfin_tongue.base.values import Value
from dolfin_tongue.body.body import Body
from dolfin_tongue.body.face_groups import FaceGroup
from dolfin_tongue.body.regions import on_cells
from dolfin_tongue.boundary.skin import Skin
from dolfin_tongue.boundary.surface_tension import SurfaceTension
from dolfin_tongue.direct.parts import Configuration, Part, Tangent


class Membrane(Part):
    """One term on one group of faces.

    Parameters
    ----------
    label : of the term.
    body : the tissue.
    group : f faces with q points.
    """

    def __init__(self, label: str, body: Body, group: FaceGroup):
        self.labels, self.group, self._body = (label,), group, body
        _, metric = self._metric(body.points)
        self.rest = determinant(metric)
        #: a^ab as 11, 22, 12, shape (f, q, 3), 1/m2.
        self.rest_inverse = conjugate(metric) / self.rest[..., None]

    def _number(self, value: Value, what: str) -> FloatArray:
        """Value on the cells of the faces, shape (f or 1, 1)."""
        block = self._body.blocks[self.group.block]
        cells = on_cells(what, value, self._body).part(block.numbers).part(self.group.cells)
        return cells.contiguous

    @abstractmethod
    def coefficients(self, det: FloatArray) -> tuple[FloatArray | float, FloatArray, FloatArray]:
        """Alpha, beta and gamma of the module from det A, shape (f, q)."""

    @abstractmethod
    def energy_density(self, metric: FloatArray, det: FloatArray) -> FloatArray:
        """Energy per parameter area, shape (f, q), J."""

    def _metric(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Compute base vectors G, shape (f, q, 2, 3), m, and metric A, shape (f, q, 3)."""
        kind = self.group.kind
        shape = (len(self.group.faces), len(kind.weights))
        base, metric = np.empty((*shape, 2, 3)), np.empty((*shape, 3))
        base_vectors(x, self.group.faces, kind.gradients, base, metric)
        return base, metric

    def _stress(self, metric: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """S as 11, 22, 12, shape (f, q, 3), with beta and gamma, shape (f, q)."""
        alpha, beta, gamma = self.coefficients(determinant(metric))
        stress = beta[..., None] * conjugate(metric)
        if np.ndim(alpha):
            stress += np.asarray(alpha)[..., None] * self.rest_inverse
        return stress, beta, gamma

    def add_force(self, at: Configuration, out: FloatArray) -> None:
        """Add the nodal forces to out, shape (n, 3), N."""
        kind = self.group.kind
        base, metric = self._metric(at.x)
        stress, _, _ = self._stress(metric)
        add_forces(stress, base, self.group.faces, kind.gradients, kind.weights, out)

    def add_tangent(self, at: Configuration, tangent: Tangent) -> None:
        """Add factor times minus the force's derivative to the elements' matrices, N/m."""
        if not tangent.factor or not tangent.counts(self.labels[0]):
            return
        group, kind = self.group, self.group.kind
        base, metric = self._metric(at.x)
        stress, beta, gamma = self._stress(metric)
        add_matrices(
            stress, (beta, gamma), base, conjugate(metric),
            (kind.gradients, tangent.factor * kind.weights), (group.cells, group.local),
            tangent.matrices[group.block],
        )  # fmt: skip

    def energies(self, at: Configuration) -> dict[str, float]:
        """Energy, J."""
        _, metric = self._metric(at.x)
        density = self.energy_density(metric, determinant(metric))
        return {self.labels[0]: float(np.sum(self.group.kind.weights * density))}


class Film(Membrane):
    """Law of `SurfaceTension` (11), (12)."""

    def __init__(self, label: str, term: SurfaceTension, body: Body, group: FaceGroup):
        super().__init__(label, body, group)
        self.sigma = self._number(term.sigma, "SurfaceTension.sigma")

    def coefficients(self, det: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """No alpha; beta = sigma / J; gamma = -sigma / J^3."""
        beta = self.sigma / np.sqrt(det)
        return 0.0, beta, -beta / det

    def energy_density(self, metric: FloatArray, det: FloatArray) -> FloatArray:
        """Sigma J."""
        return self.sigma * np.sqrt(det)


class NeoHookean(Membrane):
    """Law of `Skin`."""

    def __init__(self, label: str, term: Skin, body: Body, group: FaceGroup):
        super().__init__(label, body, group)
        modulus = self._number(term.shear_modulus, "Skin.shear_modulus")
        thickness = self._number(term.thickness, "Skin.thickness")
        self.scale = modulus * thickness * np.sqrt(self.rest)

    def coefficients(self, det: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Alpha, beta = -alpha det a / (det A)^2, gamma = 4 alpha det a / (det A)^3."""
        beta = -self.scale * self.rest / det**2
        return self.scale, beta, -4.0 * beta / det

    def energy_density(self, metric: FloatArray, det: FloatArray) -> FloatArray:
        """Mu h / 2 sqrt(det a) (a^ab A_ab + det a / det A - 3)."""
        trace = (self.rest_inverse * metric * [1.0, 1.0, 2.0]).sum(axis=-1)
        return 0.5 * self.scale * (trace + self.rest / det - 3.0)


def determinant(metric: FloatArray) -> FloatArray:
    """Return the determinant of metrics given as 11, 22, 12 in the last axis."""
    return metric[..., 0] * metric[..., 1] - metric[..., 2] ** 2


def conjugate(metric: FloatArray) -> FloatArray:
    """Inverse times determinant, m = (A_22, A_11, -A_12)."""
    return np.stack([metric[..., 1], metric[..., 0], -metric[..., 2]], axis=-1)


# -- loops over faces ----------------------------------------------------------------------------


@compiled
def base_vectors(
    x: FloatArray, faces: IntArray, gradients: FloatArray, base: FloatArray, metric: FloatArray
) -> None:
    """Write G_alpha (45) and A (8).

    Parameters
    ----------
    x : shape (n, 3), m.
    faces : shape (f, k).
    gradients : shape (q, k, 2).
    base : shape (f, q, 2, 3), m.
    metric : shape (f, q, 3), m2 -- components 11, 22, 12.
    """
    for face in range(faces.shape[0]):
        for q in range(gradients.shape[0]):
            first, second, both = 0.0, 0.0, 0.0
            for i in range(3):
                g1, g2 = 0.0, 0.0
                origin = x[faces[face, 0], i]
                for node in range(faces.shape[1]):
                    value = x[faces[face, node], i] - origin
                    g1 += value * gradients[q, node, 0]
                    g2 += value * gradients[q, node, 1]
                base[face, q, 0, i], base[face, q, 1, i] = g1, g2
                first += g1 * g1
                second += g2 * g2
                both += g1 * g2
            metric[face, q, 0], metric[face, q, 1], metric[face, q, 2] = first, second, both


@compiled
def add_forces(
    stress: FloatArray,
    base: FloatArray,
    faces: IntArray,
    gradients: FloatArray,
    weights: FloatArray,
    out: FloatArray,
) -> None:
    """Add -S^ab Y_K,a G_b (46) to nodal forces, shape (n, 3), N."""
    for face in range(faces.shape[0]):
        for q in range(weights.shape[0]):
            s11, s22, s12 = stress[face, q, 0], stress[face, q, 1], stress[face, q, 2]
            for node in range(faces.shape[1]):
                y1, y2 = gradients[q, node, 0], gradients[q, node, 1]
                c1, c2 = weights[q] * (s11 * y1 + s12 * y2), weights[q] * (s12 * y1 + s22 * y2)
                for i in range(3):
                    out[faces[face, node], i] -= c1 * base[face, q, 0, i] + c2 * base[face, q, 1, i]


@compiled
def add_matrices(
    stress: FloatArray,
    coefficients: tuple[FloatArray, FloatArray],
    base: FloatArray,
    m: FloatArray,
    rule: tuple[FloatArray, FloatArray],
    owners: tuple[IntArray, IntArray],
    out: FloatArray,
) -> None:
    """Add B^T (gamma m m^T + beta Q) B + S^ab Y_K,a Y_L,b I to element matrices.

    Parameters
    ----------
    stress, m : shape (f, q, 3).
    coefficients : beta and gamma, shape (f, q) each.
    base : shape (f, q, 2, 3).
    rule : gradients and weights, shapes (q, k, 2) and (q,).
    owners : elements below the faces and their own numbers of the nodes, shapes (f,) and (f, k).
    out : shape (m, 3k', 3k') with the k' nodes of the elements.
    """
    (beta, gamma), (gradients, weights), (cells, local) = coefficients, rule, owners
    count, size = local.shape[1], out.shape[1] // 3
    B = np.empty((4, 3 * count))  # dE_11, dE_22, 2 dE_12 by the nodes, and m . dE
    place = np.empty(3 * count, dtype=np.int64)
    for face in range(local.shape[0]):
        cell = cells[face]
        for q in range(weights.shape[0]):
            weight, b, c = weights[q], beta[face, q], gamma[face, q]
            for i in range(3):
                g1, g2 = base[face, q, 0, i], base[face, q, 1, i]
                for node in range(count):
                    y1, y2 = gradients[q, node, 0], gradients[q, node, 1]
                    row = i * count + node
                    place[row] = i * size + local[face, node]
                    B[0, row], B[1, row], B[2, row] = y1 * g1, y2 * g2, y1 * g2 + y2 * g1
                    B[3, row] = m[face, q, 0] * B[0, row] + m[face, q, 1] * B[1, row]
                    B[3, row] += m[face, q, 2] * B[2, row]
            for row in range(3 * count):
                for column in range(3 * count):
                    value = 2.0 * (B[0, row] * B[1, column] + B[1, row] * B[0, column])
                    value = b * (value - B[2, row] * B[2, column])
                    value += c * B[3, row] * B[3, column]
                    out[cell, place[row], place[column]] += weight * value
            for node in range(count):
                y1, y2 = gradients[q, node, 0], gradients[q, node, 1]
                c1 = weight * (stress[face, q, 0] * y1 + stress[face, q, 2] * y2)
                c2 = weight * (stress[face, q, 2] * y1 + stress[face, q, 1] * y2)
                for other in range(count):
                    value = c1 * gradients[q, other, 0] + c2 * gradients[q, other, 1]
                    for i in range(3):
                        row, column = i * size + local[face, node], i * size + local[face, other]
                        out[cell, row, column] += value
