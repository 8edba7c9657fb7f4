"""Rigid bodies among the nodes (61), (62): kinematics and inertia of what moves with them.

Every array of nodal values gets 2 b further rows for b bodies: the centres of mass, which are
points with mass, then the coordinates (x, z, angle). Attached nodes and centres of mass are the
*points* of a body; with the arm of each the coordinates determine its motion,

    u = u(q),   v = T q',   a = T q'' + angle'^2 d2u/dangle2,      T = du/dq.

By virtual power, what acts on the points acts on the coordinates with T^T. With R all nodal forces
minus inertia, so including the coupling of the consistent mass to free nodes, a body obeys

    I angle'' e_angle = sum_k T_k^T R_k + L,

L the `rigid.loads` and I the inertia about the centre of mass; its mass is in the inertia of the
point there. Prescribed coordinates have no equation.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from dolfin_tongue.arrays import FloatArray, IntArray
from dolfin_tongue.rigid import plane
from dolfin_tongue.rigid.body import RigidBody
from dolfin_tongue.rigid.loads import Loads


class Bodies:
    """The rigid bodies of a problem.

    Parameters
    ----------
    bodies : the rigid bodies.
    attached : numbers of the nodes of each.
    points : reference positions of all nodes, m.
    gravity : m/s2, shape (3,).
    """

    def __init__(
        self,
        bodies: Sequence[RigidBody],
        attached: Sequence[IntArray],
        points: FloatArray,
        gravity: FloatArray,
    ):
        count, number = len(points), len(bodies)
        self.bodies, self.loads = tuple(bodies), Loads(bodies, gravity)
        self.attached = np.concatenate([*attached, []]).astype(np.int64)
        rows = [np.append(nodes, count + i) for i, nodes in enumerate(attached)]
        ends = np.cumsum([0, *map(len, rows)])
        self._parts = [slice(a, b) for a, b in pairwise(ends)]
        #: Rows of the points of all bodies, body after body, each with its centre last.
        self.rows = np.concatenate(rows).astype(np.int64)
        self.is_centre = self.rows >= count
        self.centres = slice(count, count + number)
        self.coordinates = slice(count + number, count + 2 * number)
        self._arms = [
            body.arms(np.concatenate([points[nodes], np.asarray(body.centre)[None]]))
            for body, nodes in zip(bodies, attached, strict=True)
        ]
        self.given = np.array([body.given for body in bodies])
        #: Places of the unknown coordinates among all 3 b.
        self.unknown = np.flatnonzero(~self.given)
        #: Moment of inertia at the angles, 0 at the other coordinates, shape (3b,), kg m2.
        self.inertia = np.array([[0.0, 0.0, body.inertia] for body in bodies]).ravel()
        self.masses = np.array([body.mass for body in bodies])
        self._gravity = np.asarray(gravity, dtype=float)

    # -- kinematics ----------------------------------------------------------------------------

    def place(self, time: float, u: FloatArray, v: FloatArray | None = None) -> None:
        """Write prescribed coordinates, and displacement and velocity of all points."""
        q = u[self.coordinates]
        rate = None if v is None else v[self.coordinates]
        for i, (body, part, arms) in enumerate(self._each()):
            if self.given[i].any():
                value = body.prescribed(time)
                q[i, self.given[i]] = value[0, self.given[i]]
                if rate is not None:
                    rate[i, self.given[i]] = value[1, self.given[i]]
            u[self.rows[part]] = plane.displacement(arms, q[i])
            if v is not None and rate is not None:
                v[self.rows[part]] = plane.jacobian(arms, q[i]) @ rate[i]

    def given_acceleration(self, time: float, u: FloatArray, v: FloatArray, out: FloatArray):
        """Write the accelerations that are left when the unknown ones are zero."""
        q, rate = u[self.coordinates], v[self.coordinates]
        for i, (body, part, arms) in enumerate(self._each()):
            second = body.prescribed(time)[2]
            out[self.coordinates][i] = second
            turn = plane.bend(arms, q[i]) * rate[i, 2] ** 2
            out[self.rows[part]] = plane.jacobian(arms, q[i]) @ second + turn

    def columns(self, u: FloatArray, turn: FloatArray | None = None) -> FloatArray:
        """Velocity of the points by the rates of the unknown coordinates, shape (k, 3, r).

        Parameters
        ----------
        u : displacement, with all rows.
        turn : angle that each body turns by while its rate is varied, shape (b,), rad: the rate in
            a stage changes the position too, by d h, so that T turns by d h angle'. Default none.
        """
        q = u[self.coordinates]
        full = np.zeros((len(self.rows), 3, 3 * len(self.bodies)))
        for i, (_, part, arms) in enumerate(self._each()):
            full[part, :, 3 * i : 3 * i + 3] = plane.jacobian(arms, q[i])
            if turn is not None:
                full[part, :, 3 * i + 2] += turn[i] * plane.bend(arms, q[i])
        return full[:, :, self.unknown]

    def forces(self, u: FloatArray, force: FloatArray) -> FloatArray:
        """sum_k T_k^T f_k on all coordinates, shape (b, 3), from forces on all rows."""
        q, out = u[self.coordinates], np.empty((len(self.bodies), 3))
        for i, (_, part, arms) in enumerate(self._each()):
            T = plane.jacobian(arms, q[i])
            out[i] = np.einsum("kij,ki->j", T, force[self.rows[part]])
        return out

    # -- equations -----------------------------------------------------------------------------

    def residual(
        self, time: float, u: FloatArray, v: FloatArray, a: FloatArray, force: FloatArray
    ) -> FloatArray:
        """All that acts on the unknown coordinates, minus their inertia, shape (r,), N and N m.

        Parameters
        ----------
        time, u, v, a : the motion, with all rows.
        force : forces minus inertia of all rows.
        """
        at, unknown = self.coordinates, self.unknown
        total = self.forces(u, force).ravel() - self.inertia * a[at].ravel()
        return (total + self.loads.force(time, u[at].ravel(), v[at].ravel()))[unknown]

    def tangents(
        self, time: float, u: FloatArray, v: FloatArray, force: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Stiffness and damping of the unknown coordinates beside those of the nodal forces.

        From the loads, and from the turning of the arms of the forces on the points.

        Returns
        -------
        ndarrays of shape (r, r), minus the derivatives of `residual` by q and by q', with nodal
        forces held.
        """
        at = self.coordinates
        _, by_q, by_v = self.loads.force_and_tangents(time, u[at].ravel(), v[at].ravel())
        for i, (_, part, arms) in enumerate(self._each()):
            by_q[3 * i + 2, 3 * i + 2] += np.sum(
                plane.bend(arms, u[at][i]) * force[self.rows[part]]
            )
        pick = np.ix_(self.unknown, self.unknown)
        return -by_q[pick], -by_v[pick]

    # -- balances ------------------------------------------------------------------------------

    def energy(self, rigid: FloatArray, rate: FloatArray) -> float:
        """Kinetic energy and energy of the weights, J."""
        total = self.loads.kinetic_energy(rigid.ravel(), rate.ravel())
        for i, (body, _, arms) in enumerate(self._each()):
            total -= body.mass * float(plane.displacement(arms[-1:], rigid[i])[0] @ self._gravity)
        return total

    def momentum(self, rigid: FloatArray, rate: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Momentum, N s, and angular momentum about the origin, N m s; each of shape (3,)."""
        linear, angular = np.zeros((2, 3))
        for i, (body, _, arms) in enumerate(self._each()):
            place = np.asarray(body.centre) + plane.displacement(arms[-1:], rigid[i])[0]
            own = body.mass * plane.jacobian(arms[-1:], rigid[i])[0] @ rate[i]
            linear += own
            angular += np.cross(place, own)
            angular[1] += body.inertia * rate[i, 2]
        return linear, angular

    def _each(self) -> list[tuple[RigidBody, slice, FloatArray]]:
        return list(zip(self.bodies, self._parts, self._arms, strict=True))
