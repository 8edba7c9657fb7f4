"""Parts of the semi-discrete equations that no UFL form states: points on surfaces, rigid bodies.

The unknowns of a part stand behind those of the mixed space, part after part. Parts are asked in
order; one that gathers the forces of nodes, a rigid body, comes last.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from dolfin_tongue.base.arrays import FloatArray, IntArray

#: SciPy ships no usable types.
Sparse = Any


@dataclass(frozen=True, eq=False)
class Arguments:
    """What the equations depend on: mixed arrays with the unknowns of all parts.

    Parameters
    ----------
    time, time_end : of the stage and of the end of the step, s.
    state, rate, acceleration : y, y', y'' at the stage; rates are zero in statics.
    end : y at the end of the step.
    load : factor on all loads, 1 in dynamics.
    """

    time: float
    time_end: float
    state: FloatArray
    rate: FloatArray
    acceleration: FloatArray
    end: FloatArray
    load: float = 1.0


@dataclass(frozen=True)
class Shifts:
    """Weights of the derivatives in a Jacobian: dG/dy + rate dG/dy' + acceleration dG/dy'' + ..."""

    rate: float
    acceleration: float
    end: float


class Coupling(ABC):
    """One part.

    Attributes
    ----------
    positions : own unknowns that are positions; Newton's update of them must become small.
    multipliers : own unknowns that belong to the stage alone, like pressures.
    """

    positions: IntArray = np.zeros(0, dtype=np.int64)
    multipliers: IntArray = np.zeros(0, dtype=np.int64)

    @abstractmethod
    def add_residual(self, at: Arguments, out: FloatArray) -> None:
        """Add forces, N, to rows of the displacement; fill the own rows."""

    def pattern(self, entries: Sparse) -> Sparse:
        """Add the entries of the part to the pattern of a matrix (ones where there are entries)."""
        return entries

    @abstractmethod
    def with_tangent(
        self, matrix: Sparse, at: Arguments, shifts: Shifts, rows: FloatArray
    ) -> Sparse:
        """Add the derivatives of `add_residual` to a sparse matrix.

        Parameters
        ----------
        matrix : the Jacobian of what came before.
        at, shifts : where, and with which weights.
        rows : the residual of what came before this part.
        """

    def begin(self, time: float, y: FloatArray) -> None:
        """Take notice of the state in which a step begins; not of what is tried within it."""

    def settled(self, residual: FloatArray) -> bool:
        """Whether the own rows of a residual are small enough to stop Newton's method."""
        return True

    def refusal(self, time: float, y: FloatArray, before: FloatArray | None = None) -> str:
        """Why a state must not be accepted as the end of a step; empty if it may.

        Parameters
        ----------
        time : s.
        y : the end of the step.
        before : its begin; None in statics.
        """
        return ""

    def energies(self, at: Arguments) -> dict[str, float]:
        """Energies of the part by name, J."""
        return {}

    def powers(self, at: Arguments) -> dict[str, float]:
        """Power that the part adds to the motion besides the change of its energies, by name, W."""
        return {}

    def observed(self, at: Arguments) -> dict[str, float]:
        """Return what the table of steps records, by name with unit."""
        return {}


def scattered(rows: IntArray, columns: IntArray, values: FloatArray | float, size: int) -> Sparse:
    """Sparse matrix from triplets of one shape; repeated ones add up."""
    row, column, value = np.broadcast_arrays(rows, columns, values)
    place = (row.ravel(), column.ravel())
    return sp.coo_array((value.ravel(), place), shape=(size, size)).tocsr()
