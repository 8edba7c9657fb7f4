"""Viscous stress and stress along muscle fibres, by hand.

Notation: B = F^-T, R = dF/dt, L = R F^-1, D = sym L.

Viscous, P = 2 eta J dev(D) B. By R: V_iJkL = 2 eta J [(d_ik (B_jJ B_jL) + B_iL B_kJ)/2
- B_iJ B_kL/3]. By F, since dJ = J B:dF, dB = -B dF^T B and dL = -L dF F^-1:
P_iJ B_kL - P_iL B_kJ - V_iJmL L_mk.

Active, one slot: n = F N, w = R N, stretch l = |n|, its rate r = n.w / l (30), tension
t = max_stress level f(l) g(r) (73); P = J t X, X = n (x) N / l^2 - B/3, which is (34) made
deviatoric by (36). By R: J X t_r n_k N_L / l. By F: P_iJ B_kL
+ J X_iJ [t_l n_k/l + t_r (w_k/l - r n_k/l^2)] N_L
+ J t [d_ik N_J N_L / l^2 - 2 n_i N_J n_k N_L / l^4 + B_iL B_kJ / 3].

Constant second Piola-Kirchhoff stress T N (x) N: P = T n (x) N; by F: T d_ik N_J N_L.

With x = a (l - 1 + s) and e = exp(-b x), (74) is f = c exp(-x)/(1 + e) and
f' = f a (b e / (1 + e) - 1); (76) is g = 1/(1 + exp(-b_r - a_r r)) and g' = a_r g (1 - g).
"""

from __future__ import annotations

from math import exp, sqrt

import numpy as np

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.base.arrays import FloatArray as Array
from dolfin_tongue.base.compiled import compiled
from dolfin_tongue.direct.tensors import inverse_transpose, product_transposed


@compiled
def _viscous(R: FloatArray, B: FloatArray, scale: float, L: FloatArray, P: FloatArray) -> None:
    """Write L = R F^-1 and P = scale dev(sym L) B, scale = 2 eta J."""
    product_transposed(R, B, L)
    third = (L[0, 0] + L[1, 1] + L[2, 2]) / 3.0
    for i in range(3):
        for j in range(3):
            value = -third * B[i, j]
            for k in range(3):
                value += 0.5 * (L[i, k] + L[k, i]) * B[k, j]
            P[i, j] = scale * value


@compiled
def viscous_stress(
    F: Array, rate: Array, numbers: Array, fibres: Array, level: Array, out: Array
) -> None:
    """Add the viscous stress; see `tissue.PointLaw`. The number is eta, Pa s."""
    B, L, P = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    cells, points = numbers.shape[0] > 1, numbers.shape[1] > 1
    for cell in range(F.shape[0]):
        for point in range(F.shape[1]):
            eta = numbers[cell if cells else 0, point if points else 0, 0]
            jacobian = inverse_transpose(F[cell, point], B)
            _viscous(rate[cell, point], B, 2.0 * eta * jacobian, L, P)
            for i in range(3):
                for j in range(3):
                    out[cell, point, i, j] += P[i, j]


@compiled
def viscous_moduli(
    F: Array, rate: Array, numbers: Array, fibres: Array, level: Array,
    factors: tuple[float, float], out: Array,
) -> None:  # fmt: skip
    """Add factor dP/dF + rate_factor dP/dR of `viscous_stress` to out, shape (m, q, 9, 9)."""
    factor, rate_factor = factors
    B, L, P, G = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    mixed = np.empty((3, 3))
    cells, points = numbers.shape[0] > 1, numbers.shape[1] > 1
    for cell in range(F.shape[0]):
        for point in range(F.shape[1]):
            eta = numbers[cell if cells else 0, point if points else 0, 0]
            jacobian = inverse_transpose(F[cell, point], B)
            scale = 2.0 * eta * jacobian
            _viscous(rate[cell, point], B, scale, L, P)
            # V is linear in its index k: one pass with mixed = rate_factor I - factor L.
            for i in range(3):
                for j in range(3):
                    G[i, j] = B[0, i] * B[0, j] + B[1, i] * B[1, j] + B[2, i] * B[2, j]
                    mixed[i, j] = -factor * L[i, j]
                mixed[i, i] += rate_factor
            _add_viscous(B, G, P, mixed, scale, factor, out[cell, point])


