"""Rigid bodies in the mixed system: attached nodes follow, their forces act on the body (61), (62).

By the principle of virtual power the nodes' rows of momentum R_k, which the motion of the body
replaces, appear as T_k^T R_k in the rows of its coordinates, T = d(displacement)/dq. So the body
feels exactly the forces and moments that it exerts: there is no iteration between two systems.
Momentum is stated at the stage; the motion of the nodes at the end of the step, like all supports.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from dolfin_tongue.base.arrays import FloatArray, sums_at
from dolfin_tongue.fenicsx.arguments import Arguments, Shifts
from dolfin_tongue.fenicsx.coupling import Coupling, Sparse
from dolfin_tongue.fenicsx.numbering import Numbering
from dolfin_tongue.rigid import plane
from dolfin_tongue.rigid.loads import Loads
from dolfin_tongue.scene.scene import Scene


class RigidBodies(Coupling):
    """All rigid bodies of a scene, three coordinates each."""

    label = "rigid bodies"
    gathers = True

    def __init__(self, scene: Scene, numbering: Numbering, begin: int):
        self.bodies = scene.rigid_bodies
        self.loads = Loads(self.bodies, scene.gravity)
        self.positions = begin + np.arange(3 * len(self.bodies))
        self._given = np.concatenate([body.given for body in self.bodies])
        self._at = [slice(3 * i, 3 * i + 3) for i in range(len(self.bodies))]
        points = [
            np.concatenate([part for part, _ in numbering.following(body.nodes(scene.body))])
            for body in self.bodies
        ]
        pairs = zip(self.bodies, points, strict=True)
        arms = [body.arms(numbering.positions[part]) for body, part in pairs]
        self._dofs, self._arms = [3 * part[:, None] + np.arange(3) for part in points], arms
        self.carried = np.concatenate(points)
        #: Unknowns of the attached points, shape (k, 3).
        self.dofs = np.concatenate(self._dofs)
        self._every_arm = np.concatenate(arms)
        self._owner = np.repeat(np.arange(len(arms)), [len(part) for part in arms])

    def _own(self, y: FloatArray) -> FloatArray:
        return y[self.positions]

    def displacement(self, q: FloatArray) -> FloatArray:
        """Displacement of all attached dofs, shape (k, 3), m."""
        return plane.displacement(self._every_arm, q.reshape(-1, 3)[self._owner])

    def tissue_force(self, q: FloatArray, rows: FloatArray) -> FloatArray:
        """Return forces and moments of the tissue on the coordinates, shape (3b,), N and N m.

        Parameters
        ----------
        q : coordinates.
        rows : residual with the nodes' rows of momentum.
        """
        angles = q.reshape(-1, 3)[self._owner, 2]
        arm, force = plane.turned(self._every_arm, angles), -rows[self.dofs]
        moment = arm[:, 2] * force[:, 0] - arm[:, 0] * force[:, 2]
        parts = (force[:, 0], force[:, 2], moment)
        sums = [sums_at(self._owner, part, len(self.bodies)) for part in parts]
        return np.stack(sums, axis=1).ravel()

    def balance(self, at: Arguments, rows: FloatArray) -> FloatArray:
        """Inertia minus all forces on the coordinates (61), (62), shape (3b,), N and N m.

        Zero for free coordinates; for prescribed ones what has to be exerted.
        """
        q, v, a = self._own(at.state), self._own(at.rate), self._own(at.acceleration)
        forces = at.load * self.loads.force(at.now, q, v) + self.tissue_force(q, rows)
        return self.loads.inertia(q, v, a) - forces

    def work(self, at: Arguments, rows: FloatArray, way: FloatArray) -> float:
        """Work of what prescribes coordinates on the way of the mixed unknowns, J."""
        return float((self.balance(at, rows) * self._own(way))[self._given].sum())

    def prescribed(self, time: float) -> FloatArray:
        """Value, rate and acceleration of the prescribed coordinates, shape (3, 3b)."""
        return np.concatenate([body.prescribed(time) for body in self.bodies], axis=1)

    def add_residual(self, at: Arguments, out: FloatArray) -> None:
        """Motion of the attached nodes, balance (61), (62) of the bodies."""
        own, end = self.balance(at, out), self._own(at.end)
        own[self._given] = (end - at.load * self.prescribed(at.time_end)[0])[self._given]
        out[self.positions] = own
        out[self.dofs] = at.end[self.dofs] - self.displacement(end)

    def pattern(self, entries: Sparse) -> Sparse:
        """Own rows gather those of the nodes; nodes depend on their body."""
        may = np.array([[1.0, 0.0, 1.0], [0.0, 0.0, 0.0], [0.0, 1.0, 1.0]])  # as in `plane`
        T = np.tile(may, (len(self.dofs), 1, 1))
        own = np.ones((len(self.positions), len(self.positions)))
        return entries + self._entries(entries.shape[0], self._gathered(entries, T), T, own, 1.0)

    def with_tangent(
        self, matrix: Sparse, at: Arguments, shifts: Shifts, rows: FloatArray
    ) -> Sparse:
        """Add the derivatives; the rows of nodes are gathered and then replaced."""
        size = matrix.shape[0]
        q, v, a = self._own(at.state), self._own(at.rate), self._own(at.acceleration)
        inertia_q, inertia_v = self.loads.inertia_tangents(q, v, a)
        force_q, force_v = self.loads.force_tangents(at.now, q, v)
        own = inertia_q - at.load * force_q + shifts.acceleration * self.loads.mass(q)
        own += shifts.rate * (inertia_v - at.load * force_v)
        for dofs, arms, part in zip(self._dofs, self._arms, self._at, strict=True):
            own[part.start + 2, part.start + 2] += np.sum(plane.bend(arms, q[part]) * rows[dofs])
        own[self._given] = 0.0
        own[self._given, self._given] = shifts.end
        gathered = self._gathered(matrix, self._jacobians(q))
        gathered[self._given] = 0.0
        follow = -shifts.end * self._jacobians(self._own(at.end))
        return self._replaced(matrix) + self._entries(size, gathered, follow, own, shifts.end)

    def _jacobians(self, q: FloatArray) -> FloatArray:
        """T of all attached dofs, shape (k, 3, 3): component, then coordinate of its body."""
        return plane.jacobian(self._every_arm, q.reshape(-1, 3)[self._owner])

    def _gathered(self, matrix: Sparse, T: FloatArray) -> FloatArray:
        """Rows of the nodes, times T^T, as rows of the coordinates; dense, shape (3b, size)."""
        spread = np.zeros((self.dofs.size, len(self.positions)))
        rows = np.arange(self.dofs.size).reshape(-1, 3)
        columns = 3 * self._owner[:, None, None] + np.arange(3)
        spread[rows[:, :, None], columns] = T
        return (matrix[self.dofs.ravel()].T @ spread).T

    def _replaced(self, matrix: Sparse) -> Sparse:
        """Matrix with empty rows of the nodes."""
        keep = np.ones(matrix.shape[0])
        keep[self.dofs] = 0.0
        values = matrix.data * np.repeat(keep, np.diff(matrix.indptr))
        return sp.csr_array((values, matrix.indices, matrix.indptr), shape=matrix.shape)

    def _entries(
        self, size: int, gathered: FloatArray, follow: FloatArray, own: FloatArray, diagonal: float
    ) -> Sparse:
        """Rows of the coordinates, and those of the nodes that follow them."""
        row, column = np.nonzero(gathered)
        node, component, coordinate = np.nonzero(follow)
        inner = np.nonzero(own)
        dofs, at = self.dofs.ravel(), self.positions
        rows = (at[row], self.dofs[node, component], dofs, at[inner[0]])
        owner = at[3 * self._owner[node] + coordinate]
        columns = (column, owner, dofs, at[inner[1]])
        values = (
            gathered[row, column], follow[node, component, coordinate],
            np.full(dofs.size, diagonal), own[inner],
        )  # fmt: skip
        place = (np.concatenate(rows), np.concatenate(columns))
        return sp.coo_array((np.concatenate(values), place), shape=(size, size)).tocsr()

    def energies(self, at: Arguments) -> dict[str, float]:
        """Kinetic energy of the bodies."""
        return {"kinetic_rigid": self.loads.kinetic_energy(self._own(at.state), self._own(at.rate))}

    def powers(self, at: Arguments) -> dict[str, float]:
        """Power of their forces, weight included."""
        v = self._own(at.rate)
        return {"rigid_forces": float(v @ self.loads.force(at.now, self._own(at.state), v))}
