"""What contact may do in a step of the implicit method: nothing passes, no energy is made."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dolfin_tongue.arrays import FloatArray
from dolfin_tongue.direct.model import Model
from dolfin_tongue.errors import BadScene

#: Energy that contact may make by errors of a method, over the largest energy so far, kinetic and
#: stored in contacts.
GAIN = 1e-3
#: Time after which that is forgotten, s, so that a body that presses for long is not refused.
MEMORY = 0.1


class Refused(Exception):
    """A step after which a point is behind an obstacle, or in which contact makes energy."""


class Impacts:
    """Book-keeping of the contacts of one run.

    Parameters
    ----------
    model : with its obstacles.
    """

    def __init__(self, model: Model):
        self.model = model
        self.obstacles = [obstacle for _, obstacle in model.obstacles]
        #: Impulses on the tissue since the beginning of the run, shape (obstacles, 3), N s.
        self.impulses = np.zeros((len(self.obstacles), 3))
        self._largest = self._made = 0.0

    @property
    def names(self) -> str:
        """What messages call the contacts."""
        return ", ".join(obstacle.name for obstacle in self.obstacles)

    def forces(self, time: float, u: FloatArray, v: FloatArray) -> list[FloatArray]:
        """Nodal forces of each obstacle, shape (n, 3), N."""
        result = []
        for obstacle in self.obstacles:
            force = np.zeros_like(u)
            obstacle.add_force(time, self.model.mesh.points + u, v, force)
            result.append(force)
        return result

    def passed(self, time: float, u: FloatArray) -> str:
        """Which obstacle a point has reached or passed, in words; empty if none."""
        for obstacle in self.obstacles:
            if obstacle.impassable:
                gap = obstacle.smallest_gap(time, self.model.mesh.points + u)
                if not gap > 0:
                    return f"a point would be {-gap:.2g} m behind the obstacle; {obstacle.name}"
        return ""

    def near(self, time: float, u: FloatArray) -> bool:
        """Whether a point is within the range of a contact."""
        x = self.model.mesh.points + u
        return any(obstacle.smallest_gap(time, x) < np.inf for obstacle in self.obstacles)

    def made(
        self,
        h: float,
        times: tuple[float, float],
        u: tuple[FloatArray, FloatArray],
        v: tuple[FloatArray, FloatArray],
        forces: tuple[list[FloatArray], list[FloatArray]],
        impulses: list[FloatArray],
    ) -> float:
        """Energy that contact made in a step, J: work on the body and on the obstacle, and stored.

        The work of the impulses J on the body is J.(v_0 + v_1)/2, exactly: it is what they add to
        the kinetic energy. The part of the force that lasts over the step, though, balances others,
        like a load: its work is that along the path, as theirs is.
        """
        total, x = 0.0, self.model.mesh.points
        pairs = zip(*forces, strict=True)
        for obstacle, pair, impulse in zip(self.obstacles, pairs, impulses, strict=True):
            if not impulse.any():
                continue
            path, mean = u[1] - u[0], 0.5 * h * (v[0] + v[1])
            moved = obstacle.term.shift(times[1])[0] - obstacle.term.shift(times[0])[0]
            total += float(np.sum(impulse * (mean - moved))) / h
            total += float(np.sum(lasting(*pair) * (path - mean)))
            total += obstacle.energy(times[1], x + u[1]) - obstacle.energy(times[0], x + u[0])
        return total

    def begin(self, time: float, u: FloatArray, v: FloatArray) -> None:
        """Take a state as a new beginning; BadScene where it is behind an obstacle."""
        if cause := self.passed(time, u):
            raise BadScene(f"t = {time:.6g} s, the beginning: {cause}")
        self._largest = max(self._largest, self._energy(time, u, v))

    def explicit(
        self,
        h: float,
        new: tuple[float, FloatArray, FloatArray],
        stages: Sequence[tuple[float, FloatArray, FloatArray]],
        weights: Sequence[float],
    ) -> None:
        """Count a step of an explicit method, from its stages (time, u, v); or raise Refused."""
        time, u, v = new
        if cause := self.passed(time, u):
            raise Refused(cause)
        first = stages[0]
        if not (self.near(time, u) or self.near(*first[:2])):
            return
        forces = [self.forces(*stage) for stage in stages]
        impulses = [
            sum((h * weight * part[i] for weight, part in zip(weights, forces, strict=True)), 0 * u)
            for i in range(len(self.obstacles))
        ]
        ends = (forces[0], self.forces(*new))
        made = self.made(h, (first[0], time), (first[1], u), (first[2], v), ends, impulses)
        if not self.affordable(made):
            raise Refused(f"it would make {made:.2g} J of energy; {self.names}")
        self.accept(h, new, made, impulses)

    def _energy(self, time: float, u: FloatArray, v: FloatArray) -> float:
        """Kinetic energy, and that stored in contacts, J."""
        kinetic = 0.5 * float(np.sum(v * (self.model.mass @ v)))
        x = self.model.mesh.points + u
        return kinetic + sum(obstacle.energy(time, x) for obstacle in self.obstacles)

    def affordable(self, made: float) -> bool:
        """Whether so much made energy is within what errors may make in all."""
        return self._made + made <= GAIN * self._largest

    def accept(
        self,
        h: float,
        new: tuple[float, FloatArray, FloatArray],
        made: float,
        impulses: list[FloatArray],
    ) -> None:
        """Count a step; what it lost is not there to be made later."""
        time, u, v = new
        self._made = max(0.0, self._made + made) * np.exp(-h / MEMORY)
        self._largest = max(self._largest, self._energy(time, u, v))
        for total, impulse in zip(self.impulses, impulses, strict=True):
            total += impulse.sum(axis=0)


def lasting(first: FloatArray, last: FloatArray) -> FloatArray:
    """Return the part of nodal forces, shape (n, 3), that two instants have in common."""
    squares = [np.sum(force**2, axis=1) for force in (first, last)]
    common = np.clip(np.sum(first * last, axis=1), 0.0, None)
    larger = np.where((squares[0] > squares[1])[:, None], first, last)
    return (common / np.maximum(np.maximum(*squares), 1e-300))[:, None] * larger
