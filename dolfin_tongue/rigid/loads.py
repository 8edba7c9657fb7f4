"""Inertia and forces of rigid bodies in their coordinates: M, I, F and N of (61), (62).

With the centre of mass at the arm r from the reference point, its acceleration is
x'' + angle'' r' - angle'^2 r (' of r by the angle), so that the inertia force on the coordinates is
T^T m (T q'' + angle'^2 d2r) + I angle''.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.control import Instant
from dolfin_tongue.rigid import plane
from dolfin_tongue.rigid.body import RigidBody
from dolfin_tongue.rigid.forces import SKULL, Line, OwnForce, PointForce, RigidForce
from dolfin_tongue.rigid.lines import Lines


def as_vector(values: FloatArray) -> tuple[float, float, float]:
    """Turn an array into a vector of floats."""
    x, y, z = (float(value) for value in values)
    return x, y, z


class Loads:
    """Everything that acts on a set of rigid bodies but their tissue.

    All arrays run over 3 b coordinates, body after body.

    Parameters
    ----------
    bodies : the rigid bodies.
    gravity : m/s2, shape (3,); the sum of the scene's.
    """

    def __init__(self, bodies: Sequence[RigidBody], gravity: FloatArray):
        self.bodies, self.count = tuple(bodies), 3 * len(bodies)
        self._places = {body.name: slice(3 * i, 3 * i + 3) for i, body in enumerate(bodies)}
        self._centres = [body.arms(np.asarray(body.centre)) for body in bodies]
        self._arms = np.concatenate(self._centres)
        self._masses = np.array([body.mass for body in bodies])
        self._inertias = np.array([body.inertia for body in bodies])
        weights = [PointForce(body.centre, as_vector(body.mass * gravity)) for body in bodies]
        forces: list[tuple[RigidBody, str, RigidForce]] = [
            (body, name, force) for body in bodies for name, force in body.named_forces
        ]
        if np.any(gravity):
            forces += [(b, "weight", weight) for b, weight in zip(bodies, weights, strict=True)]
        self._own = [(b, name, x) for b, name, x in forces if isinstance(x, OwnForce)]
        self._line_parts = [(b, name, x) for b, name, x in forces if isinstance(x, Line)]
        self._lines = Lines(bodies, self._line_parts) if self._line_parts else None

    # -- inertia -------------------------------------------------------------------------------

    def mass(self, q: FloatArray) -> FloatArray:
        """Mass matrix, shape (3b, 3b), kg, kg m and kg m2."""
        matrix = np.zeros((self.count, self.count))
        for body, arm, at in self._each():
            T = plane.jacobian(arm, q[at])[0]
            matrix[at, at] = body.mass * T.T @ T
            matrix[at.start + 2, at.start + 2] += body.inertia
        return matrix

    def inertia(self, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        """Inertia force on the coordinates, shape (3b,), N and N m."""
        q, v, a = (x.reshape(-1, 3) for x in (q, v, a))
        r, rate, turn = plane.turned(self._arms, q[:, 2]), v[:, 2] ** 2, a[:, 2]
        force = np.empty_like(q)
        force[:, 0] = self._masses * (a[:, 0] + turn * r[:, 2] - rate * r[:, 0])
        force[:, 1] = self._masses * (a[:, 1] - turn * r[:, 0] - rate * r[:, 2])
        force[:, 2] = self._inertias * turn + r[:, 2] * force[:, 0] - r[:, 0] * force[:, 1]
        return force.ravel()

    def inertia_tangents(
        self, q: FloatArray, v: FloatArray, a: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the derivatives of `inertia` by q and v, (3b, 3b) each; that by a is `mass`."""
        by_q, by_v = np.zeros((2, self.count, self.count))
        for body, arm, at in self._each():
            T, bent = plane.jacobian(arm, q[at])[0], plane.bend(arm, q[at])[0]
            rate, angle = v[at][2], at.start + 2
            acceleration = T @ a[at] + rate**2 * bent
            # d(bent)/d(angle) = -T[:, angle], and only the angle's column of T turns
            by_angle = T.T @ (bent * a[at][2] - rate**2 * T[:, 2])
            by_angle[2] += bent @ acceleration
            by_q[at, angle] = body.mass * by_angle
            by_v[at, angle] = 2.0 * body.mass * rate * T.T @ bent
        return by_q, by_v

    def kinetic_energy(self, q: FloatArray, v: FloatArray) -> float:
        """Kinetic energy, J."""
        return 0.5 * float(v @ self.mass(q) @ v)

    # -- forces --------------------------------------------------------------------------------

    def force(self, now: Instant, q: FloatArray, v: FloatArray) -> FloatArray:
        """Return the forces on the coordinates, shape (3b,), N and N m."""
        out = self._lines.force(now, q, v) if self._lines else np.zeros(self.count)
        for body, name, force in self._own:
            at = self._places[body.name]
            own = now.of(body.label).of(name)
            out[at] += force.generalised(own, q[at], v[at], body.reference)
        return out

    def muscles(
        self, now: Instant, q: FloatArray, v: FloatArray
    ) -> dict[tuple[str, str], tuple[float, float]]:
        """Activation and force, N, of each muscle as a line, by the names of body and force."""
        return self._lines.muscles(now, q, v) if self._lines else {}

    def force_tangents(
        self, now: Instant, q: FloatArray, v: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the derivatives of `force` by q and v, shape (3b, 3b) each."""
        by_q, by_v = np.zeros((2, self.count, self.count))
        for body, name, force in self._own:
            at, own = self._places[body.name], now.of(body.label).of(name)
            own_q, own_v = force.tangents(own, q[at], v[at], body.reference)
            by_q[at, at] += own_q
            by_v[at, at] += own_v
        for body, name, line in self._line_parts:
            line_q, line_v = self._line_tangents(body, line, now.of(body.label).of(name), q, v)
            by_q += line_q
            by_v += line_v
        return by_q, by_v

    def _line_tangents(
        self, body: RigidBody, line: Line, now: Instant, q: FloatArray, v: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the derivatives of -T d(length)/dq with the tension T (length, length rate)."""
        ends = [(body.name, line.point, -1.0), (line.to, line.anchor, 1.0)]
        apart, rate = np.subtract(line.anchor, line.point), np.zeros(3)
        apart_q = np.zeros((3, self.count))  # d(apart)/dq
        bends: list[tuple[int, FloatArray]] = []
        for name, point, sign in ends:
            if name == SKULL:
                continue
            at, arm = self._places[name], self._body(name).arms(np.asarray(point))
            T = sign * plane.jacobian(arm, q[at])[0]
            apart = apart + sign * plane.displacement(arm, q[at])[0]
            rate = rate + T @ v[at]
            apart_q[:, at] = T
            bends.append((at.start + 2, sign * plane.bend(arm, q[at])[0]))
        length = float(np.linalg.norm(apart))
        n = apart / length
        tension, by_length, by_rate = line.tension(now, length, float(n @ rate))
        slope = n @ apart_q  # d(length)/dq, also d(length rate)/dv
        across = (apart_q - np.outer(n, slope)) / length  # dn/dq
        second, rate_slope = apart_q.T @ across, rate @ across
        for angle, bent in bends:
            second[angle, angle] += n @ bent
            rate_slope[angle] += n @ bent * v[angle]
        by_q = -np.outer(slope, by_length * slope + by_rate * rate_slope) - tension * second
        return by_q, -by_rate * np.outer(slope, slope)

    def _body(self, name: str) -> RigidBody:
        return next(body for body in self.bodies if body.name == name)

    def _each(self) -> list[tuple[RigidBody, FloatArray, slice]]:
        return list(zip(self.bodies, self._centres, self._places.values(), strict=True))
