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

import numpy as np

from dolfin_tongue.base.arrays import BoolArray, FloatArray, IntArray, sums_at
from dolfin_tongue.control import Instant
from dolfin_tongue.rigid import plane
from dolfin_tongue.rigid.body import RigidBody
from dolfin_tongue.rigid.loads import Loads
from dolfin_tongue.scene.scene import Scene


class NoBodies:
    """The rigid bodies of a scene that has none: no rows, no unknowns, no work.

    Parameters
    ----------
    count : number of nodes.

    Attributes
    ----------
    loads : of the bodies, where there are any.
    """

    loads: Loads

    def __init__(self, count: int):
        nobody: IntArray = np.zeros(0, dtype=np.int64)
        nothing: FloatArray = np.zeros(0)
        self.bodies: tuple[RigidBody, ...] = ()
        self.attached, self.rows, self.unknown = nobody, nobody, nobody
        self.is_centre: BoolArray = np.zeros(0, dtype=bool)
        self.centres = self.coordinates = slice(count, count)
        self.given: BoolArray = np.zeros((0, 3), dtype=bool)
        self.inertia, self.masses = nothing, nothing

    def place(self, time: float, u: FloatArray, v: FloatArray | None = None) -> None:
        """Write nothing."""

    def given_acceleration(
        self, time: float, u: FloatArray, v: FloatArray, out: FloatArray
    ) -> None:
        """Write nothing."""

    def columns(self, u: FloatArray, turn: FloatArray | None = None) -> FloatArray:
        """Return no columns."""
        return np.zeros((0, 3, 0))

    def forces(self, u: FloatArray, force: FloatArray) -> FloatArray:
        """Return no forces."""
        return np.zeros((0, 3))

    def residual(
        self, now: Instant, u: FloatArray, v: FloatArray, a: FloatArray, force: FloatArray
    ) -> FloatArray:
        """Return no rows."""
        return np.zeros(0)

    def tangents(
        self, now: Instant, u: FloatArray, v: FloatArray, force: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return nothing."""
        return np.zeros((0, 0)), np.zeros((0, 0))

    def energies(self, now: Instant, u: FloatArray, v: FloatArray) -> dict[str, float]:
        """Return none."""
        return {}

    def powers(self, now: Instant, u: FloatArray, v: FloatArray) -> dict[str, float]:
        """Return none."""
        return {}

    def weight_energy(self, rigid: FloatArray) -> float:
        """Return 0."""
        return 0.0

    def momentum(self, rigid: FloatArray, rate: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return zeros."""
        return np.zeros(3), np.zeros(3)


class Bodies(NoBodies):
    """The rigid bodies of a scene.

    Parameters
    ----------
    scene : with rigid bodies.
    """

    def __init__(self, scene: Scene):
        bodies, points, gravity = scene.rigid_bodies, scene.body.points, scene.gravity
        attached = [body.nodes(scene.body) for body in bodies]
        count, number = len(points), len(bodies)
        super().__init__(count)
        self.bodies, self.loads = bodies, Loads(bodies, gravity)
        self.attached = np.concatenate([*attached, []]).astype(np.int64)
        rows = [np.append(nodes, count + i) for i, nodes in enumerate(attached)]
        self._owner = np.repeat(np.arange(number), [len(part) for part in rows])
        #: Rows of the points of all bodies, body after body, each with its centre last.
        self.rows = np.concatenate(rows).astype(np.int64)
        self.is_centre = self.rows >= count
        self.centres = slice(count, count + number)
        self.coordinates = slice(count + number, count + 2 * number)
        own = [
            body.arms(np.concatenate([points[nodes], np.asarray(body.centre)[None]]))
            for body, nodes in zip(bodies, attached, strict=True)
        ]
        self._arms = np.concatenate(own)
        self._key = b""
        self._known: tuple[FloatArray, FloatArray, FloatArray]
        self.given = np.array([body.given for body in bodies])
        self._any_given = bool(self.given.any())
        #: Places of the unknown coordinates among all 3 b.
        self.unknown = np.flatnonzero(~self.given)
        #: Moment of inertia at the angles, 0 at the other coordinates, shape (3b,), kg m2.
        self.inertia = np.array([[0.0, 0.0, body.inertia] for body in bodies]).ravel()
        self.masses = np.array([body.mass for body in bodies])
        self._gravity = np.asarray(gravity, dtype=float)

    # -- kinematics ----------------------------------------------------------------------------

    def _geometry(self, u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Arms (k, 3), T over all coordinates (3k, 3b), and d2u/dangle2 (k, 3), at given angles."""
        angles = u[self.coordinates, 2]
        key = angles.tobytes()
        if key != self._key:
            arms = plane.turned(self._arms, angles[self._owner])
            count, first = np.arange(len(arms)), 3 * self._owner
            T = np.zeros((len(arms), 3, self.given.size))
            T[count, 0, first] = T[count, 2, first + 1] = 1.0
            T[count, 0, first + 2], T[count, 2, first + 2] = arms[:, 2], -arms[:, 0]
            self._key = key
            self._known = arms, T.reshape(3 * len(arms), -1), arms * [-1.0, 0.0, -1.0]
        return self._known

    def place(self, time: float, u: FloatArray, v: FloatArray | None = None) -> None:
        """Write prescribed coordinates, and displacement and velocity of all points."""
        q, rate = u[self.coordinates], None if v is None else v[self.coordinates]
        if self._any_given:
            value = np.array([body.prescribed(time) for body in self.bodies])
            q[self.given] = value[:, 0][self.given]
            if rate is not None:
                rate[self.given] = value[:, 1][self.given]
        arms, T, _ = self._geometry(u)
        moved = arms - self._arms
        moved[:, 0] += q[self._owner, 0]
        moved[:, 2] += q[self._owner, 1]
        u[self.rows] = moved
        if v is not None and rate is not None:
            v[self.rows] = (T @ rate.ravel()).reshape(-1, 3)

    def given_acceleration(
        self, time: float, u: FloatArray, v: FloatArray, out: FloatArray
    ) -> None:
        """Write the accelerations that are left when the unknown ones are zero."""
        _, T, bend = self._geometry(u)
        turn = v[self.coordinates, 2] ** 2
        acceleration = bend * turn[self._owner][:, None]
        if self._any_given:
            second = np.array([body.prescribed(time)[2] for body in self.bodies])
            out[self.coordinates] = second
            acceleration += (T @ second.ravel()).reshape(-1, 3)
        out[self.rows] = acceleration

    def columns(self, u: FloatArray, turn: FloatArray | None = None) -> FloatArray:
        """Velocity of the points by the rates of the unknown coordinates, shape (k, 3, r).

        Parameters
        ----------
        u : displacement, with all rows.
        turn : angle that each body turns by while its rate is varied, shape (b,), rad: the rate in
            a stage changes the position too, by d h, so that T turns by d h angle'. Default none.
        """
        _, T, bend = self._geometry(u)
        T = T.reshape(len(bend), 3, -1)
        if turn is not None:
            T = T.copy()
            points = np.arange(len(bend))
            T[points, :, 3 * self._owner + 2] += turn[self._owner][:, None] * bend
        return T[:, :, self.unknown]

    def forces(self, u: FloatArray, force: FloatArray) -> FloatArray:
        """sum_k T_k^T f_k on all coordinates, shape (b, 3), from forces on all rows."""
        return (force[self.rows].ravel() @ self._geometry(u)[1]).reshape(-1, 3)

    # -- equations -----------------------------------------------------------------------------

    def residual(
        self, now: Instant, u: FloatArray, v: FloatArray, a: FloatArray, force: FloatArray
    ) -> FloatArray:
        """All that acts on the unknown coordinates, minus their inertia, shape (r,), N and N m.

        Parameters
        ----------
        now, u, v, a : the motion, with all rows.
        force : forces minus inertia of all rows.
        """
        at, unknown = self.coordinates, self.unknown
        total = self.forces(u, force).ravel() - self.inertia * a[at].ravel()
        return (total + self.loads.force(now, u[at].ravel(), v[at].ravel()))[unknown]

    def tangents(
        self, now: Instant, u: FloatArray, v: FloatArray, force: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Stiffness and damping of the unknown coordinates beside those of the nodal forces.

        From the loads, and from the turning of the arms of the forces on the points.

        Returns
        -------
        ndarrays of shape (r, r), minus the derivatives of `residual` by q and by q', with nodal
        forces held.
        """
        at = self.coordinates
        by_q, by_v = self.loads.force_tangents(now, u[at].ravel(), v[at].ravel())
        bent = np.sum(self._geometry(u)[2] * force[self.rows], axis=1)
        angles = 3 * np.arange(len(self.bodies)) + 2
        by_q[angles, angles] += sums_at(self._owner, bent)
        pick = np.ix_(self.unknown, self.unknown)
        return -by_q[pick], -by_v[pick]

    # -- balances ------------------------------------------------------------------------------

    def energies(self, now: Instant, u: FloatArray, v: FloatArray) -> dict[str, float]:
        """Kinetic energy, J."""
        q, rate = u[self.coordinates].ravel(), v[self.coordinates].ravel()
        return {"kinetic_rigid": self.loads.kinetic_energy(q, rate)}

    def powers(self, now: Instant, u: FloatArray, v: FloatArray) -> dict[str, float]:
        """Power of their forces, weight included, W."""
        q, rate = u[self.coordinates].ravel(), v[self.coordinates].ravel()
        return {"rigid_forces": float(rate @ self.loads.force(now, q, rate))}

    def weight_energy(self, rigid: FloatArray) -> float:
        """Energy of the weights, J."""
        total = 0.0
        for number, body in enumerate(self.bodies):
            q = rigid[number]
            arm = body.arms(np.asarray(body.centre))
            total -= body.mass * float(plane.displacement(arm, q)[0] @ self._gravity)
        return total

    def momentum(self, rigid: FloatArray, rate: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Momentum, N s, and angular momentum about the origin, N m s; each of shape (3,)."""
        linear, angular = np.zeros((2, 3))
        for number, body in enumerate(self.bodies):
            q, v = rigid[number], rate[number]
            arm = body.arms(np.asarray(body.centre))
            place = np.asarray(body.centre) + plane.displacement(arm, q)[0]
            own = body.mass * plane.jacobian(arm, q)[0] @ v
            linear += own
            angular += np.cross(place, own)
            angular[1] += body.inertia * v[2]
        return linear, angular
