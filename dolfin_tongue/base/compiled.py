"""How the element loops are compiled: cached between runs, IEEE special values kept."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import njit

#: Sums may be reordered and products fused, which lets loops use vector units. NaN and infinity
#: keep their meaning: they are how a lost step is noticed.
REORDER = {"reassoc", "contract", "nsz", "arcp"}


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a loop over elements with numba."""
    return njit(cache=True, fastmath=REORDER, error_model="numpy")(function)