@compiled
def _add_viscous(
    B: FloatArray,
    G: FloatArray,
    P: FloatArray,
    mixed: FloatArray,
    scale: float,
    factor: float,
    out: FloatArray,
) -> None:
    """Add V_iJmL mixed_mk + factor (P_iJ B_kL - P_iL B_kJ); G = B^T B."""
    for k in range(3):
        # Column k of `mixed` seen through B: sum_m B_mJ mixed_mk.
        s0 = B[0, 0] * mixed[0, k] + B[1, 0] * mixed[1, k] + B[2, 0] * mixed[2, k]
        s1 = B[0, 1] * mixed[0, k] + B[1, 1] * mixed[1, k] + B[2, 1] * mixed[2, k]
        s2 = B[0, 2] * mixed[0, k] + B[1, 2] * mixed[1, k] + B[2, 2] * mixed[2, k]
        seen = (s0, s1, s2)
        for i in range(3):
            for j in range(3):
                for m in range(3):
                    value = 0.5 * (mixed[i, k] * G[j, m] + B[i, m] * seen[j])
                    value -= B[i, j] * seen[m] / 3.0
                    turn = P[i, j] * B[k, m] - P[i, m] * B[k, j]
                    out[3 * i + j, 3 * k + m] += scale * value + factor * turn


@compiled
def _tension(
    stretch: float, rate: float, numbers: Array, at: tuple[int, int, int]
) -> tuple[float, float, float]:
    """Tension f(stretch) g(rate) (73) and its two derivatives, in shares of the largest stress.

    The numbers (a, b, s, c, a_r, b_r, ..) are read one by one: a view of them would cost more.
    """
    i, j, k = at
    a, b, s, c = numbers[i, j, k, 0], numbers[i, j, k, 1], numbers[i, j, k, 2], numbers[i, j, k, 3]
    a_r, b_r = numbers[i, j, k, 4], numbers[i, j, k, 5]
    x = a * (stretch - 1.0 + s)
    # (74) times exp(b x) above and below: both exponents fall for a short fibre.
    up = exp(b * x)
    f = c * exp((b - 1.0) * x) / (up + 1.0)
    slope = f * a * (b / (up + 1.0) - 1.0)
    g = 1.0 / (1.0 + exp(-b_r - a_r * rate))
    return f * g, slope * g, f * a_r * g * (1.0 - g)


@compiled
def active_stress(
    F: Array, rate: Array, numbers: Array, fibres: Array, level: Array, out: Array
) -> None:
    """Add the active stress of all slots; see `tissue.PointLaw`.

    Here the numbers have an axis of slots, shape (m or 1, q or 1, s or 1, 7): (a, b, s, c) of (74),
    (75), (a, b) of (76)-(78), and the largest stress, Pa.
    """
    B, n, w = np.empty((3, 3)), np.empty(3), np.empty(3)
    cells, points, slots = numbers.shape[0] > 1, numbers.shape[1] > 1, numbers.shape[2] > 1
    for cell in range(F.shape[0]):
        for point in range(F.shape[1]):
            f, v = F[cell, point], rate[cell, point]
            jacobian = inverse_transpose(f, B)
            for slot in range(level.shape[1]):
                if level[cell, slot] == 0.0:
                    continue
                at = (cell if cells else 0, point if points else 0, slot if slots else 0)
                N = fibres[cell, slot]
                stretch, speed = _fibre(f, v, N, n, w)
                strength = jacobian * numbers[at[0], at[1], at[2], 6] * level[cell, slot]
                tension = strength * _tension(stretch, speed, numbers, at)[0]
                for i in range(3):
                    for j in range(3):
                        part = n[i] * N[j] / (stretch * stretch) - B[i, j] / 3.0
                        out[cell, point, i, j] += tension * part


@compiled
def _fibre(
    F: FloatArray, R: FloatArray, N: FloatArray, n: FloatArray, w: FloatArray
) -> tuple[float, float]:
    """Write n = F N and w = R N; return the stretch |n| and its rate n.w/|n| (30)."""
    square, power = 0.0, 0.0
    for i in range(3):
        n[i] = F[i, 0] * N[0] + F[i, 1] * N[1] + F[i, 2] * N[2]
        w[i] = R[i, 0] * N[0] + R[i, 1] * N[1] + R[i, 2] * N[2]
        square += n[i] * n[i]
        power += n[i] * w[i]
    stretch = sqrt(square)
    return stretch, power / stretch


