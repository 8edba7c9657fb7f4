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
    C: FloatArray,
    iso: float,
    a0: float,
    a1: float,
    a2: float,
    a3: float,
    fibre: FloatArray,
    q: FloatArray,
) -> float:
    """Write q = dQ/dE; return a0 exp(Q). Then S = a0 exp(Q) q."""
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
    F: FloatArray,
    a0: float,
    a1: float,
    a2: float,
    a3: FloatArray,
    fibres: FloatArray,
    out: FloatArray,
) -> None:
    """Add the stress of the exponential law (67).

    Parameters
    ----------
    F : shape (m, q, 3, 3).
    a0, a1, a2 : Pa, 1, 1.
    a3 : shape (m,) -- 0 in cells without the fibre part.
    fibres : shape (m, 3) -- unit vectors N.
    out : P, shape (m, q, 3, 3), Pa.
    """
    B, C, q, Y = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    for cell in range(F.shape[0]):
        for point in range(F.shape[1]):
            f = F[cell, point]
            iso = inverse_transpose(f, B) ** (-2.0 / 3.0)
            transposed_product(f, f, C)
            scale = _exponential(C, iso, a0, a1, a2, a3[cell], fibres[cell], q)
            piola_image(f, B, C, iso, q, Y)
            for i in range(3):
                for j in range(3):
                    out[cell, point, i, j] += scale * Y[i, j]


@compiled
def exponential_moduli(
    F: FloatArray,
    a0: float,
    a1: float,
    a2: float,
    a3: FloatArray,
    fibres: FloatArray,
    factor: float,
    out: FloatArray,
) -> None:
    """Add factor times dP/dF of `exponential_stress` to out, shape (m, q, 9, 9), Pa."""
    B, C, q = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    Y, Z, X, identity = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.eye(3)
    for cell in range(F.shape[0]):
        fibre = fibres[cell]
        for point in range(F.shape[1]):
            f, moduli = F[cell, point], out[cell, point]
            iso = inverse_transpose(f, B) ** (-2.0 / 3.0)
            transposed_product(f, f, C)
            scale = factor * _exponential(C, iso, a0, a1, a2, a3[cell], fibre, q)
            add_stress_moduli(f, B, C, q, scale * iso, Y, moduli)
            piola_image(f, B, C, iso, q, Y)
            add_rank_one(Y, scale, moduli)
            piola_image(f, B, C, iso, identity, Y)
            add_rank_one(Y, scale * (2.0 * a1 - a2), moduli)
            add_identity_moduli(f, B, C, scale * a2 * iso * iso, Y, Z, moduli)
            if a3[cell] != 0.0:
                for i in range(3):
                    for j in range(3):
                        X[i, j] = fibre[i] * fibre[j]
                piola_image(f, B, C, iso, X, Y)
                add_rank_one(Y, 2.0 * scale * a3[cell], moduli)


@compiled
def _mooney(C: FloatArray, iso: float, c10: float, c20: float, c01: float, S: FloatArray) -> None:
    """Write S = dW/dE_iso."""
    first = iso * (C[0, 0] + C[1, 1] + C[2, 2])
    for i in range(3):
        for j in range(3):
            S[i, j] = -2.0 * c01 * iso * C[i, j]
        S[i, i] += 2.0 * (c10 + 2.0 * c20 * (first - 3.0) + c01 * first)


@compiled
def mooney_stress(F: FloatArray, c10: float, c20: float, c01: float, out: FloatArray) -> None:
    """Add the Mooney-Rivlin stress to out, P, shape (m, q, 3, 3), Pa."""
    B, C, S, Y = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    for cell in range(F.shape[0]):
        for point in range(F.shape[1]):
            f = F[cell, point]
            iso = inverse_transpose(f, B) ** (-2.0 / 3.0)
            transposed_product(f, f, C)
            _mooney(C, iso, c10, c20, c01, S)
            piola_image(f, B, C, iso, S, Y)
            for i in range(3):
                for j in range(3):
                    out[cell, point, i, j] += Y[i, j]


@compiled
def mooney_moduli(
    F: FloatArray, c10: float, c20: float, c01: float, factor: float, out: FloatArray
) -> None:
    """Add factor times dP/dF of `mooney_stress` to out, shape (m, q, 9, 9), Pa."""
    B, C, S = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    Y, Z, identity = np.empty((3, 3)), np.empty((3, 3)), np.eye(3)
    for cell in range(F.shape[0]):
        for point in range(F.shape[1]):
            f, moduli = F[cell, point], out[cell, point]
            iso = inverse_transpose(f, B) ** (-2.0 / 3.0)
            transposed_product(f, f, C)
            _mooney(C, iso, c10, c20, c01, S)
            add_stress_moduli(f, B, C, S, factor * iso, Y, moduli)
            if c20 + c01 != 0.0:
                piola_image(f, B, C, iso, identity, Y)
                add_rank_one(Y, 4.0 * factor * (2.0 * c20 + c01), moduli)
            if c01 != 0.0:
                add_identity_moduli(f, B, C, -4.0 * factor * c01 * iso * iso, Y, Z, moduli)
