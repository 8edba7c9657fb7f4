"""Passive tissue by hand: the exponential law (67) with its fibre part, and Mooney-Rivlin.

Each law gives S = dW/dE_iso and d2W/dE_iso2 as rank-one parts and a multiple of the identity;
`isochoric` turns them into first Piola-Kirchhoff stress and moduli.

Exponential law, W = a0 (exp(Q) - 1), Q = a1 J1^2 + a2 J2 + a3 E_ff^2 with J1 = tr E and
J2 = (E:E - J1^2)/2:  q = dQ/dE = (2 a1 - a2) J1 I + a2 E + 2 a3 E_ff N (x) N,
S = a0 e^Q q,  d2W/dE2 = a0 e^Q (q (x) q + (2 a1 - a2) I (x) I + 2 a3 NN (x) NN + a2 identity).

Mooney-Rivlin, W = c10 (I1 - 3) + c20 (I1 - 3)^2 + c01 (I2 - 3) of C_iso = 2 E + I:
S = 2 [c10 + 2 c20 (I1 - 3) + c01 I1] I - 2 c01 C_iso,
d2W/dE2 = 4 (2 c20 + c01) I (x) I - 4 c01 identity.
"""

from __future__ import annotations

from math import exp

import numpy as np

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.base.arrays import FloatArray as Array
from dolfin_tongue.base.compiled import compiled
from dolfin_tongue.direct.isochoric import (
    add_identity_moduli,
    add_rank_one,
    add_stress_moduli,
    piola_image,
)
from dolfin_tongue.direct.tensors import inverse_transpose, transposed_product


@compiled
def _exponential(
    C: FloatArray, iso: float, law: FloatArray, fibre: FloatArray, q: FloatArray
) -> float:
    """Write q = dQ/dE; return a0 exp(Q). Then S = a0 exp(Q) q; law = (a0, a1, a2, a3)."""
    a0, a1, a2, a3 = law
    j1, square, along = 0.0, 0.0, 0.0
    for i in range(3):
        for j in range(3):
            strain = 0.5 * iso * C[i, j]
            if i == j:
                strain -= 0.5
                j1 += strain
            square += strain * strain
            along += fibre[i] * strain * fibre[j]
            q[i, j] = a2 * strain
    exponent = a1 * j1 * j1 + 0.5 * a2 * (square - j1 * j1) + a3 * along * along
    for i in range(3):
        q[i, i] += (2.0 * a1 - a2) * j1
        if a3 != 0.0:
            for j in range(3):
                q[i, j] += 2.0 * a3 * along * fibre[i] * fibre[j]
    return a0 * exp(exponent)


@compiled
def exponential_stress(
    F: Array, rate: Array, numbers: Array, fibres: Array, level: Array, out: Array
) -> None:
    """Add the stress of the exponential law (67); see `tissue.PointLaw`.

    The numbers are a0, a1, a2 and a3, which is 0 in cells without the fibre part.
    """
    B, C, q, Y = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    cells, points = numbers.shape[0] > 1, numbers.shape[1] > 1
    several = fibres.shape[0] > 1
    for cell in range(F.shape[0]):
        fibre = fibres[cell if several else 0, 0]
        for point in range(F.shape[1]):
            law = numbers[cell if cells else 0, point if points else 0]
            f = F[cell, point]
            iso = inverse_transpose(f, B) ** (-2.0 / 3.0)
            transposed_product(f, f, C)
            scale = _exponential(C, iso, law, fibre, q)
            piola_image(f, B, C, iso, q, Y)
            for i in range(3):
                for j in range(3):
                    out[cell, point, i, j] += scale * Y[i, j]


@compiled
def exponential_moduli(
    F: Array, rate: Array, numbers: Array, fibres: Array, level: Array,
    factors: tuple[float, float], out: Array,
) -> None:  # fmt: skip
    """Add factor times dP/dF of `exponential_stress` to out, shape (m, q, 9, 9), Pa."""
    factor = factors[0]
    B, C, q = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    Y, Z, X, identity = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.eye(3)
    cells, points = numbers.shape[0] > 1, numbers.shape[1] > 1
    several = fibres.shape[0] > 1
    for cell in range(F.shape[0]):
        fibre = fibres[cell if several else 0, 0]
        for point in range(F.shape[1]):
            law = numbers[cell if cells else 0, point if points else 0]
            f, moduli = F[cell, point], out[cell, point]
            iso = inverse_transpose(f, B) ** (-2.0 / 3.0)
            transposed_product(f, f, C)
            scale = factor * _exponential(C, iso, law, fibre, q)
            add_stress_moduli(f, B, C, q, scale * iso, Y, moduli)
            piola_image(f, B, C, iso, q, Y)
            add_rank_one(Y, scale, moduli)
            piola_image(f, B, C, iso, identity, Y)
            add_rank_one(Y, scale * (2.0 * law[1] - law[2]), moduli)
            add_identity_moduli(f, B, C, scale * law[2] * iso * iso, Y, Z, moduli)
            if law[3] != 0.0:
                for i in range(3):
                    for j in range(3):
                        X[i, j] = fibre[i] * fibre[j]
                piola_image(f, B, C, iso, X, Y)
                add_rank_one(Y, 2.0 * scale * law[3], moduli)


