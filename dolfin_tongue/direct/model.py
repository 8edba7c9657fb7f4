"""Semi-discrete equations: M U'' = F(t, U, U') + G(U)^T lambda, A(U) = V_0. There is no dt here.

F are all nodal forces (42), A the volumes of the cells (91), G = dA/dU (96). The multipliers are
the pressures of the cells, positive in compression: -p J F^-T in the first Piola-Kirchhoff stress
gives the nodal force p dA/dU, and d'Alembert's form of (55) adds lambda dA/dU.

Held nodes keep their rows in all arrays of shape (n, 3); `dofs` numbers the free components.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp

from dolfin_tongue.arrays import FloatArray, IntArray
from dolfin_tongue.boundary.attached import Attached
from dolfin_tongue.direct import points, volume
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
from dolfin_tongue.direct.mesh import Block, Mesh, mesh_of
from dolfin_tongue.errors import OutOfRange
from dolfin_tongue.fibres import Fibres
from dolfin_tongue.scene import Scene
from dolfin_tongue.term import Term

#: Step of the central differences that give velocity and acceleration of moved supports, s.
SUPPORT_STEP = 1e-4

#: Supports that stand still at zero displacement: their motion need not be asked for.
STANDING = (Attached,)


@dataclass(frozen=True, eq=False)
class Problem:
    """What the direct solver is asked to solve; `problem_of` makes it from a scene.

    Parameters
    ----------
    mesh : elements of any kinds.
    terms : the physics.
    density : kg/m3.
    fibres : muscles, with cells numbered as in the mesh.
    held : nodes with prescribed displacement, increasing.
    support : time, s -> displacement of the held nodes, shape (len(held), 3), m; None: they stand
        still.
    breakpoints, jumps : times at which the motion is not smooth, or jumps, s.
    surfaces : named surfaces, as corners of faces of shape (k, 4); -1 in those of triangles.
    """

    mesh: Mesh
    terms: tuple[Term, ...]
    density: float
    fibres: Fibres = field(default_factory=Fibres)
    held: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    support: Callable[[float], FloatArray] | None = None
    breakpoints: tuple[float, ...] = ()
    jumps: tuple[float, ...] = ()
    surfaces: Mapping[str, IntArray] = field(default_factory=dict)


def problem_of(scene: Scene) -> Problem:
    """Problem of a scene: the same body, terms and supports."""
    scene.check_volumes()
    body, held = scene.body, scene.held_nodes
    parts = [(part, part.nodes(body)) for part in scene.held if type(part) not in STANDING]

    def support(time: float) -> FloatArray:
        value = np.zeros(body.points.shape)
        for part, nodes in parts:
            value[nodes] = part.displacement(body.points[nodes], time)
        return value[held]

    return Problem(
        mesh_of(body), scene.terms, body.density, body.fibres, held,
        support if parts else None, scene.breakpoints, scene.jumps, body.surfaces,
    )  # fmt: skip


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
        self._number_dofs()
        self.rest_volumes = self.volumes(np.zeros_like(self.load), self._gradient_buffers())

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

    def _number_dofs(self) -> None:
        count = len(self.mesh.points)
        self.free = np.setdiff1d(np.arange(count), self.problem.held)
        self.dofs = np.full((count, 3), -1, dtype=np.int64)
        self.dofs[self.free] = np.arange(3 * len(self.free)).reshape(-1, 3)
        #: Per block: dofs of its element matrices (component, then node), shape (m, 3k).
        self.block_dofs = [
            self.dofs[block.cells].transpose(0, 2, 1).reshape(len(block.cells), -1)
            for block in self.blocks
        ]

    def _gradient_buffers(self) -> list[FloatArray]:
        return [np.empty((*block.cells.shape, 3)) for block in self.blocks]

    @property
    def cell_count(self) -> int:
        """Number of cells."""
        return self.mesh.cell_count

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
                membrane.add_force(self.mesh.points + displacement, out)
        for _, obstacle in self.obstacles:
            obstacle.add_force(time, self.mesh.points + displacement, velocity, out)
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
        list of ndarray, shape (m, 3k, 3k), one per block, with dofs as in `block_dofs`.
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
                    x = self.mesh.points + displacement
                    part.add_tangent(x, factor, result[part.group.block])
        for term, obstacle in self.obstacles:
            if terms is None or any(term is one for one in terms):
                x = self.mesh.points + displacement
                obstacle.add_tangent(time, x, velocity, factor, rate_factor, result)
        return result

    # -- volumes -------------------------------------------------------------------------------

    def volume_gradients(self, displacement: FloatArray) -> list[FloatArray]:
        """dA/dU of every cell (96), per block of shape (m, k, 3), m2."""
        x, gradients = self.mesh.points + displacement, self._gradient_buffers()
        for block, out in zip(self.blocks, gradients, strict=True):
            volume.volume_gradients(x, block.cells, *block.kind.triples, out)
        return gradients

    def volumes(self, displacement: FloatArray, gradients: list[FloatArray]) -> FloatArray:
        """Volumes of all cells, shape (m,), m3; fills `gradients` with (96) on the way."""
        x, result = self.mesh.points + displacement, np.empty(self.cell_count)
        for block, out in zip(self.blocks, gradients, strict=True):
            volume.volume_gradients(x, block.cells, *block.kind.triples, out)
            volume.volumes(x, block.cells, out, result[block.numbers])
        return result

    def constraint(self, displacement: FloatArray) -> tuple[FloatArray, list[FloatArray]]:
        """Volume changes A of all cells (53), shape (m,), m3, and their gradients (96)."""
        gradients = self._gradient_buffers()
        return self.volumes(displacement, gradients) - self.rest_volumes, gradients

    def constraint_rate(self, gradients: list[FloatArray], velocity: FloatArray) -> FloatArray:
        """dA/dU . v of all cells, shape (m,), m3/s."""
        rate = np.empty(self.cell_count)
        for block, gradient in zip(self.blocks, gradients, strict=True):
            volume.volume_rates(velocity, block.cells, gradient, rate[block.numbers])
        return rate

    def constraint_curvature(self, displacement: FloatArray, velocity: FloatArray) -> FloatArray:
        """v.H v of all cells with the Hessians (101), shape (m,), m3/s2."""
        x, result = self.mesh.points + displacement, np.empty(self.cell_count)
        for block in self.blocks:
            volume.volume_accelerations(
                x, velocity, block.cells, *block.kind.triples, result[block.numbers]
            )
        return result

    def add_constraint_force(
        self, gradients: list[FloatArray], pressure: FloatArray, out: FloatArray
    ) -> None:
        """Add the nodal forces p dA/dU to out, shape (n, 3), N."""
        for block, gradient in zip(self.blocks, gradients, strict=True):
            volume.add_pressure_forces(pressure[block.numbers], block.cells, gradient, out)

    def add_constraint_hessians(
        self, displacement: FloatArray, factor: FloatArray, matrices: list[FloatArray]
    ) -> None:
        """Add factor[m] times the Hessian (101) of each cell to its element matrix."""
        x = self.mesh.points + displacement
        for block, out in zip(self.blocks, matrices, strict=True):
            part = factor[block.numbers]
            volume.add_volume_hessians(x, block.cells, *block.kind.triples, part, out)

    # -- supports ------------------------------------------------------------------------------

    def hold(
        self, time: float, displacement: FloatArray, velocity: FloatArray | None = None
    ) -> None:
        """Write the prescribed motion into the rows of the held nodes."""
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

    def held_acceleration(self, time: float) -> FloatArray:
        """Acceleration, shape (n, 3), m/s2: that of the supports at held nodes, else 0."""
        out, step, support = np.zeros_like(self.load), SUPPORT_STEP, self.problem.support
        if support is not None:
            change = support(time - step) - 2 * support(time) + support(time + step)
            out[self.problem.held] = change / step**2
        return out

    # -- energy --------------------------------------------------------------------------------

    def energy(self, displacement: FloatArray, velocity: FloatArray, time: float = 0.0) -> float:
        """Kinetic energy, stored energy of laws, membranes and contacts, energy of the loads, J.

        The time, s, says where moved obstacles are.
        """
        total = 0.5 * float(np.sum(velocity * (self.mass @ velocity)))
        total -= float(np.sum(self.load * displacement))
        x = self.mesh.points + displacement
        total += sum(part.energy(x) for _, membranes in self.membranes for part in membranes)
        total += sum(obstacle.energy(time, x) for _, obstacle in self.obstacles)
        strains = self.strains(displacement, velocity)
        for number, (block, (F, _)) in enumerate(zip(self.blocks, strains, strict=True)):
            for _, laws in self.laws:
                density = laws[number].energy(F)
                if density is not None:
                    total += float(np.sum(block.weights * density))
        return total
