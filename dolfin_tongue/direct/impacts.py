"""What contact may do in a step: nothing passes an obstacle, and no energy is made.

The energy that contact makes in a step with the impulses J (time integrals of its nodal forces by
the method's own weights) is

    J.(V_0 + V_1)/2 - (sum of J).(s_1 - s_0)/h + psi_1 - psi_0:

what J adds to the kinetic energy (exactly that, since M (V_1 - V_0) = J + other impulses), less the
work of the obstacle that moves by s, plus what is stored. It is not positive in nature, and an
error of the method where it is. `Impacts.judge` lets such errors add up to `GAIN` of the energy.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.base.errors import BadScene
from dolfin_tongue.control import Instant
from dolfin_tongue.direct.model import Model

#: Energy that contact may make by errors of a method, over the largest energy so far, kinetic and
#: stored in contacts.
GAIN = 1e-2
#: Time after which that is forgotten, s, so that a body that presses for long is not refused.
MEMORY = 0.1
#: Factor by which a gap within the range may change in a step of an explicit method.
LEAP = 2.0


class Refused(Exception):
    """A step after which a point is behind an obstacle, or in which contact makes energy."""


@dataclass(frozen=True, eq=False)
class Moment:
    """A stage or an end of a step.

    Parameters
    ----------
    now : time and memory.
    u, v : displacement and velocity, shape (N, 3).
    forces : nodal forces of each obstacle, shape (N, 3), N, as they act in the method.
    """

    now: Instant
    u: FloatArray
    v: FloatArray
    forces: list[FloatArray]


class Impacts:
    """Book-keeping of the contacts of one run.

    Parameters
    ----------
    model : with its obstacles.
    """

    def __init__(self, model: Model):
        self.model = model
        self.obstacles = model.obstacles
        #: Impulses on the tissue since the beginning of the run, shape (obstacles, 3), N s.
        self.impulses = np.zeros((len(self.obstacles), 3))
        self._largest = self._made = 0.0
        self._pending: tuple[Moment, float, float, FloatArray] | None = None

    @property
    def names(self) -> str:
        """What messages call the contacts."""
        return ", ".join(obstacle.name for obstacle in self.obstacles)

    def moment(self, now: Instant, u: FloatArray, v: FloatArray) -> Moment:
        """Evaluate the contacts at a state."""
        forces = []
        for obstacle in self.obstacles:
            forces.append(np.zeros_like(u))
            obstacle.add_force(self.model.at(now, u, v), forces[-1])
        return Moment(now, u, v, forces)

    def passed(self, now: Instant, u: FloatArray) -> str:
        """Which obstacle a point has reached or passed, in words; empty if none."""
        for obstacle in self.obstacles:
            if obstacle.impassable:
                gap = obstacle.smallest_gap(now, self.model.position(u))
                if not gap > 0:
                    return f"a point would be {-gap:.2g} m behind the obstacle; {obstacle.name}"
        return ""

    def near(self, now: Instant, u: FloatArray) -> bool:
        """Whether a point is within the range of a contact."""
        x = self.model.position(u)
        return any(obstacle.smallest_gap(now, x) < np.inf for obstacle in self.obstacles)

    def begin(self, now: Instant, u: FloatArray, v: FloatArray) -> None:
        """Take a state as a new beginning; BadScene where it is behind an obstacle."""
        if not self.obstacles:
            return
        if cause := self.passed(now, u):
            raise BadScene(f"t = {now.time:.6g} s, the beginning: {cause}")
        self._largest = max(self._largest, self._energy(now, u, v))

    def forget(self) -> None:
        """Drop the step that was judged last."""
        self._pending = None

    def judge(
        self,
        h: float,
        first: Moment,
        last: Moment,
        stages: Sequence[tuple[float, Moment]],
        dissipates: bool = False,
    ) -> str:
        """Why a step is not to be accepted, in words; empty if it may be, by `accept`.

        Parameters
        ----------
        h : step, s.
        first, last : its ends.
        stages : with the weights of their forces in the velocity.
        dissipates : the method makes no energy; only the gaps are asked for.
        """
        if cause := self.passed(last.now, last.u):
            return cause
        made, total = 0.0, np.zeros_like(self.impulses)
        for number in range(len(self.obstacles)):
            impulse = np.zeros_like(first.u)
            for weight, stage in stages:
                impulse += h * weight * stage.forces[number]
            if impulse.any():
                made += self._made_by(number, h, first, last, impulse)
                total[number] = impulse.sum(axis=0)
        if not dissipates and self._made + made > GAIN * self._largest:
            return f"it would make {made:.2g} J of energy; {self.names}"
        self._pending = (last, h, made, total)
        return ""

    def _made_by(
        self, number: int, h: float, first: Moment, last: Moment, impulse: FloatArray
    ) -> float:
        """Energy that one contact makes in a step, J.

        The part of the force that lasts over the step balances others, like a load: its work is
        that along the path, as theirs is, and not that of the mean velocity.
        """
        obstacle, x = self.obstacles[number], self.model.position
        path, mean = last.u - first.u, 0.5 * h * (first.v + last.v)
        moved = obstacle.term.shift(last.now.time)[0] - obstacle.term.shift(first.now.time)[0]
        work = float(np.sum(impulse * (mean - moved))) / h
        steady = lasting(first.forces[number], last.forces[number])
        work += float(np.sum(steady * (path - mean)))
        stored = obstacle.energy(last.now, x(last.u)) - obstacle.energy(first.now, x(first.u))
        return work + stored

    def accept(self) -> None:
        """Count the step that was judged last; what it lost is not there to be made later."""
        if self._pending is not None:
            last, h, made, impulses = self._pending
            self._made = max(0.0, self._made + made) * np.exp(-h / MEMORY)
            self._largest = max(self._largest, self._energy(last.now, last.u, last.v))
            self.impulses += impulses
            self._pending = None

    def _energy(self, now: Instant, u: FloatArray, v: FloatArray) -> float:
        """Kinetic energy, and that stored in contacts, J."""
        kinetic = 0.5 * float(np.sum(v * (self.model.whole_mass @ v)))
        x = self.model.position(u)
        return kinetic + sum(obstacle.energy(now, x) for obstacle in self.obstacles)

    def _leaps(self, stages: Sequence[tuple[Instant, FloatArray, FloatArray]]) -> str:
        """Where a gap changes too much from the first stage to be resolved; empty if nowhere."""
        for obstacle in self.obstacles:
            if obstacle.impassable:
                gaps = [obstacle.clipped_gaps(t, self.model.position(u)) for t, u, _ in stages]
                least, most = np.min(gaps, axis=0), np.max(gaps, axis=0)
                if not (most <= LEAP * least).all():
                    return f"a gap would change by more than a factor {LEAP:g}; {obstacle.name}"
        return ""

    def explicit(
        self,
        h: float,
        new: tuple[Instant, FloatArray, FloatArray],
        stages: Sequence[tuple[Instant, FloatArray, FloatArray]],
        weights: Sequence[float],
    ) -> None:
        """Judge a step of an explicit method, from its stages (instant, u, v); or raise Refused."""
        self._pending = None
        if cause := self.passed(new[0], new[1]):
            raise Refused(cause)
        if not (self.near(*new[:2]) or self.near(*stages[0][:2])):
            return
        if cause := self._leaps([*stages, new]):
            raise Refused(cause)
        parts = [self.moment(*stage) for stage in stages]
        weighted = list(zip(weights, parts, strict=True))
        if cause := self.judge(h, parts[0], self.moment(*new), weighted):
            raise Refused(cause)


def lasting(first: FloatArray, last: FloatArray) -> FloatArray:
    """Return the part of nodal forces, shape (n, 3), that two instants have in common."""
    squares = [np.sum(force**2, axis=1) for force in (first, last)]
    common = np.clip(np.sum(first * last, axis=1), 0.0, None)
    larger = np.where((squares[0] > squares[1])[:, None], first, last)
    return (common / np.maximum(np.maximum(*squares), 1e-300))[:, None] * larger
