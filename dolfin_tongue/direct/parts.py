"""What acts on the nodes: one part per load, membrane and obstacle, and one for all the tissue."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.body.body import Body
from dolfin_tongue.control import Instant
from dolfin_tongue.direct import points

#: Of each block F, shape (m, q, 3, 3), and its rate, 1/s; F itself where no rate is asked for.
Strains = list[tuple[FloatArray, FloatArray]]


class Configuration:
    """Where the tissue is and how it moves.

    Parameters
    ----------
    body : the tissue at rest.
    now : time and memory.
    displacement, velocity : ndarrays with a row for each node and maybe more, m and m/s.
    rates : whether rates of F are asked for.
    """

    def __init__(
        self,
        body: Body,
        now: Instant,
        displacement: FloatArray,
        velocity: FloatArray,
        rates: bool = True,
    ):
        self.body, self.now, self._rates = body, now, rates
        self.u, self.v = displacement, velocity
        #: Positions of the nodes, shape (n, 3), m.
        self.x = body.points + displacement[: len(body.points)]

    @cached_property
    def strains(self) -> Strains:
        """F and its rate at the quadrature points of each block."""
        result: Strains = []
        for block in self.body.blocks:
            F: FloatArray = np.empty((*block.shape, 3, 3))
            points.nodal_gradients(self.u, block.cells, block.gradients, 1.0, F)
            rate = F
            if self._rates:
                rate = np.empty_like(F)
                points.nodal_gradients(self.v, block.cells, block.gradients, 0.0, rate)
            result.append((F, rate))
        return result


@dataclass(frozen=True, eq=False)
class Tangent:
    """Element matrices, to which parts add -(factor dF/dU + rate_factor dF/dV).

    Parameters
    ----------
    factor, rate_factor : weights.
    matrices : per block of shape (m, 3k, 3k); dofs by component, then node.
    labels : of the terms that count; None: all.
    """

    factor: float
    rate_factor: float
    matrices: list[FloatArray]
    labels: Collection[str] | None = None

    def counts(self, label: str) -> bool:
        """Whether a term counts."""
        return self.labels is None or label in self.labels


class Part(ABC):
    """Forces on the nodes from one term, or from several.

    Attributes
    ----------
    labels : of its terms.
    rate_dependent : whether the force depends on the velocity.
    """

    labels: tuple[str, ...]
    rate_dependent = False

    @abstractmethod
    def add_force(self, at: Configuration, out: FloatArray) -> None:
        """Add the nodal forces to out, shape (n, 3), N."""

    @abstractmethod
    def add_tangent(self, at: Configuration, tangent: Tangent) -> None:
        """Add -(factor dF/dU + rate_factor dF/dV) to element matrices."""

    def energies(self, at: Configuration) -> dict[str, float]:
        """Energies of its terms that have one, J."""
        return {}

    def powers(self, at: Configuration) -> dict[str, float]:
        """Power that its other terms give to the motion, W."""
        return {}


class Load(Part):
    """A force on the nodes that depends neither on motion nor on time: gravity.

    Parameters
    ----------
    label : of the term.
    force : ndarray, shape (n, 3), N.
    """

    def __init__(self, label: str, force: FloatArray):
        self.labels, self.force = (label,), force

    def add_force(self, at: Configuration, out: FloatArray) -> None:
        """Add the force."""
        out += self.force

    def add_tangent(self, at: Configuration, tangent: Tangent) -> None:
        """Add nothing."""

    def energies(self, at: Configuration) -> dict[str, float]:
        """Minus force times displacement, J."""
        return {self.labels[0]: -float(np.sum(self.force * at.u[: len(self.force)]))}
