"""Semi-discrete equations: M U'' = F(t, U, U') + G(U)^T lambda, A(U) = 0. There is no dt here.

F are all nodal forces (42), A the constraints (the volumes of the cells (91), sliding nodes) and
G = dA/dU (96). The multipliers are the pressures of the cells, positive in compression: -p J F^-T
in the first Piola-Kirchhoff stress gives the nodal force p dA/dU, and d'Alembert's form of (55)
adds lambda dA/dU.

Held nodes keep their rows in all arrays of shape (n, 3); `numbering` says which are free.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np
import scipy.sparse as sp

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.base.errors import OutOfRange
from dolfin_tongue.body.state import NOTHING, State
from dolfin_tongue.control import Instant, Memory
from dolfin_tongue.direct.choice import parts_of
from dolfin_tongue.direct.constraints import Constraints
from dolfin_tongue.direct.contacts import Obstacle
from dolfin_tongue.direct.mass import element_masses, mass_matrix
from dolfin_tongue.direct.numbering import Numbering
from dolfin_tongue.direct.parts import Configuration, Tangent
from dolfin_tongue.scene.scene import Scene
from dolfin_tongue.scene.well_posed import check_pressures

#: Nodes up to which a dense product with the mass is faster than a sparse one: 3 us against 9 us
#: with 96 nodes.
SMALL = 300

#: Step of the central differences that give velocity and acceleration of moved supports, s.
SUPPORT_STEP = 1e-4


class Model:
    """Forces, mass, constraints and their derivatives of a scene.

    Parameters
    ----------
    scene : a body with cells of any kinds, terms, supports.
    mass : ``"consistent"`` (40), or ``"lumped"``: its diagonal, see `mass.element_masses`.

    Raises
    ------
    NoDirectForce : a term without a part here.
    """

    def __init__(self, scene: Scene, mass: str = "consistent"):
        if mass not in ("consistent", "lumped"):
            raise OutOfRange("mass", mass, '"consistent" or "lumped"')
        check_pressures(scene)
        self.scene, self.body, self.lumped = scene, scene.body, mass == "lumped"
        self.parts = parts_of(scene.body, list(zip(scene.labels, scene.terms, strict=True)))
        self.obstacles = [part for part in self.parts if isinstance(part, Obstacle)]
        self.rate_dependent = any(part.rate_dependent for part in self.parts)
        self.element_masses = [
            element_masses(scene.body, block, self.lumped) for block in scene.body.blocks
        ]
        self.mass = mass_matrix(scene.body, self.element_masses, self.lumped)
        self.constraints = Constraints(scene)
        self.numbering = Numbering(scene, self.constraints)
        self.bodies = self.numbering.bodies
        #: Mass matrix over all rows, (N, N).
        self.whole_mass = self.mass
        if self.numbering.has_bodies:
            own = np.concatenate([self.bodies.masses, np.zeros(len(self.bodies.masses))])
            self.whole_mass = sp.block_diag([self.mass, sp.diags_array(own)], format="csr")
        small = len(scene.body.points) <= SMALL
        self._inertia: Any = self.whole_mass.toarray() if small else self.whole_mass
        #: Supports that move, with their nodes and the places of these among all that are held.
        moving = [(part, part.nodes(scene.body)) for part in scene.held if part.moves]
        held = self.numbering.held
        self._moving = [(part, nodes, np.searchsorted(held, nodes)) for part, nodes in moving]

    # -- forces ------------------------------------------------------------------------------------

    def at(self, now: Instant, displacement: FloatArray, velocity: FloatArray) -> Configuration:
        """Where the tissue is and how it moves; arrays with all rows, or of the nodes alone."""
        return Configuration(self.body, now, displacement, velocity, self.rate_dependent)

    def inertia(self, acceleration: FloatArray) -> FloatArray:
        """Mass times acceleration of all rows, shape (N, 3), N."""
        force: FloatArray = self._inertia @ acceleration
        return force

    def position(self, displacement: FloatArray) -> FloatArray:
        """Positions of the nodes, shape (n, 3), m."""
        return self.constraints.positions(displacement)

    def force(self, now: Instant, displacement: FloatArray, velocity: FloatArray) -> FloatArray:
        """All nodal forces but inertia and pressure, shape (n, 3), N."""
        at, out = self.at(now, displacement, velocity), np.zeros(self.body.points.shape)
        for part in self.parts:
            part.add_force(at, out)
        return out

    def element_tangents(
        self,
        at: Configuration,
        factor: float,
        rate_factor: float,
        labels: Collection[str] | None = None,
    ) -> list[FloatArray]:
        """Element matrices of -(factor dF/dU + rate_factor dF/dV), N/m.

        Parameters
        ----------
        at : where.
        factor, rate_factor : weights.
        labels : of the terms that count; None: all.

        Returns
        -------
        list of ndarray, shape (m, 3k, 3k), one per part of the constraints, with dofs as in
        `numbering.part_dofs`; last one of zeros for sliding nodes, where there are any.
        """
        shapes = [(len(d), d.shape[1], d.shape[1]) for d in self.numbering.part_dofs]
        result: list[FloatArray] = [np.zeros(shape) for shape in shapes]
        tangent = Tangent(factor, rate_factor, result, labels)
        for part in self.parts:
            part.add_tangent(at, tangent)
        return result

    def reduced(
        self, now: Instant, u: FloatArray, v: FloatArray, a: FloatArray, force: FloatArray
    ) -> FloatArray:
        """Turn forces minus inertia of all rows into forces on the unknowns, shape (d,), N and N m.

        The loads of the rigid bodies and their rotational inertia come in here.
        """
        nodal = force[self.numbering.free].ravel()
        if not self.numbering.has_bodies:
            return nodal
        return np.concatenate([nodal, self.bodies.residual(now, u, v, a, force)])

    def force_on_bodies(self, state: State, acceleration: FloatArray | None = None) -> FloatArray:
        """Generalised forces of the tissue on the rigid bodies at a state, shape (b, 3), N and N m.

        sum_k T_k^T (F + G^T p - M a)_k over the attached nodes k: stress, weight of the tissue and
        pressure, and the inertia of the tissue where accelerations are given.

        Parameters
        ----------
        state : displacement and velocity of attached nodes are those that its `rigid` and
            `rigid_rate` give, prescribed coordinates those of its time.
        acceleration : of all nodes, shape (n, 3), m/s2; None leaves inertia out.
        """
        u, v = self.rows(state)
        return self.bodies.forces(u, self.numbering.padded(self.balance(state, u, v, acceleration)))

    def balance(
        self, state: State, u: FloatArray, v: FloatArray, acceleration: FloatArray | None = None
    ) -> FloatArray:
        """All nodal forces at a state, pressure included, minus inertia if given, (n, 3), N."""
        force = self.force(Instant(state.time, state.memory), u, v)
        gradients = self.constraints.gradients(u)
        self.constraints.add_force(gradients, self.numbering.multipliers(state), force)
        return force if acceleration is None else force - self.mass @ acceleration

    # -- states ------------------------------------------------------------------------------------

    def rows(self, state: State) -> tuple[FloatArray, FloatArray]:
        """Displacement and velocity of a state with all rows, the supports in place; new arrays."""
        u, v = self.numbering.rows(state)
        self.hold(state.time, u, v)
        return u, v

    def sides(self, state: State) -> Memory:
        """Which points of a contact are behind a sheet or beyond its reach, by the contact's name.

        A step judges its points by where they were when it began.
        """
        x = self.body.points + state.displacement
        found = {p.labels[0]: p.sides(state.time, x) for p in self.obstacles if p.has_sides}
        return {"sides": found} if found else NOTHING

    # -- supports ----------------------------------------------------------------------------------

    def _support(self, time: float) -> FloatArray:
        """Prescribed displacement of the held nodes, shape (h, 3), m."""
        value = np.zeros((len(self.numbering.held), 3))
        for part, nodes, places in self._moving:
            value[places] = part.displacement(self.body.points[nodes], time)
        return value

    def hold(
        self, time: float, displacement: FloatArray, velocity: FloatArray | None = None
    ) -> None:
        """Write the prescribed motion, and that of what moves with rigid bodies, into its rows."""
        self.bodies.place(time, displacement, velocity)
        held = self.numbering.held
        if not self._moving:
            displacement[held] = 0.0
            if velocity is not None:
                velocity[held] = 0.0
            return
        displacement[held] = self._support(time)
        if velocity is not None:
            step = SUPPORT_STEP
            velocity[held] = (self._support(time + step) - self._support(time - step)) / (2 * step)

    def held_acceleration(
        self, time: float, displacement: FloatArray, velocity: FloatArray
    ) -> FloatArray:
        """Acceleration of all rows, shape (N, 3), m/s2, when that of the unknowns is zero.

        That of the supports at held nodes, that of prescribed coordinates and of turning arms at
        rigid bodies, else 0.
        """
        out, step = np.zeros(self.numbering.shape), SUPPORT_STEP
        self.bodies.given_acceleration(time, displacement, velocity, out)
        if self._moving:
            change = self._support(time - step) - 2 * self._support(time)
            change += self._support(time + step)
            out[self.numbering.held] = change / step**2
        return out

    # -- energies ----------------------------------------------------------------------------------

    def energies(self, state: State, now: Instant) -> dict[str, float]:
        """Energies by name, J: kinetic, those of all terms and contacts that have one."""
        u, v = self.rows(state)
        nodal = v[: len(self.body.points)]
        found = {"kinetic": 0.5 * float(np.sum(nodal * (self.mass @ nodal)))}
        at = self.at(now, u, v)
        for part in self.parts:
            for label, energy in part.energies(at).items():
                found[label] = found.get(label, 0.0) + energy
        return found | self.bodies.energies(now, u, v)

    def powers(self, state: State, now: Instant) -> dict[str, float]:
        """Power that all other terms give to the motion, by name, W."""
        u, v = self.rows(state)
        at = self.at(now, u, v)
        found: dict[str, float] = {}
        for part in self.parts:
            found |= part.powers(at)
        return found | self.bodies.powers(now, u, v)

    def energy(self, state: State) -> float:
        """Sum of all energies, that of the weights of rigid bodies included, J.

        What springs and muscles of rigid bodies store is not.
        """
        total = sum(self.energies(state, Instant(state.time, state.memory)).values())
        return total + self.bodies.weight_energy(state.rigid)
