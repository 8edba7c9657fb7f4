"""Energies, works and their balance over a motion, asked of the solver that made it."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf, nextafter
from typing import Any

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.body.state import State
from dolfin_tongue.control import Instant
from dolfin_tongue.march.solver import Observer
from dolfin_tongue.scene.scene import Scene


class EnergyAudit:
    """Energies, works and their balance over a motion.

    The energies (kinetic, and one per term that has an energy) are evaluated at accepted
    states. The works are time integrals of the power that each other term gives to the motion:
    positive work was done *on* the body. They are integrated by Simpson's rule, with the cubic
    Hermite path of displacement and velocity in between, so that their own error (order 4) does not
    hide that of time stepping. A sudden activation has one power before and another after the jump;
    both are evaluated. The balance error

        (kinetic + potential energies) - (their start) - (works)

    is what time stepping loses; it falls with dt^2.

    Parameters
    ----------
    observer : the solver.
    scene : what moves.
    """

    def __init__(self, observer: Observer, scene: Scene):
        self._observer, self._scene, self._jumps = observer, scene, set(scene.jumps)
        self.works: dict[str, float] = {}
        self.exchanged = 0.0
        self._start: float | None = None
        self._before: State | None = None
        self._powers: Mapping[str, float] = {}

    def update(self, state: State) -> dict[str, float]:
        """Account for a newly accepted state.

        Returns
        -------
        dict -- energies and works so far, and the balance error, J.
        """
        first, at_jump = self._before or state, state.time in self._jumps
        # what acted in the step: before a jump at its end, with the memory of its begin
        time = nextafter(state.time, -inf) if at_jump else state.time
        powers = self._observer.powers(state, Instant(time, first.memory))
        if self._before is None:
            self.works = dict.fromkeys(powers, 0.0)
            if self._scene.moves_supports:
                self.works["supports"] = 0.0
        else:
            self._add_works(self._before, state, powers)
        same = not at_jump and state.memory is first.memory
        self._powers = powers if same else self._observer.powers(state)
        self._before = state
        energies = self._observer.energies(state)
        total = sum(energies.values())
        if self._start is None:
            self._start = total
        balance = total - self._start - sum(self.works.values())
        record = {f"{name}_J": value for name, value in energies.items()}
        record |= {f"work_{name}_J": value for name, value in self.works.items()}
        return record | {"balance_J": balance, "exchanged_J": self.exchanged}

    def _add_works(self, first: State, last: State, powers: Mapping[str, float]) -> None:
        """Add the works of a step."""
        middle = hermite_middle(first, last)
        in_between = self._observer.powers(middle)
        works = {
            name: last.step / 6 * (self._powers[name] + 4 * in_between[name] + power)
            for name, power in powers.items()
        }
        if self._scene.moves_supports:
            works["supports"] = self._observer.support_work(first, last, middle)
        for name, work in works.items():
            self.works[name] += work
            self.exchanged += abs(work)

    def account(self) -> dict[str, Any]:
        """Return what has to be kept to continue the account in a resumed run."""
        return {"start": self._start, "exchanged": self.exchanged, "works": self.works}

    def restore(self, account: Mapping[str, Any], state: State) -> None:
        """Continue the account of an earlier run at its last state."""
        self._start, self.exchanged = account["start"], account["exchanged"]
        self.works = dict(account["works"])
        self._before = state
        self._powers = self._observer.powers(state)


def hermite_middle(first: State, second: State) -> State:
    """State in the middle of a step, on the cubic path through both ends and their velocities.

    Its memory is that of the begin, with which the step was made.
    """

    def middle(x0: FloatArray, x1: FloatArray, v0: FloatArray, v1: FloatArray) -> tuple:
        return (x0 + x1) / 2 + dt / 8 * (v0 - v1), 1.5 * (x1 - x0) / dt - (v0 + v1) / 4

    dt = second.time - first.time
    displacement, velocity = middle(
        first.displacement, second.displacement, first.velocity, second.velocity
    )
    unknowns = None
    if first.unknowns and second.unknowns:
        (y0, v0), (y1, v1) = first.unknowns, second.unknowns
        unknowns = middle(y0, y1, v0, v1)
    rigid = middle(first.rigid, second.rigid, first.rigid_rate, second.rigid_rate)
    pressure = (first.pressure + second.pressure) / 2
    return State(
        first.time + dt / 2, displacement, velocity, pressure, dt / 2, 0, unknowns,
        rigid[0], rigid[1], (first.sliding + second.sliding) / 2, memory=first.memory,
    )  # fmt: skip
