"""Muscle fibres of a body: which cells, which directions, how dense; and their slots.

A body may have many muscles while few overlap in any one cell. The solvers therefore see
*slots*: every cell has as many as the largest overlap needs, each slot with a direction, a fibre
density and the index of its muscle. The size of a form depends on the number of slots only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dolfin_tongue.base.arrays import FloatArray, IntArray, real_numbers, whole_numbers
from dolfin_tongue.base.errors import BadMesh, OutOfRange, UnknownName, listing

#: Specific tension of muscle, Pa: 22 N/cm2, with which Buchaillard, Perrier and Payan (2009,
#: J. Acoust. Soc. Am. 126:2033-2051) turn cross-sections of tongue muscles into forces. It is the
#: stress that a fibre density of 1 stands for.
SPECIFIC_TENSION = 220e3


@dataclass(frozen=True)
class MuscleFibres:
    """The fibres of one muscle in the reference body.

    Parameters
    ----------
    name : e.g. ``"genioglossus_posterior"``.
    cells : ndarray, shape (k,) -- cell indices, without repetition.
    directions : ndarray, shape (k, 3), dimensionless -- unit vectors N, one per cell; the sign has
        no meaning. Constant in a cell, as in the report (section 5.3, item 4).
    density : ndarray, shape (k,), dimensionless, >= 0 -- normalised fibre density that multiplies
        the active stress (report, section 5.3, item 1).

    Raises
    ------
    BadMesh : shapes that do not fit, repeated cells, directions that are not unit vectors.
    OutOfRange : a negative or non-finite density.
    """

    name: str
    cells: IntArray
    directions: FloatArray
    density: FloatArray

    def __post_init__(self) -> None:
        what = f"muscle {self.name!r}"
        object.__setattr__(self, "cells", whole_numbers(f"{what}: cells", self.cells))
        for name in ("directions", "density"):
            object.__setattr__(self, name, real_numbers(f"{what}: {name}", getattr(self, name)))
        count = len(self.cells)
        if not count:
            raise BadMesh(f"{what} has no cells; leave it out of the body")
        if self.directions.shape != (count, 3) or self.density.shape != (count,):
            raise BadMesh(
                f"muscle {self.name!r}: {count} cells need directions of shape ({count}, 3) and "
                f"density of shape ({count},), not {self.directions.shape}, {self.density.shape}"
            )
        if len(np.unique(self.cells)) != count:
            raise BadMesh(f"muscle {self.name!r}: a cell is listed more than once")
        length = np.linalg.norm(self.directions, axis=1)
        bad = np.flatnonzero(~(np.abs(length - 1.0) <= 1e-5))
        if bad.size:
            raise BadMesh(
                f"muscle {self.name!r}: fibre directions must be unit vectors; not so in cells "
                f"{listing(int(c) for c in self.cells[bad])} (length {length[bad[0]]:.6g}). "
                "Divide them by their length, and leave out cells without fibres"
            )
        wrong = np.flatnonzero(~((self.density >= 0) & np.isfinite(self.density)))
        if wrong.size:
            cell = int(self.cells[wrong[0]])
            raise OutOfRange(
                f"fibre density of {self.name!r} in cell {cell}", self.density[wrong[0]], ">= 0"
            )


@dataclass(frozen=True)
class Slots:
    """The fibre slots of all cells.

    Parameters
    ----------
    directions : ndarray, shape (m, k, 3) -- unit vector of slot k in cell m. An empty slot holds
        (1, 0, 0), so that a fibre stretch exists there too.
    density : ndarray, shape (m, k) -- fibre density, 0 in an empty slot.
    muscle : ndarray, shape (m, k) -- index into `names`, 0 in an empty slot.
    names : the muscles, in the order of the activation vector.
    """

    directions: FloatArray
    density: FloatArray
    muscle: IntArray
    names: tuple[str, ...]

    @property
    def count(self) -> int:
        """Number of slots per cell, k."""
        return self.density.shape[1]

    def level(self, activation: FloatArray) -> FloatArray:
        """Spread activations over the slots.

        Parameters
        ----------
        activation : ndarray, shape (number of names,), in [0, 1].

        Returns
        -------
        ndarray, shape (m, k) -- density times activation.
        """
        return self.density * activation[self.muscle]


@dataclass(frozen=True)
class Fibres:
    """The fibre architecture of a body: its muscles.

    Parameters
    ----------
    muscles : the muscles, each name once.
    """

    muscles: tuple[MuscleFibres, ...] = ()

    def __post_init__(self) -> None:
        if len(set(self.names)) != len(self.names):
            raise BadMesh(f"a muscle name is used twice: {listing(sorted(self.names))}")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the muscles, in order."""
        return tuple(muscle.name for muscle in self.muscles)

    def __getitem__(self, name: str) -> MuscleFibres:
        """Return the muscle `name`; UnknownName lists the known ones."""
        for muscle in self.muscles:
            if muscle.name == name:
                return muscle
        raise UnknownName("muscle", name, self.names)

    def slots(self, names: tuple[str, ...], cell_count: int) -> Slots:
        """Distribute the named muscles over as few slots per cell as their overlap allows.

        Parameters
        ----------
        names : muscles to include; the activation vector has this order.
        cell_count : number of cells m of the body.
        """
        chosen = [self[name] for name in names]
        overlap = np.zeros(cell_count, dtype=np.int64)
        for muscle in chosen:
            overlap[muscle.cells] += 1
        count = int(overlap.max(initial=0))
        directions = np.zeros((cell_count, count, 3))
        directions[..., 0] = 1.0
        density = np.zeros((cell_count, count))
        index = np.zeros((cell_count, count), dtype=np.int64)
        used = np.zeros(cell_count, dtype=np.int64)
        for number, muscle in enumerate(chosen):
            slot = used[muscle.cells]
            directions[muscle.cells, slot] = muscle.directions
            density[muscle.cells, slot] = muscle.density
            index[muscle.cells, slot] = number
            used[muscle.cells] += 1
        return Slots(directions, density, index, names)
