"""3x3 tensors at a quadrature point, inlined into the element loops."""

from __future__ import annotations

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.base.compiled import compiled


@compiled
def inverse_transpose(F: FloatArray, out: FloatArray) -> float:
    """Write F^-T, the cofactors over the determinant (93); return J = det F."""
    for i in range(3):
        k, m = (i + 1) % 3, (i + 2) % 3
        for j in range(3):
            p, q = (j + 1) % 3, (j + 2) % 3
            out[i, j] = F[k, p] * F[m, q] - F[k, q] * F[m, p]
    jacobian = F[0, 0] * out[0, 0] + F[0, 1] * out[0, 1] + F[0, 2] * out[0, 2]
    for i in range(3):
        for j in range(3):
            out[i, j] /= jacobian
    return jacobian


@compiled
def transposed_product(a: FloatArray, b: FloatArray, out: FloatArray) -> None:
    """Write a^T b."""
    for i in range(3):
        for j in range(3):
            out[i, j] = a[0, i] * b[0, j] + a[1, i] * b[1, j] + a[2, i] * b[2, j]


@compiled
def product(a: FloatArray, b: FloatArray, out: FloatArray) -> None:
    """Write a b."""
    for i in range(3):
        for j in range(3):
            out[i, j] = a[i, 0] * b[0, j] + a[i, 1] * b[1, j] + a[i, 2] * b[2, j]


@compiled
def product_transposed(a: FloatArray, b: FloatArray, out: FloatArray) -> None:
    """Write a b^T."""
    for i in range(3):
        for j in range(3):
            out[i, j] = a[i, 0] * b[j, 0] + a[i, 1] * b[j, 1] + a[i, 2] * b[j, 2]


@compiled
def contraction(a: FloatArray, b: FloatArray) -> float:
    """Return a : b."""
    total = 0.0
    for i in range(3):
        for j in range(3):
            total += a[i, j] * b[i, j]
    return total
