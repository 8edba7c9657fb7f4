"""Elementary functions of numbers and arrays, or of UFL expressions: a law is written once."""

from __future__ import annotations

from typing import Any

import numpy as np

#: What NumPy evaluates; all else is left to UFL.
_NUMERIC = (float, int, np.ndarray, np.generic)


def exp(x: Any) -> Any:
    """Exponential."""
    return _apply("exp", x)


def log(x: Any) -> Any:
    """Natural logarithm."""
    return _apply("ln", x)


def _apply(name: str, x: Any) -> Any:
    if isinstance(x, _NUMERIC):
        return {"exp": np.exp, "ln": np.log}[name](x)
    import ufl

    return getattr(ufl, name)(x)