@compiled
def active_moduli(
    F: Array, rate: Array, numbers: Array, fibres: Array, level: Array,
    factors: tuple[float, float], out: Array,
) -> None:  # fmt: skip
    """Add factor dP/dF + rate_factor dP/dR of `active_stress` to out, shape (m, q, 9, 9)."""
    factor, rate_factor = factors
    B, n, w = np.empty((3, 3)), np.empty(3), np.empty(3)
    along = np.empty(3)
    cells, points, slots = numbers.shape[0] > 1, numbers.shape[1] > 1, numbers.shape[2] > 1
    for cell in range(F.shape[0]):
        for point in range(F.shape[1]):
            f, v = F[cell, point], rate[cell, point]
            jacobian = inverse_transpose(f, B)
            for slot in range(level.shape[1]):
                if level[cell, slot] == 0.0:
                    continue
                at = (cell if cells else 0, point if points else 0, slot if slots else 0)
                N = fibres[cell, slot]
                stretch, speed = _fibre(f, v, N, n, w)
                value, by_stretch, by_rate = _tension(stretch, speed, numbers, at)
                scale = jacobian * numbers[at[0], at[1], at[2], 6] * level[cell, slot]
                for k in range(3):
                    turn = w[k] / stretch - speed * n[k] / stretch**2
                    along[k] = (factor * by_stretch + rate_factor * by_rate) * n[k] / stretch
                    along[k] = scale * (along[k] + factor * by_rate * turn)
                _add_active(B, n, N, along, stretch, factor * scale * value, out[cell, point])


@compiled
def _add_active(
    B: FloatArray,
    n: FloatArray,
    N: FloatArray,
    along: FloatArray,
    stretch: float,
    tension: float,
    out: FloatArray,
) -> None:
    """Add X_iJ (tension B_kL + along_k N_L) + tension dX_iJ/dF_kL."""
    square = stretch * stretch
    for i in range(3):
        for j in range(3):
            X = n[i] * N[j] / square - B[i, j] / 3.0
            for k in range(3):
                for m in range(3):
                    value = B[i, m] * B[k, j] / 3.0 - 2.0 * n[i] * N[j] * n[k] * N[m] / square**2
                    if i == k:
                        value += N[j] * N[m] / square
                    value = tension * (value + X * B[k, m]) + X * along[k] * N[m]
                    out[3 * i + j, 3 * k + m] += value


@compiled
def constant_stress(
    F: Array, rate: Array, numbers: Array, fibres: Array, level: Array, out: Array
) -> None:
    """Add P = T (F N) (x) N of all slots; the number, per slot as above, is the largest T, Pa."""
    cells, points, slots = numbers.shape[0] > 1, numbers.shape[1] > 1, numbers.shape[2] > 1
    for cell in range(F.shape[0]):
        for point in range(F.shape[1]):
            f = F[cell, point]
            own = numbers[cell if cells else 0, point if points else 0]
            for slot in range(level.shape[1]):
                T, N = own[slot if slots else 0, 0] * level[cell, slot], fibres[cell, slot]
                for i in range(3):
                    along = T * (f[i, 0] * N[0] + f[i, 1] * N[1] + f[i, 2] * N[2])
                    for j in range(3):
                        out[cell, point, i, j] += along * N[j]


@compiled
def constant_moduli(
    F: Array, rate: Array, numbers: Array, fibres: Array, level: Array,
    factors: tuple[float, float], out: Array,
) -> None:  # fmt: skip
    """Add factor dP/dF of `constant_stress` to out, shape (m, q, 9, 9), Pa."""
    factor = factors[0]
    cells, points, slots = numbers.shape[0] > 1, numbers.shape[1] > 1, numbers.shape[2] > 1
    for cell in range(F.shape[0]):
        for point in range(F.shape[1]):
            own = numbers[cell if cells else 0, point if points else 0]
            for slot in range(level.shape[1]):
                T, N = own[slot if slots else 0, 0] * level[cell, slot], fibres[cell, slot]
                for i in range(3):
                    for j in range(3):
                        for m in range(3):
                            out[cell, point, 3 * i + j, 3 * i + m] += factor * T * N[j] * N[m]
