"""Parts of the semi-discrete equations that no UFL form states: points on surfaces, rigid bodies.

The unknowns of a part stand behind those of the forms, part after part. Parts are asked in order;
one that gathers the forces of nodes, a rigid body, comes last.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np
import scipy.sparse as sp

from dolfin_tongue.base.arrays import BoolArray, FloatArray, IntArray
from dolfin_tongue.fenicsx.arguments import Arguments, Shifts

#: SciPy ships no usable types.
Sparse = Any


class Coupling(ABC):
    """One part.

    Attributes
    ----------
    label : its name in tables and messages.
    positions : own unknowns that are positions; Newton's update of them must become small.
    multipliers : own unknowns that belong to the stage alone, like pressures.
    has_sides : whether it has to be told where its points were when a step began.
    carried : points of the displacement that it moves along, whose own unknowns are not free.
    gathers : whether it takes the forces on those points over.
    """

    label = ""
    positions: IntArray = np.zeros(0, dtype=np.int64)
    multipliers: IntArray = np.zeros(0, dtype=np.int64)
    has_sides = False
    carried: IntArray = np.zeros(0, dtype=np.int64)
    gathers = False

    @property
    def count(self) -> int:
        """Number of own unknowns."""
        return len(self.positions) + len(self.multipliers)

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

    def sides(self, time: float, y: FloatArray, load: float = 1.0) -> BoolArray:
        """Where its points are in a state in which a step begins; see `has_sides`."""
        raise AssertionError(f"{type(self).__name__} has no sides")

    def converged(self, residual: FloatArray) -> bool:
        """Whether the own rows of a residual are small enough to stop Newton's method."""
        return True

    def reason_to_reject(self, at: Arguments, before: FloatArray | None = None) -> str:
        """Why the end of a step must not be accepted; empty if it may.

        Parameters
        ----------
        at : the end of the step.
        before : y at its begin; None in statics.
        """
        return ""

    def work(self, at: Arguments, rows: FloatArray, way: FloatArray) -> float:
        """Work of what prescribes its unknowns on a small way, J.

        Parameters
        ----------
        at : where.
        rows : the residual of all that acts on its points.
        way : of all unknowns.
        """
        return 0.0

    def energies(self, at: Arguments) -> dict[str, float]:
        """Energies of the part by name, J."""
        return {}

    def powers(self, at: Arguments) -> dict[str, float]:
        """Power that the part adds to the motion besides the change of its energies, by name, W."""
        return {}


def scattered(rows: IntArray, columns: IntArray, values: FloatArray | float, size: int) -> Sparse:
    """Sparse matrix from triplets of one shape; repeated ones add up."""
    row, column, value = np.broadcast_arrays(rows, columns, values)
    place = (row.ravel(), column.ravel())
    return sp.coo_array((value.ravel(), place), shape=(size, size)).tocsr()
