"""Types of arrays, by the names that annotations use; shapes are stated in docstrings."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from dolfin_tongue.base.errors import BadMesh

FloatArray: TypeAlias = npt.NDArray[np.floating[Any]]
IntArray: TypeAlias = npt.NDArray[np.signedinteger[Any]]
BoolArray: TypeAlias = npt.NDArray[np.bool_]


def sums_at(places: IntArray, values: FloatArray, size: int = 0) -> FloatArray:
    """Sum values by their places, shape (size,); faster than `np.add.at`.

    Parameters
    ----------
    places : ndarray of any shape, >= 0.
    values : ndarray of the same shape.
    size : length of the result, at least.
    """
    total: Any = np.bincount(places.ravel(), values.ravel(), size)
    return total


def whole_numbers(what: str, value: Any) -> IntArray:
    """Array of node or cell numbers; BadMesh for anything that only looks like numbers."""
    try:
        array = np.asarray(value)
    except ValueError as error:
        raise BadMesh(f"{what} must be a regular array of whole numbers: {error}") from error
    if array.dtype.kind not in "iu":
        mask = array.dtype.kind == "b"
        hint = "a mask? use np.flatnonzero(mask)" if mask else "use whole numbers"
        raise BadMesh(f"{what} must hold whole numbers, not {array.dtype}: {hint}")
    return array.astype(np.int64)


def real_numbers(what: str, value: Any) -> FloatArray:
    """Array of real numbers; BadMesh for complex numbers, text, or ragged lists."""
    try:
        array = np.asarray(value)
    except ValueError as error:
        raise BadMesh(f"{what} must be a regular array of real numbers: {error}") from error
    if array.dtype.kind not in "iuf":
        raise BadMesh(f"{what} must hold real numbers, not {array.dtype}")
    return array.astype(float)
