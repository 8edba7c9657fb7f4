"""What a function does, as data: so that a run is not resumed with another function."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from numbers import Real
from types import CodeType, FunctionType, MethodType
from typing import Any

import numpy as np

Encode = Callable[[Any], Any]


def code_of(function: Any, encode: Encode) -> Any:
    """Code, defaults, closure and numbers of the module that a function uses, as JSON.

    Parameters
    ----------
    function : a function, method, partial, or what is built in (its name).
    encode : makes JSON of values.
    """
    if isinstance(function, partial):
        given = [encode(function.args), encode(function.keywords)]
        return [code_of(function.func, encode), *given]
    if isinstance(function, MethodType):
        return [code_of(function.__func__, encode), encode(function.__self__)]
    if not isinstance(function, FunctionType):
        return repr(function)
    closure = [encode(cell.cell_contents) for cell in function.__closure__ or ()]
    given = [encode(function.__defaults__), encode(function.__kwdefaults__), *closure]
    return [_code(function.__code__, encode), *given, encode(_numbers_of_module(function))]


def _code(code: CodeType, encode: Encode) -> Any:
    constants = [
        _code(value, encode) if isinstance(value, CodeType) else repr(value)
        for value in code.co_consts
    ]
    return [code.co_code.hex(), list(code.co_names), constants]


def _numbers_of_module(function: FunctionType) -> dict[str, Any]:
    """Return the numbers, arrays and tuples of a function's module that it uses by name."""
    known = function.__globals__
    used = {name: known[name] for name in function.__code__.co_names if name in known}
    return {n: value for n, value in used.items() if isinstance(value, Real | np.ndarray | tuple)}
