"""Semi-discrete equations: M U'' = F(t, U, U') + G(U)^T lambda, A(U) = V_0. There is no dt here.

F are all nodal forces (42), A the volumes of the cells (91), G = dA/dU (96). The multipliers are
the pressures of the cells, positive in compression: -p J F^-T in the first Piola-Kirchhoff stress
gives the nodal force p dA/dU, and d'Alembert's form of (55) adds lambda dA/dU.

Held nodes keep their rows in all arrays of shape (n, 3); `dofs` numbers the free components.

Sliding nodes add constraints behind those of the cells (`slides`), rigid bodies add rows behind
those of the nodes (`bodies`): nodal arrays of N rows have those too, and N = n where there are no
rigid bodies. The unknowns of a motion are the free components, then the unknown
coordinates of the bodies.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.base.errors import OutOfRange
from dolfin_tongue.direct import points, volume
from dolfin_tongue.direct.bodies import Bodies
from dolfin_tongue.direct.contacts import Obstacle
from dolfin_tongue.direct.forces import (
    Law,
    Surroundings,
    laws_of,
    load_of,
    membranes_of,
    obstacle_of,
)
from dolfin_tongue.direct.membranes import Membrane
from dolfin_tongue.direct.mesh import Block
from dolfin_tongue.direct.problem import Problem
from dolfin_tongue.direct.slides import Slides
from dolfin_tongue.march.state import State
from dolfin_tongue.terms.term import Term

#: Step of the central differences that give velocity and acceleration of moved supports, s.
SUPPORT_STEP = 1e-4


class Model:
    """Forces, mass, volumes and their derivatives of a problem.

    Parameters
    ----------
    problem : mesh, terms, held nodes.
    mass : ``"consistent"`` (40), or ``"lumped"``: the diagonal of (40), scaled in each element to
        its mass (Hinton, Rock and Zienkiewicz 1976; positive for every kind of element).

    Raises
    ------
    NoDirectForce : a term without a force here.
    """

    def __init__(self, problem: Problem, mass: str = "consistent"):
        if mass not in ("consistent", "lumped"):
            raise OutOfRange("mass", mass, '"consistent" or "lumped"')
        self.problem, self.mesh, self.blocks = problem, problem.mesh, problem.mesh.blocks
        around = Surroundings(problem.mesh, problem.density, problem.fibres, problem.surfaces)
        self.laws: list[tuple[Term, list[Law]]] = []
        self.membranes: list[tuple[Term, list[Membrane]]] = []
        self.obstacles: list[tuple[Term, Obstacle]] = []
        self.load = np.zeros(problem.mesh.points.shape)
        for term in problem.terms:
            laws, load = laws_of(term, around), load_of(term, around)
            if laws:
                self.laws.append((term, laws))
            if membranes := membranes_of(term, around):
                self.membranes.append((term, membranes))
            if (obstacle := obstacle_of(term, around)) is not None:
                self.obstacles.append((term, obstacle))
            if load is not None:
                self.load += load
        self._strain_rates = any(laws[0].rated for _, laws in self.laws)
        self.rated = self._strain_rates or any(part.rated for _, part in self.obstacles)
        self.lumped = mass == "lumped"
        self.element_masses = [self._element_masses(block) for block in self.blocks]
        self.mass = self._mass()
        self._add_bodies()
        self._number_dofs()
        self.rest_volumes = self.volumes(np.zeros_like(self.load), self._gradient_buffers())
        self._add_slides()

    def _element_masses(self, block: Block) -> FloatArray:
        """Mass matrices of the elements of a block, shape (m, k, k), kg."""
        mass = block.kind.masses(self.mesh.points[block.cells], self.problem.density)
        if self.lumped:
            diagonal = np.einsum("mkk->mk", mass)
            scale = mass.sum(axis=(1, 2)) / diagonal.sum(axis=1)
            mass = np.einsum("mk,kl->mkl", scale[:, None] * diagonal, np.eye(mass.shape[1]))
        return mass

    def _mass(self) -> sp.csr_array:
        """Mass matrix m_KL (40), the same for each component, shape (n, n), kg."""
        rows, columns, values = [], [], []
        for block, mass in zip(self.blocks, self.element_masses, strict=True):
            rows.append(np.repeat(block.cells, mass.shape[1], axis=1).ravel())
            columns.append(np.tile(block.cells, mass.shape[1]).ravel())
            values.append(mass.ravel())
        place = (np.concatenate(rows), np.concatenate(columns))
        count = len(self.mesh.points)
        matrix = sp.coo_array((np.concatenate(values), place), shape=(count, count)).tocsr()
        if self.lumped:
            matrix.eliminate_zeros()
        return matrix

    def _add_bodies(self) -> None:
        """Add the rows of the rigid bodies, with the mass of their centres."""
        self.bodies: Bodies | None = None
        #: Shape of arrays over all rows, (N, 3), and the mass matrix over them, (N, N).
        self.shape, self.whole_mass = self.mesh.points.shape, self.mass
        self.near_bodies: list[IntArray] = []
        if not self.problem.rigid_bodies:
            return
        bodies, attached = zip(*self.problem.rigid_bodies, strict=True)
        self.bodies = Bodies(bodies, attached, self.mesh.points, self.problem.gravity)
        self.shape = (self.bodies.coordinates.stop, 3)
        own = np.concatenate([self.bodies.masses, np.zeros(len(bodies))])
        self.whole_mass = sp.block_diag([self.mass, sp.diags_array(own)], format="csr")
        #: Per block: cells with attached nodes.
        self.near_bodies = [
            np.flatnonzero(np.isin(block.cells, self.bodies.attached).any(axis=1))
            for block in self.blocks
        ]

    def _add_slides(self) -> None:
        """Add the constraints of the sliding nodes."""
        self.slides: Slides | None = None
        #: What has a constraint: blocks of cells, then sliding nodes; `cells` and `numbers`.
        self.constrained: list[Block | Slides] = [*self.blocks]
        self.constraint_count = self.cell_count
        #: Size of each constraint, to which its error is compared, shape (c,), m3.
        self.sizes = self.rest_volumes
        if any(len(nodes) for _, nodes in self.problem.sliding):
            size = float(np.mean(self.rest_volumes)) ** (1 / 3)
            self.slides = Slides(self.problem.sliding, self.mesh.points, self.cell_count, size)
            self.constrained.append(self.slides)
            self.constraint_count += len(self.slides.nodes)
            self.sizes = np.concatenate([self.rest_volumes, self.slides.sizes])
            self.block_dofs.append(self.dofs[self.slides.nodes])

    def _number_dofs(self) -> None:
        count = len(self.mesh.points)
        fixed = self.problem.held
        if self.bodies is not None:
            fixed = np.concatenate([fixed, self.bodies.attached])
        self.free = np.setdiff1d(np.arange(count), fixed)
        #: Number of unknowns of a motion, and what they are of.
        self.size = 3 * len(self.free) + (len(self.bodies.unknown) if self.bodies else 0)
        self.dofs = np.full((count, 3), -1, dtype=np.int64)
        self.dofs[self.free] = np.arange(3 * len(self.free)).reshape(-1, 3)
        #: Per block: dofs of its element matrices (component, then node), shape (m, 3k); of sliding
        #: nodes too.
        self.block_dofs: list[IntArray] = [
            self.dofs[block.cells].transpose(0, 2, 1).reshape(len(block.cells), -1)
            for block in self.blocks
        ]

    def _gradient_buffers(self) -> list[FloatArray]:
        return [np.empty((*block.cells.shape, 3)) for block in self.blocks]

    @property
    def cell_count(self) -> int:
        """Number of cells."""
        return self.mesh.cell_count

    # -- states and unknowns -------------------------------------------------------------------

    def rows(self, state: State) -> tuple[FloatArray, FloatArray]:
        """Displacement and velocity of a state with all rows, the supports in place; new arrays."""
        if self.bodies is None:
            u, v = state.displacement.copy(), state.velocity.copy()
        else:
            u, v = np.zeros((2, *self.shape))
            u[: len(self.load)], v[: len(self.load)] = state.displacement, state.velocity
            if state.rigid.size:
                u[self.bodies.coordinates] = state.rigid
            if state.rigid_rate.size:
                v[self.bodies.coordinates] = state.rigid_rate
        self.hold(state.time, u, v)
        return u, v

    def multipliers(self, state: State) -> FloatArray:
        """Multipliers of all constraints at a state, shape (c,), Pa."""
        if self.slides is None:
            return state.pressure
        force = state.sliding if state.sliding.size else np.zeros(len(self.slides.nodes))
        return np.concatenate([state.pressure, force / self.slides.scale])

    def state(
        self,
        time: float,
        displacement: FloatArray,
        velocity: FloatArray,
        multipliers: FloatArray,
        step: float = 0.0,
        iterations: int = 0,
    ) -> State:
        """State of arrays with all rows and of the multipliers of all constraints."""
        if self.bodies is None and self.slides is None:
            return State(time, displacement, velocity, multipliers, step, iterations)
        count, cells = len(self.load), self.cell_count
        more: dict[str, Any] = {}
        if self.bodies is not None:
            at = self.bodies.coordinates
            more = {"rigid": displacement[at], "rigid_rate": velocity[at]}
        if self.slides is not None:
            more["sliding"] = self.slides.scale * multipliers[cells:]
        fields = (displacement[:count], velocity[:count], multipliers[:cells])
        return State(time, *fields, step, iterations, **more)

    def unknowns(self, rows: FloatArray) -> FloatArray:
        """Unknowns of an array with all rows, shape (d,)."""
        if self.bodies is None:
            return rows[self.free].ravel()
        own = rows[self.bodies.coordinates].ravel()[self.bodies.unknown]
        return np.concatenate([rows[self.free].ravel(), own])

    def add_unknowns(self, values: FloatArray, rows: FloatArray) -> None:
        """Add values of unknowns, shape (d,), to an array with all rows."""
        count = 3 * len(self.free)
        rows[self.free] += values[:count].reshape(-1, 3)
        if self.bodies is not None:
            # the coordinates are the last rows, in one piece
            rows[self.bodies.coordinates].reshape(-1)[self.bodies.unknown] += values[count:]

    def columns(self, displacement: FloatArray) -> FloatArray | None:
        """`Bodies.columns`; None where no coordinate is unknown."""
        if self.bodies is None or not self.bodies.unknown.size:
            return None
        return self.bodies.columns(displacement)

    def whole(self, nodal: FloatArray) -> FloatArray:
        """Nodal forces, shape (n, 3), with zeros in the rows of the rigid bodies."""
        if self.bodies is None:
            return nodal
        return np.concatenate([nodal, np.zeros((self.shape[0] - len(nodal), 3))])

    def reduced(
        self, time: float, u: FloatArray, v: FloatArray, a: FloatArray, force: FloatArray
    ) -> FloatArray:
        """Turn forces minus inertia of all rows into forces on the unknowns, shape (d,), N and N m.

        The loads of the rigid bodies and their rotational inertia come in here.
        """
        nodal = force[self.free].ravel()
        if self.bodies is None:
            return nodal
        return np.concatenate([nodal, self.bodies.residual(time, u, v, a, force)])

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
        if self.bodies is None:
            return np.zeros((0, 3))
        u, v = self.rows(state)
        force = self.force(state.time, u, v)
        self.add_constraint_force(self.constraint_gradients(u), self.multipliers(state), force)
        if acceleration is not None:
            force -= self.mass @ acceleration
        return self.bodies.forces(u, self.whole(force))

    def begin_step(self, time: float, displacement: FloatArray) -> None:
        """Let the obstacles take notice of the state in which a step begins."""
        for _, obstacle in self.obstacles:
            obstacle.begin(time, self.position(displacement))

    def position(self, displacement: FloatArray) -> FloatArray:
        """Positions of the nodes, shape (n, 3), m."""
        return self.mesh.points + displacement[: len(self.mesh.points)]

    # -- forces --------------------------------------------------------------------------------

    def strains(
        self, displacement: FloatArray, velocity: FloatArray
    ) -> list[tuple[FloatArray, FloatArray | None]]:
        """F and its rate at the quadrature points of each block; the rate where a law needs it."""
        result = []
        for block in self.blocks:
            F = np.empty((*block.shape, 3, 3))
            points.nodal_gradients(displacement, block.cells, block.gradients, 1.0, F)
            rate = np.empty_like(F) if self._strain_rates else None
            if rate is not None:
                points.nodal_gradients(velocity, block.cells, block.gradients, 0.0, rate)
            result.append((F, rate))
        return result

    def force(self, time: float, displacement: FloatArray, velocity: FloatArray) -> FloatArray:
        """All nodal forces but inertia and pressure, shape (n, 3), N."""
        out = self.load.copy()
        for _, membranes in self.membranes:
            for membrane in membranes:
                membrane.add_force(self.position(displacement), out)
        for _, obstacle in self.obstacles:
            obstacle.add_force(time, self.position(displacement), velocity, out)
        if not self.laws:
            return out
        strains = self.strains(displacement, velocity)
        for number, (block, (F, rate)) in enumerate(zip(self.blocks, strains, strict=True)):
            stress = np.zeros_like(F)
            for _, laws in self.laws:
                laws[number].add_stress(time, F, rate, stress)
            points.add_nodal_forces(stress, block.cells, block.gradients, block.weights, out)
        return out

    def element_tangents(
        self,
        time: float,
        displacement: FloatArray,
        velocity: FloatArray,
        factor: float,
        rate_factor: float,
        terms: tuple[Term, ...] | None = None,
    ) -> list[FloatArray]:
        """Element matrices factor K + rate_factor C, with K = -dF/dU and C = -dF/dU'.

        Parameters
        ----------
        time, displacement, velocity : the state.
        factor, rate_factor : weights of stiffness, N/m, and damping, N s/m.
        terms : only these; default all.

        Returns
        -------
        list of ndarray, shape (m, 3k, 3k), one per block, with dofs as in `block_dofs`; last one of
        zeros for sliding nodes, where there are any.
        """
        result = []
        strains = self.strains(displacement, velocity)
        for number, (block, (F, rate)) in enumerate(zip(self.blocks, strains, strict=True)):
            size = 3 * block.cells.shape[1]
            moduli = np.zeros((*block.shape, 9, 9))
            for term, laws in self.laws:
                if terms is None or any(term is one for one in terms):
                    laws[number].add_moduli(time, F, rate, factor, rate_factor, moduli)
            out = np.zeros((len(block.cells), size, size))
            points.add_element_matrices(moduli, block.gradients, block.weights, out)
            result.append(out)
        for term, membranes in self.membranes if factor else ():
            if terms is None or any(term is one for one in terms):
                for part in membranes:
                    x = self.position(displacement)
                    part.add_tangent(x, factor, result[part.group.block])
        for term, obstacle in self.obstacles:
            if terms is None or any(term is one for one in terms):
                x = self.position(displacement)
                obstacle.add_tangent(time, x, velocity, factor, rate_factor, result)
        if self.slides is not None:
            result.append(np.zeros((len(self.slides.nodes), 3, 3)))
        return result

    # -- volumes -------------------------------------------------------------------------------

    def volume_gradients(self, displacement: FloatArray) -> list[FloatArray]:
        """dA/dU of every cell (96), per block of shape (m, k, 3), m2."""
        x, gradients = self.position(displacement), self._gradient_buffers()
        for block, out in zip(self.blocks, gradients, strict=True):
            volume.volume_gradients(x, block.cells, *block.kind.triples, out)
        return gradients

    def volumes(self, displacement: FloatArray, gradients: list[FloatArray]) -> FloatArray:
        """Volumes of all cells, shape (m,), m3; fills `gradients` with (96) on the way."""
        x, result = self.position(displacement), np.empty(self.cell_count)
        for block, out in zip(self.blocks, gradients, strict=True):
            volume.volume_gradients(x, block.cells, *block.kind.triples, out)
            volume.volumes(x, block.cells, out, result[block.numbers])
        return result

    # -- constraints: volumes, then sliding nodes ----------------------------------------------

    def constraint_gradients(self, displacement: FloatArray) -> list[FloatArray]:
        """Gradients of all constraints: (96), then (s, 1, 3) of sliding nodes, m2."""
        gradients = self.volume_gradients(displacement)
        if self.slides is not None:
            gradients.append(self.slides.gradients(self.position(displacement)))
        return gradients

    def constraint(self, displacement: FloatArray) -> tuple[FloatArray, list[FloatArray]]:
        """Constraints A, shape (c,), m3, and their gradients: volume changes (53), then slides."""
        gradients = self._gradient_buffers()
        change = self.volumes(displacement, gradients) - self.rest_volumes
        if self.slides is not None:
            x = self.position(displacement)
            change = np.concatenate([change, self.slides.values(x)])
            gradients.append(self.slides.gradients(x))
        return change, gradients

    def constraint_rate(self, gradients: list[FloatArray], velocity: FloatArray) -> FloatArray:
        """dA/dU . v of all constraints, shape (c,), m3/s."""
        rate = np.empty(self.constraint_count)
        for part, gradient in zip(self.constrained, gradients, strict=True):
            volume.volume_rates(velocity, part.cells, gradient, rate[part.numbers])
        return rate

    def constraint_curvature(self, displacement: FloatArray, velocity: FloatArray) -> FloatArray:
        """v.H v of all constraints with the Hessians (101), (52), shape (c,), m3/s2."""
        x, result = self.position(displacement), np.empty(self.cell_count)
        for block in self.blocks:
            volume.volume_accelerations(
                x, velocity, block.cells, *block.kind.triples, result[block.numbers]
            )
        if self.slides is not None:
            result = np.concatenate([result, self.slides.curvatures(x, velocity)])
        return result

    def add_constraint_force(
        self, gradients: list[FloatArray], pressure: FloatArray, out: FloatArray
    ) -> None:
        """Add the nodal forces p dA/dU of all constraints to out, shape (n, 3), N."""
        for part, gradient in zip(self.constrained, gradients, strict=True):
            volume.add_pressure_forces(pressure[part.numbers], part.cells, gradient, out)

    def add_constraint_hessians(
        self, displacement: FloatArray, factor: FloatArray, matrices: list[FloatArray]
    ) -> None:
        """Add factor[c] times the Hessian (101), (52) of each constraint to its element matrix."""
        x = self.position(displacement)
        for block, out in zip(self.blocks, matrices, strict=False):
            part = factor[block.numbers]
            volume.add_volume_hessians(x, block.cells, *block.kind.triples, part, out)
        if self.slides is not None:
            weight = factor[self.slides.numbers]
            matrices[-1] += weight[:, None, None] * self.slides.hessians(x)

    # -- supports ------------------------------------------------------------------------------

    def hold(
        self, time: float, displacement: FloatArray, velocity: FloatArray | None = None
    ) -> None:
        """Write the prescribed motion, and that of what moves with rigid bodies, into its rows."""
        if self.bodies is not None:
            self.bodies.place(time, displacement, velocity)
        held, support = self.problem.held, self.problem.support
        if support is None:
            displacement[held] = 0.0
            if velocity is not None:
                velocity[held] = 0.0
            return
        displacement[held] = support(time)
        if velocity is not None:
            step = SUPPORT_STEP
            velocity[held] = (support(time + step) - support(time - step)) / (2 * step)

    def held_acceleration(
        self, time: float, displacement: FloatArray, velocity: FloatArray
    ) -> FloatArray:
        """Acceleration of all rows, shape (N, 3), m/s2, when that of the unknowns is zero.

        That of the supports at held nodes, that of prescribed coordinates and of turning arms at
        rigid bodies, else 0.
        """
        out, step, support = np.zeros(self.shape), SUPPORT_STEP, self.problem.support
        if self.bodies is not None:
            self.bodies.given_acceleration(time, displacement, velocity, out)
        if support is not None:
            change = support(time - step) - 2 * support(time) + support(time + step)
            out[self.problem.held] = change / step**2
        return out

    # -- energy --------------------------------------------------------------------------------

    def energy(
        self,
        displacement: FloatArray,
        velocity: FloatArray,
        rigid: FloatArray | None = None,
        rigid_rate: FloatArray | None = None,
        time: float = 0.0,
    ) -> float:
        """Kinetic energy, stored energy of laws, membranes and contacts, energy of the loads, J.

        With coordinates and rates of the rigid bodies, shape (b, 3), their kinetic energy and that
        of their weight are included; what their springs and muscles store is not. The time, s,
        says where moved obstacles are.
        """
        total = 0.5 * float(np.sum(velocity * (self.mass @ velocity)))
        total -= float(np.sum(self.load * displacement))
        if self.bodies is not None and rigid is not None and rigid_rate is not None:
            total += self.bodies.energy(rigid, rigid_rate)
        x = self.position(displacement)
        total += sum(part.energy(x) for _, membranes in self.membranes for part in membranes)
        total += sum(obstacle.energy(time, x) for _, obstacle in self.obstacles)
        strains = self.strains(displacement, velocity)
        for number, (block, (F, _)) in enumerate(zip(self.blocks, strains, strict=True)):
            for _, laws in self.laws:
                density = laws[number].energy(F)
                if density is not None:
                    total += float(np.sum(block.weights * density))
        return total
