"""Forces of all lines of a scene at once; `Loads` has their tangents, which are needed rarely."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dolfin_tongue.base.arrays import FloatArray, sums_at
from dolfin_tongue.control import Instant
from dolfin_tongue.rigid import plane
from dolfin_tongue.rigid.body import RigidBody
from dolfin_tongue.rigid.forces import SKULL, Line, LineMuscle

STILL = np.zeros(3)


class Lines:
    """Springs and muscles between points of bodies and the skull.

    Parameters
    ----------
    bodies : the rigid bodies.
    lines : each with the body of its first point and its name there.
    """

    def __init__(self, bodies: Sequence[RigidBody], lines: Sequence[tuple[RigidBody, str, Line]]):
        self.count, self.lines = 3 * len(bodies), [line for _, _, line in lines]
        self.names = [(body.label, name) for body, name, _ in lines]
        names = {body.name: number for number, body in enumerate(bodies)}
        references = [*(body.reference for body in bodies), np.zeros(3)]
        owners = [(names[body.name], names.get(line.to, len(bodies))) for body, _, line in lines]
        points = np.array([(line.point, line.anchor) for line in self.lines], dtype=float)
        #: Body of both ends, (l, 2); the skull is one more body, which stays where it is.
        self._owners = np.array(owners)
        self._arms = points - np.array(references)[self._owners]
        self._apart = points[:, 1] - points[:, 0]
        assert all(line.to == SKULL or line.to in names for line in self.lines)

    def _geometry(self, q: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Lengths, m, and their rates, m/s, shape (l,); d(length)/dq of both ends, (l, 2, 3)."""
        q, v = (np.append(x, STILL).reshape(-1, 3)[self._owners] for x in (q, v))
        flat = self._arms.reshape(-1, 3)
        r = plane.turned(flat, q[..., 2].ravel()).reshape(self._arms.shape)
        moved = r - self._arms
        moved[..., 0] += q[..., 0]
        moved[..., 2] += q[..., 1]
        apart = self._apart + moved[:, 1] - moved[:, 0]
        length = np.sqrt((apart**2).sum(axis=1))
        n = (apart / length[:, None])[:, None] * np.array([-1.0, 1.0])[:, None]
        slope = np.stack(
            [n[..., 0], n[..., 2], n[..., 0] * r[..., 2] - n[..., 2] * r[..., 0]], axis=-1
        )
        return length, (slope * v).sum(axis=(1, 2)), slope

    def tensions(self, now: Instant, length: FloatArray, rate: FloatArray) -> FloatArray:
        """Tension of each line, shape (l,), N."""
        values = []
        for number, line in enumerate(self.lines):
            body, name = self.names[number]
            own = now.of(body).of(name)
            values.append(line.tension(own, float(length[number]), float(rate[number]))[0])
        return np.array(values)

    def force(self, now: Instant, q: FloatArray, v: FloatArray) -> FloatArray:
        """Sum forces on the coordinates, shape (3b,), N and N m: -tension times d(length)/dq."""
        length, rate, slope = self._geometry(q, v)
        push = -self.tensions(now, length, rate)[:, None, None] * slope
        places = 3 * self._owners[..., None] + np.arange(3)
        return sums_at(places, push, self.count + 3)[: self.count]

    def muscles(
        self, now: Instant, q: FloatArray, v: FloatArray
    ) -> dict[tuple[str, str], tuple[float, float]]:
        """Activation and force, N, of each muscle among the lines, by body and own name."""
        length, rate, _ = self._geometry(q, v)
        each = zip(self.names, self.lines, self.tensions(now, length, rate), strict=True)
        return {
            (body, name): (line.level(now.of(body).of(name)), float(force))
            for (body, name), line, force in each
            if isinstance(line, LineMuscle)
        }