def exponential_energy(F: FloatArray, numbers: FloatArray, fibres: FloatArray) -> FloatArray:
    """W = a0 (exp(Q) - 1) (67), shape (m, q), J/m3."""
    a0, a1, a2, a3 = np.moveaxis(numbers, -1, 0)
    strain = isochoric_strain(F)
    first = np.trace(strain, axis1=-2, axis2=-1)
    second = 0.5 * ((strain**2).sum(axis=(-2, -1)) - first**2)
    N = np.broadcast_to(fibres[:, 0], (len(F), 3))
    along = np.einsum("mi,mqij,mj->mq", N, strain, N)
    return a0 * np.expm1(a1 * first**2 + a2 * second + a3 * along**2)


@compiled
def _mooney(C: FloatArray, iso: float, law: FloatArray, S: FloatArray) -> None:
    """Write S = dW/dE_iso; law = (c10, c20, c01)."""
    c10, c20, c01 = law
    first = iso * (C[0, 0] + C[1, 1] + C[2, 2])
    for i in range(3):
        for j in range(3):
            S[i, j] = -2.0 * c01 * iso * C[i, j]
        S[i, i] += 2.0 * (c10 + 2.0 * c20 * (first - 3.0) + c01 * first)


@compiled
def mooney_stress(
    F: Array, rate: Array, numbers: Array, fibres: Array, level: Array, out: Array
) -> None:
    """Add the Mooney-Rivlin stress; the numbers are c10, c20, c01, Pa."""
    B, C, S, Y = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    cells, points = numbers.shape[0] > 1, numbers.shape[1] > 1
    for cell in range(F.shape[0]):
        for point in range(F.shape[1]):
            law = numbers[cell if cells else 0, point if points else 0]
            f = F[cell, point]
            iso = inverse_transpose(f, B) ** (-2.0 / 3.0)
            transposed_product(f, f, C)
            _mooney(C, iso, law, S)
            piola_image(f, B, C, iso, S, Y)
            for i in range(3):
                for j in range(3):
                    out[cell, point, i, j] += Y[i, j]


@compiled
def mooney_moduli(
    F: Array, rate: Array, numbers: Array, fibres: Array, level: Array,
    factors: tuple[float, float], out: Array,
) -> None:  # fmt: skip
    """Add factor times dP/dF of `mooney_stress` to out, shape (m, q, 9, 9), Pa."""
    factor = factors[0]
    B, C, S = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    Y, Z, identity = np.empty((3, 3)), np.empty((3, 3)), np.eye(3)
    cells, points = numbers.shape[0] > 1, numbers.shape[1] > 1
    for cell in range(F.shape[0]):
        for point in range(F.shape[1]):
            law = numbers[cell if cells else 0, point if points else 0]
            c20, c01 = law[1], law[2]
            f, moduli = F[cell, point], out[cell, point]
            iso = inverse_transpose(f, B) ** (-2.0 / 3.0)
            transposed_product(f, f, C)
            _mooney(C, iso, law, S)
            add_stress_moduli(f, B, C, S, factor * iso, Y, moduli)
            if c20 + c01 != 0.0:
                piola_image(f, B, C, iso, identity, Y)
                add_rank_one(Y, 4.0 * factor * (2.0 * c20 + c01), moduli)
            if c01 != 0.0:
                add_identity_moduli(f, B, C, -4.0 * factor * c01 * iso * iso, Y, Z, moduli)


def mooney_energy(F: FloatArray, numbers: FloatArray, fibres: FloatArray) -> FloatArray:
    """W of `MooneyRivlin`, shape (m, q), J/m3."""
    c10, c20, c01 = np.moveaxis(numbers, -1, 0)
    right = 2.0 * isochoric_strain(F) + np.eye(3)
    first = np.trace(right, axis1=-2, axis2=-1)
    second = 0.5 * (first**2 - (right**2).sum(axis=(-2, -1)))
    return c10 * (first - 3) + c20 * (first - 3) ** 2 + c01 * (second - 3)


def isochoric_strain(F: FloatArray) -> FloatArray:
    """E of the isochoric part of F, (J^(-2/3) F^T F - I)/2, shape (m, q, 3, 3)."""
    scale = np.linalg.det(F) ** (-2.0 / 3.0)
    return 0.5 * (scale[..., None, None] * np.einsum("mqki,mqkj->mqij", F, F) - np.eye(3))
