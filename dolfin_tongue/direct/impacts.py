"""What contact may do in a step of the implicit method: nothing passes, no energy is made."""

from __future__ import annotations

import numpy as np

from dolfin_tongue.arrays import FloatArray
from dolfin_tongue.direct.model import Model

#: Energy that contact may make by errors of TR-BDF2, over the largest kinetic energy so far.
GAIN = 1e-3


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
        self._kinetic = self._made = 0.0

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
                gap = obstacle.gap(time, self.model.mesh.points + u).distance
                if not gap.min() > 0:
                    return f"{obstacle.name}: a point is {-gap.min():.2g} m behind the obstacle"
        return ""

    def made(
        self,
        h: float,
        times: tuple[float, float],
        u: tuple[FloatArray, FloatArray],
        v: tuple[FloatArray, FloatArray],
        impulses: list[FloatArray],
    ) -> float:
        """Energy that contact made in a step, J: work on the body and on the obstacle, and stored.

        The work of the impulses J on the body is J.(v_0 + v_1)/2, exactly: it is what they add to
        the kinetic energy.
        """
        total, x = 0.0, self.model.mesh.points
        for obstacle, impulse in zip(self.obstacles, impulses, strict=True):
            if not impulse.any():
                continue
            moved = obstacle.term.shift(times[1])[0] - obstacle.term.shift(times[0])[0]
            total += 0.5 * float(np.sum(impulse * (v[0] + v[1])))
            total -= float(impulse.sum(axis=0) @ moved) / h
            total += obstacle.energy(times[1], x + u[1]) - obstacle.energy(times[0], x + u[0])
        return total

    def begin(self, v: FloatArray) -> None:
        """Take a velocity as a new beginning."""
        self._kinetic = max(self._kinetic, self._kinetic_energy(v))

    def _kinetic_energy(self, v: FloatArray) -> float:
        return 0.5 * float(np.sum(v * (self.model.mass @ v)))

    def affordable(self, made: float) -> bool:
        """Whether so much made energy is within what errors may make in all."""
        return self._made + made <= GAIN * self._kinetic

    def accept(self, v: FloatArray, made: float, impulses: list[FloatArray]) -> None:
        """Count a step; what it lost is not there to be made later."""
        self._made = max(0.0, self._made + made)
        self._kinetic = max(self._kinetic, self._kinetic_energy(v))
        for total, impulse in zip(self.impulses, impulses, strict=True):
            total += impulse.sum(axis=0)
