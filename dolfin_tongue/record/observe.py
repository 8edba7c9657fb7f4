"""What is observed of a motion: volumes, energies, works and their balance, landmarks."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, nextafter
from typing import Any

import basix
import basix.ufl
import numpy as np
import ufl
from dolfinx import fem

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.body.body import Body
from dolfin_tongue.body.shape import gauss_jacobians
from dolfin_tongue.boundary.attached import Attached
from dolfin_tongue.fenicsx.compile import compile_form
from dolfin_tongue.fenicsx.couplings import Arguments, ContactSurface
from dolfin_tongue.fenicsx.system import System
from dolfin_tongue.march.state import State
from dolfin_tongue.terms.term import labels_of


def volume_changes(body: Body, displacement: FloatArray) -> FloatArray:
    """Relative volume change of every cell, shape (m,), from the node positions alone."""
    return gauss_jacobians(body.points + displacement, body.cells).sum(axis=1) / body.volumes - 1


def local_volume_ratios(system: System, state: State) -> FloatArray:
    """Det F at the quadrature points of any pair of spaces, shape (DOLFINx cells, points).

    For Q1/P0 these are the values of `shape.volume_ratios`, in the order of DOLFINx' cells.
    """
    system.state.x.array[:] = system.vectors(state)[0]
    grid = system.space.mesh
    cell = basix.CellType[grid.topology.cell_name()]
    points, _ = basix.make_quadrature(cell, system.space.pair.quadrature_degree)
    jacobian = ufl.det(ufl.Identity(3) + ufl.grad(ufl.split(system.state)[0]))
    cells = np.arange(len(system.space.parents), dtype=np.int32)
    return fem.Expression(jacobian, points).eval(grid, cells)


def landmark_positions(body: Body, state: State) -> dict[str, FloatArray]:
    """Position of each landmark, shape (3,), m."""
    return {
        name: body.points[node] + state.displacement[node] for name, node in body.landmarks.items()
    }


def contact_pressures(system: System, state: State) -> dict[str, FloatArray]:
    """Pressure of each contact at the nodes, shape (n,), Pa, by the name it has in the table."""
    y, rate = system.vectors(state)
    system.set_state(state.time, y, rate, np.zeros_like(rate), y)
    at = system.arguments(state.time)
    for coupling in system.couplings:
        coupling.begin(state.time, y)
    parts = [part for part in system.couplings if isinstance(part, ContactSurface)]
    return {part.label: part.pressure_map(at) for part in parts}


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
    system : a dynamic system.
    """

    def __init__(self, system: System):
        self._system = system
        terms = system.terms_in_form
        self._jumps = set(system.scene.jumps)
        kin = system.kinematics(system.state, system.rate)
        velocity = kin.velocity
        density = system.number(system.scene.body.density)
        parts = {"kinetic": density / 2 * ufl.inner(velocity, velocity) * system.dx}
        names = labels_of(terms)
        for term, name in zip(terms, names, strict=True):
            energy = term.energy(kin, system.fields)
            if energy is not None:
                parts[name] = energy
        self._form_energies, self._couplings = len(parts), system.couplings
        self._energies = self._cell_integrals(list(parts.values()))
        powers = {
            name: term.virtual_power(kin, system.fields, velocity)
            for term, name in zip(terms, names, strict=True)
            if name not in parts
        }
        self._form_powers = len(powers)
        self._powers = self._cell_integrals(list(powers.values()))
        at = self._set(system.state_of(0.0, *np.zeros((2, system.size))), 0.0)
        coupled = [(c.energies(at), c.powers(at)) for c in self._couplings]
        self.energy_names = (*parts, *(name for energies, _ in coupled for name in energies))
        self.work_names = (*powers, *(name for _, works in coupled for name in works))
        self.works = dict.fromkeys(self.work_names, 0.0)
        self.exchanged = 0.0
        self._start: float | None = None
        self._before: State | None = None
        self._power_before = np.zeros(len(self.work_names))
        self._moves = any(body.given.any() for body in system.scene.rigid_bodies) or any(
            not isinstance(part, Attached) for part in system.scene.held
        )
        if self._moves:
            self.works["supports"] = 0.0

    def _cell_integrals(self, forms: Sequence[ufl.Form]) -> fem.Form | None:
        """All integrals at once, each into its own component of a cell-wise test function."""
        if not forms:
            return None
        count = len(forms)
        grid = self._system.space.mesh
        element = basix.ufl.element("DG", grid.topology.cell_name(), 0, shape=(max(2, count),))
        test = ufl.TestFunction(fem.functionspace(grid, element))
        total = ufl.Form([])
        for i, form in enumerate(forms):
            for integral in form.integrals():
                total += ufl.Form([integral.reconstruct(integrand=integral.integrand() * test[i])])
        return compile_form(total)

    def _evaluate(self, form: fem.Form | None, count: int) -> FloatArray:
        if form is None:
            return np.zeros(0)
        cells = len(self._system.space.parents)
        vector = np.zeros(cells * max(2, count))
        fem.assemble_vector(vector, form)
        return vector.reshape(cells, -1).sum(axis=0)[:count]

    def _set(self, state: State, time: float) -> Arguments:
        """Hand a state to the system, for its couplings too."""
        y, rate = self._system.vectors(state)
        self._system.set_state(time, y, rate, np.zeros_like(rate), y)
        return self._system.arguments(time)

    def powers(self, state: State, time: float) -> FloatArray:
        """Power that each rate term adds to the body (W), in the order of `work_names`."""
        at = self._set(state, time)
        power = -self._evaluate(self._powers, self._form_powers)
        return np.append(power, [p for c in self._couplings for p in c.powers(at).values()])

    def energies(self, state: State) -> FloatArray:
        """Energies, J, in the order of `energy_names`."""
        at = self._set(state, state.time)
        energy = self._evaluate(self._energies, self._form_energies)
        return np.append(energy, [e for c in self._couplings for e in c.energies(at).values()])

    def observed(self, state: State) -> dict[str, float]:
        """Return what the couplings show of a state: contact area, resultant."""
        if not self._couplings:
            return {}
        at = self._set(state, state.time)
        return {name: x for c in self._couplings for name, x in c.observed(at).items()}

    def _support_work(self, first: State, second: State, middle: State) -> float:
        """Work of supports that move, J: their forces in the middle of a step times the way.

        The acceleration there is the change of velocity, so that two states say everything.
        """
        system = self._system
        (y0, v0), (y1, v1) = system.vectors(first), system.vectors(second)
        y, _ = system.vectors(middle)
        dt = second.time - first.time
        system.set_state(middle.time, y, (y1 - y0) / dt, (v1 - v0) / dt, y)
        return system.support_work(middle.time, y1 - y0)

    def update(self, state: State) -> dict[str, float]:
        """Account for a newly accepted state.

        Returns
        -------
        dict -- energies and works so far, and the balance error, J.
        """
        for coupling in self._couplings:
            before = self._before or state
            coupling.begin(before.time, self._system.vectors(before)[0])
        jump = state.time in self._jumps
        power = self.powers(state, nextafter(state.time, -inf) if jump else state.time)
        if self._before is not None:
            middle = hermite_middle(self._before, state)
            power_middle = self.powers(middle, middle.time)
            work = state.step / 6 * (self._power_before + 4 * power_middle + power)
            self.exchanged += float(np.abs(work).sum())
            for name, value in zip(self.work_names, work, strict=True):
                self.works[name] += float(value)
            if self._moves:
                moved = self._support_work(self._before, state, middle)
                self.works["supports"] += moved
                self.exchanged += abs(moved)
        self._power_before = self.powers(state, state.time) if jump else power
        self._before = state
        energies = self.energies(state)
        total = float(energies.sum())
        if self._start is None:
            self._start = total
        balance = total - self._start - sum(self.works.values())
        named = zip(self.energy_names, energies, strict=True)
        record = {f"{name}_J": float(value) for name, value in named}
        record |= {f"work_{name}_J": value for name, value in self.works.items()}
        record |= {"balance_J": balance, "exchanged_J": self.exchanged}
        return record | self.observed(state)

    def memory(self) -> dict[str, Any]:
        """Return what has to be kept to continue the account in a resumed run."""
        return {
            "start": float(self._start or 0.0),
            "exchanged": self.exchanged,
            "works": list(self.works.values()),
        }

    def restore(self, memory: dict[str, Any], state: State) -> None:
        """Continue the account of an earlier run at its last state."""
        self._start, self.exchanged = memory["start"], memory["exchanged"]
        self.works = dict(zip(self.works, memory["works"], strict=True))
        self._before = state
        self._power_before = self.powers(state, state.time)


def hermite_middle(first: State, second: State) -> State:
    """State in the middle of a step, on the cubic path through both ends and their velocities."""

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
        rigid[0], rigid[1], (first.sliding + second.sliding) / 2,
    )  # fmt: skip
