"""UFL expressions of a place, evaluated with NumPy at many points at once, without a mesh.

UFL's own evaluation takes one point at a time. Here an expression is lowered to scalars, and its
operators are carried out one after the other on arrays over all points.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import basix.ufl
import numpy as np
import ufl
from scipy.special import erf
from ufl import classes
from ufl.algorithms import expand_indices
from ufl.algorithms.apply_algebra_lowering import apply_algebra_lowering
from ufl.algorithms.apply_derivatives import apply_derivatives
from ufl.algorithms.transformer import strip_variables
from ufl.corealg.traversal import unique_post_traversal

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.base.errors import BadScene

#: NumPy's function for each of UFL's scalar operators.
OPERATORS: dict[type, Callable[..., Any]] = {
    classes.Sum: np.add, classes.Product: np.multiply, classes.Division: np.divide,
    classes.Power: np.power, classes.Abs: np.abs, classes.Real: np.real, classes.Conj: np.conj,
    classes.Sqrt: np.sqrt, classes.Exp: np.exp, classes.Ln: np.log, classes.Erf: erf,
    classes.Cos: np.cos, classes.Sin: np.sin, classes.Tan: np.tan,
    classes.Acos: np.arccos, classes.Asin: np.arcsin, classes.Atan: np.arctan,
    classes.Cosh: np.cosh, classes.Sinh: np.sinh, classes.Tanh: np.tanh,
    classes.Atan2: np.arctan2, classes.MaxValue: np.maximum, classes.MinValue: np.minimum,
    classes.Conditional: np.where, classes.EQ: np.equal, classes.NE: np.not_equal,
    classes.LT: np.less, classes.LE: np.less_equal,
    classes.GT: np.greater, classes.GE: np.greater_equal,
    classes.AndCondition: np.logical_and, classes.OrCondition: np.logical_or,
    classes.NotCondition: np.logical_not,
}  # fmt: skip


def place() -> Any:
    """Return a UFL vector that stands for the place x, by which expressions can be derived."""
    domain = ufl.Mesh(basix.ufl.element("Lagrange", "tetrahedron", 1, shape=(3,)))
    return ufl.variable(ufl.Constant(domain, shape=(3,)))


@dataclass(frozen=True, eq=False)
class Formula:
    """A scalar UFL expression of `place`, its operators in the order in which they are evaluated.

    Parameters
    ----------
    nodes : the expression and its parts, operands first.
    """

    nodes: Sequence[Any]

    def __call__(self, points: FloatArray) -> FloatArray:
        """Values at points of shape (k, 3), shape (k,)."""
        values: dict[Any, Any] = {}
        # Both branches of a condition are evaluated, also where one is not defined.
        with np.errstate(all="ignore"):
            for node in self.nodes:
                values[node] = _value(node, values, points)
        return np.array(np.broadcast_to(values[self.nodes[-1]], len(points)), dtype=float)


def formula(expression: Any) -> Formula:
    """Prepare a scalar expression of `place`.

    Raises
    ------
    BadScene : an operator or coefficient that has no value at a point alone.
    """
    derived = apply_derivatives(apply_algebra_lowering(expression))
    # A variable expands to one component wherever it stands, so that it must go before.
    lowered = expand_indices(strip_variables(derived))
    nodes = tuple(unique_post_traversal(lowered))
    for node in nodes:
        if not (type(node) in OPERATORS or isinstance(node, (*_TERMINALS, classes.Indexed))):
            raise BadScene(
                f"a surface's UFL expression cannot contain {type(node).__name__} ({node}): use "
                "the place, numbers and plain functions only"
            )
    return Formula(nodes)


_TERMINALS = (
    classes.ScalarValue, classes.Zero, classes.Constant, classes.MultiIndex,
)  # fmt: skip


def _value(node: Any, values: dict[Any, Any], points: FloatArray) -> Any:
    """Value of a node, given those of its operands."""
    if isinstance(node, classes.ScalarValue):
        return float(node)
    if isinstance(node, classes.Zero):
        return 0.0
    if isinstance(node, classes.Indexed):
        return points[:, int(node.ufl_operands[1][0])]
    if isinstance(node, _TERMINALS):
        return None  # the place as a whole, of which only components have a value
    return OPERATORS[type(node)](*(values[operand] for operand in node.ufl_operands))
