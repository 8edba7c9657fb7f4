"""What a support is: a kinematic condition on nodes."""

from __future__ import annotations

from abc import ABC, abstractmethod

from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.body.body import Body
from dolfin_tongue.control.timed import Timed


class Support(Timed, ABC):
    """A kinematic condition on nodes; no node may belong to two of them.

    Solvers know three kinds: `Held` (derive your own from it), `Sliding`, and `RigidBody`.
    """

    @property
    def label(self) -> str:
        """What messages call it."""
        return type(self).__name__

    def check(self, body: Body) -> None:
        """Refuse names and numbers that do not fit the body, before any solve."""

    @abstractmethod
    def nodes(self, body: Body) -> IntArray:
        """Node numbers that it acts on."""


class Held(Support):
    """Nodes whose displacement is prescribed."""

    @property
    def moves(self) -> bool:
        """Whether the displacement may ever differ from zero."""
        return True

    @abstractmethod
    def displacement(self, points: FloatArray, time: float) -> FloatArray:
        """Prescribed displacement of the nodes at a time.

        Parameters
        ----------
        points : ndarray, shape (k, 3), m -- reference positions of the nodes, in order of `nodes`.
        time : s.

        Returns
        -------
        ndarray, shape (k, 3), m.
        """
