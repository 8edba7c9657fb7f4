"""Rows and unknowns: which components of the motion are free.

Arrays inside the direct solver have N rows: the nodes, then the centres of mass and the coordinates
of the rigid bodies (`bodies`); N = n where there are none. The unknowns of a motion are the free
components of the nodes, then the unknown coordinates of the bodies.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.body.state import State
from dolfin_tongue.control import Instant
from dolfin_tongue.direct.bodies import Bodies, NoBodies
from dolfin_tongue.direct.constraints import Constraints
from dolfin_tongue.scene.scene import Scene


class Numbering:
    """Rows and unknowns of a scene.

    Parameters
    ----------
    scene : body and supports.
    constraints : whose elements have matrices.

    Attributes
    ----------
    bodies : the rigid bodies.
    shape : of arrays over all rows, (N, 3).
    free : ndarray -- nodes that are not held.
    size : number of unknowns of a motion, d.
    dofs : ndarray, shape (n, 3) -- number of each free component, -1 where held.
    part_dofs : per constraint part the dofs of its element matrices, shape (m, 3k): component,
        then node.
    near_bodies : per block the cells with nodes that are attached to a body.
    """

    def __init__(self, scene: Scene, constraints: Constraints):
        body, self._constraints = scene.body, constraints
        self.count = len(body.points)
        self.bodies = Bodies(scene) if scene.rigid_bodies else NoBodies(self.count)
        self.shape = (self.bodies.coordinates.stop, 3)
        held = [part.nodes(body) for part in scene.held]
        #: Nodes with a prescribed displacement, increasing.
        self.held = np.unique(np.concatenate([*held, []])).astype(np.int64)
        fixed = np.concatenate([self.held, self.bodies.attached])
        self.free = np.setdiff1d(np.arange(self.count), fixed)
        self.size = 3 * len(self.free) + len(self.bodies.unknown)
        self.dofs = np.full((self.count, 3), -1, dtype=np.int64)
        self.dofs[self.free] = np.arange(3 * len(self.free)).reshape(-1, 3)
        self.part_dofs: list[IntArray] = [
            self.dofs[part.cells].transpose(0, 2, 1).reshape(len(part.cells), -1)
            for part in constraints.parts
        ]
        attached = self.bodies.attached
        self.near_bodies = [
            np.flatnonzero(np.isin(block.cells, attached).any(axis=1)) for block in body.blocks
        ]

    @property
    def has_bodies(self) -> bool:
        """Whether there are rows behind those of the nodes."""
        return self.shape[0] > self.count

    def unknowns(self, rows: FloatArray) -> FloatArray:
        """Unknowns of an array with all rows, shape (d,)."""
        nodal = rows[self.free].ravel()
        if not self.has_bodies:
            return nodal
        own = rows[self.bodies.coordinates].ravel()[self.bodies.unknown]
        return np.concatenate([nodal, own])

    def add_unknowns(self, values: FloatArray, rows: FloatArray) -> None:
        """Add values of unknowns, shape (d,), to an array with all rows."""
        count = 3 * len(self.free)
        rows[self.free] += values[:count].reshape(-1, 3)
        if self.has_bodies:
            # the coordinates are the last rows, in one piece
            rows[self.bodies.coordinates].reshape(-1)[self.bodies.unknown] += values[count:]

    def padded(self, nodal: FloatArray) -> FloatArray:
        """Nodal forces, shape (n, 3), with zeros in the rows of the rigid bodies."""
        if not self.has_bodies:
            return nodal
        return np.concatenate([nodal, np.zeros((self.shape[0] - len(nodal), 3))])

    # -- states ------------------------------------------------------------------------------------

    def rows(self, state: State) -> tuple[FloatArray, FloatArray]:
        """Displacement and velocity of a state with all rows; new arrays."""
        u, v = np.zeros((2, *self.shape))
        u[: self.count], v[: self.count] = state.displacement, state.velocity
        if state.rigid.size:
            u[self.bodies.coordinates] = state.rigid
        if state.rigid_rate.size:
            v[self.bodies.coordinates] = state.rigid_rate
        return u, v

    def multipliers(self, state: State) -> FloatArray:
        """Multipliers of all constraints at a state, shape (c,), Pa."""
        scale = self._constraints.slide_scale
        if not scale.size:
            return state.pressure
        force = state.sliding if state.sliding.size else np.zeros(len(scale))
        return np.concatenate([state.pressure, force / scale])

    def state(
        self,
        now: Instant,
        u: FloatArray,
        v: FloatArray,
        multipliers: FloatArray,
        **more: Any,
    ) -> State:
        """State of arrays with all rows and of the multipliers of all constraints.

        Parameters
        ----------
        now : time and memory.
        u, v : displacement and velocity.
        multipliers : of all constraints, shape (c,), Pa.
        more : step and iterations.
        """
        count, cells, at = self.count, self._constraints.cell_count, self.bodies.coordinates
        scale = self._constraints.slide_scale
        return State(
            now.time, u[:count], v[:count], multipliers[:cells], rigid=u[at], rigid_rate=v[at],
            sliding=scale * multipliers[cells:], memory=now.memory, **more,
        )  # fmt: skip
