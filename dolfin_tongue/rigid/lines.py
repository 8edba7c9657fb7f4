"""Forces of all lines of a scene at once; `Loads` has their tangents, which are needed rarely."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.rigid import plane
from dolfin_tongue.rigid.body import RigidBody
from dolfin_tongue.rigid.forces import SKULL, Line

STILL = np.zeros(3)


class Lines:
    """Springs and muscles between points of bodies and the skull.

    Parameters
    ----------
    bodies : the rigid bodies.
    lines : each with the body of its first point.
    """

    def __init__(self, bodies: Sequence[RigidBody], lines: Sequence[tuple[RigidBody, Line]]):
        self.count, self.lines = 3 * len(bodies), [line for _, line in lines]
        names = {body.name: number for number, body in enumerate(bodies)}
        references = [*(body.reference for body in bodies), np.zeros(3)]
        owners = [(names[body.name], names.get(line.to, len(bodies))) for body, line in lines]
        points = np.array([(line.point, line.anchor) for line in self.lines], dtype=float)
        #: Body of both ends, (l, 2); the skull is one more body, which stays where it is.
        self._owners = np.array(owners)
        self._arms = points - np.array(references)[self._owners]
        self._apart = points[:, 1] - points[:, 0]
        assert all(line.to == SKULL or line.to in names for line in self.lines)

    def force(self, time: float, q: FloatArray, v: FloatArray) -> FloatArray:
        """Sum forces on the coordinates, shape (3b,), N and N m: -tension times d(length)/dq."""
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
        rate = (slope * v).sum(axis=(1, 2))
        tension = np.array(
            [
                line.tension(time, float(x), float(y))[0]
                for line, x, y in zip(self.lines, length, rate, strict=True)
            ]
        )
        push = -tension[:, None, None] * slope
        places = 3 * self._owners[..., None] + np.arange(3)
        return np.bincount(places.ravel(), push.ravel(), self.count + 3)[: self.count]
