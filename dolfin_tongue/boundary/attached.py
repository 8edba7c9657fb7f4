"""Attachment of nodes to bones that stand still (3.4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.base.errors import BadScene
from dolfin_tongue.body.body import Body
from dolfin_tongue.terms.support import Held


@dataclass(frozen=True)
class Attached(Held):
    """The nodes of the named regions stand still.

    Parameters
    ----------
    regions : one or more node regions of the body; UnknownName lists the known ones.
    """

    regions: tuple[str, ...]

    def __init__(self, *regions: str):
        if not regions or not all(isinstance(region, str) for region in regions):
            raise BadScene(f'Attached takes names, e.g. Attached("jaw", "hyoid"), not {regions}')
        object.__setattr__(self, "regions", regions)

    @property
    def label(self) -> str:
        """What messages call it."""
        return f"Attached({', '.join(self.regions)})"

    @property
    def moves(self) -> bool:
        """No."""
        return False

    def nodes(self, body: Body) -> IntArray:
        """Nodes of all regions, each once."""
        return np.unique(np.concatenate([body.nodes(region) for region in self.regions]))

    def displacement(self, points: FloatArray, time: float) -> FloatArray:
        """Zero, m."""
        return np.zeros_like(points)
