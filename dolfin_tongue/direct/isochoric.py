"""Stress and moduli of any energy of the isochoric strain, at one quadrature point.

Let W depend on E_iso = (C_iso - I)/2 with C_iso = J^(-2/3) C; B = F^-T. For a symmetric tensor X
define the first Piola-Kirchhoff image

    Y(X) = J^(-2/3) (F X - (X:C)/3 B),      so that      X : dE_iso = Y(X) : dF.

The stress of S = dW/dE_iso is P = Y(S): deviatoric by construction. Differentiating once more, with
d(J^(-2/3)) = -2/3 J^(-2/3) B:dF and dB = -B dF^T B, the moduli dP_iJ/dF_kL are, for S held,

    J^(-2/3) [ d_ik S_JL - 2/3 (F S)_iJ B_kL - 2/3 B_iJ (F S)_kL
               + (S:C)/3 (2/3 B_iJ B_kL + B_iL B_kJ) ],

and for the change of S by d2W/dE2 = sum_r c_r X_r (x) X_r + c_id (symmetric identity)

    sum_r c_r Y(X_r)_iJ Y(X_r)_kL
    + c_id J^(-4/3) [ (b_ik d_JL + F_iL F_kJ)/2 - (F C)_iJ B_kL/3 - B_iJ (F C)_kL/3
                      + (C:C)/9 B_iJ B_kL ],     b = F F^T.
"""

from __future__ import annotations

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.base.compiled import compiled
from dolfin_tongue.direct.tensors import contraction, product, product_transposed


@compiled
def piola_image(
    F: FloatArray, B: FloatArray, C: FloatArray, iso: float, X: FloatArray, out: FloatArray
) -> None:
    """Write Y(X) = iso (F X - (X:C)/3 B), iso = J^(-2/3)."""
    third = contraction(X, C) / 3.0
    for i in range(3):
        for j in range(3):
            value = F[i, 0] * X[0, j] + F[i, 1] * X[1, j] + F[i, 2] * X[2, j]
            out[i, j] = iso * (value - third * B[i, j])


@compiled
def add_stress_moduli(
    F: FloatArray,
    B: FloatArray,
    C: FloatArray,
    S: FloatArray,
    factor: float,
    work: FloatArray,
    out: FloatArray,
) -> None:
    """Add factor times the moduli with S held; factor holds J^(-2/3); work (3, 3), out (9, 9)."""
    third = contraction(S, C) / 3.0
    product(F, S, work)
    for i in range(3):
        for j in range(3):
            for k in range(3):
                for m in range(3):
                    value = third * (B[i, j] * B[k, m] / 1.5 + B[i, m] * B[k, j])
                    value -= (work[i, j] * B[k, m] + B[i, j] * work[k, m]) / 1.5
                    if i == k:
                        value += S[j, m]
                    out[3 * i + j, 3 * k + m] += factor * value


@compiled
def add_rank_one(Y: FloatArray, factor: float, out: FloatArray) -> None:
    """Add factor Y (x) Y to moduli, (9, 9)."""
    for i in range(3):
        for j in range(3):
            for k in range(3):
                for m in range(3):
                    out[3 * i + j, 3 * k + m] += factor * Y[i, j] * Y[k, m]


@compiled
def add_identity_moduli(
    F: FloatArray,
    B: FloatArray,
    C: FloatArray,
    factor: float,
    b: FloatArray,
    FC: FloatArray,
    out: FloatArray,
) -> None:
    """Add factor times the bracket of the symmetric identity; factor holds J^(-4/3)."""
    product_transposed(F, F, b)
    product(F, C, FC)
    ninth = contraction(C, C) / 9.0
    for i in range(3):
        for j in range(3):
            for k in range(3):
                for m in range(3):
                    value = 0.5 * F[i, m] * F[k, j] + ninth * B[i, j] * B[k, m]
                    value -= (FC[i, j] * B[k, m] + B[i, j] * FC[k, m]) / 3.0
                    if j == m:
                        value += 0.5 * b[i, k]
                    out[3 * i + j, 3 * k + m] += factor * value
