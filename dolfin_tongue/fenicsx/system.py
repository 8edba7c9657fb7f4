"""Semi-discrete equations of a scene: G(t, y, y', y'') = 0. There is no dt here.

y = (u, p, unknowns of the couplings): displacement, pressure and, where a scene has them,
multipliers of sliding nodes and coordinates of rigid bodies, in our own `numbering`. G is a sum of
blocks (UFL forms on the volume and on surfaces) and of couplings (what no form states).

The residual is a pure function of its `Arguments`. The rows of the volume condition and of the held
nodes are kinematic: they are stated for the state at the *end* of a time step, so that every
accepted state keeps its volumes, while the rows of momentum are stated at the stage of the method.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
import scipy.sparse as sp
from petsc4py import PETSc

from dolfin_tongue.base.arrays import FloatArray, IntArray, sums_at
from dolfin_tongue.base.errors import BadScene, listing
from dolfin_tongue.body.state import NOTHING, State
from dolfin_tongue.control import Instant, Memory
from dolfin_tongue.fenicsx.arguments import Arguments, Shifts
from dolfin_tongue.fenicsx.block import Block
from dolfin_tongue.fenicsx.coupling import Coupling
from dolfin_tongue.fenicsx.couplings import couplings_of
from dolfin_tongue.fenicsx.domains import surface_domain, volume_domain
from dolfin_tongue.fenicsx.numbering import Numbering
from dolfin_tongue.fenicsx.pairs import pair_of
from dolfin_tongue.scene.scene import Scene
from dolfin_tongue.scene.well_posed import check_pressures, check_static
from dolfin_tongue.terms.term import FormTerm


class System:
    """Residual and Jacobian of a scene.

    Parameters
    ----------
    scene : body, terms, supports.
    dynamic : with inertia and rates; otherwise a static problem with a load factor, in which no
        velocity, no acceleration and no mass exist.
    pair : displacement and pressure spaces, see `pairs.PAIRS`.

    Attributes
    ----------
    size : number of unknowns.
    position_dofs : unknowns that are positions, with inertia.
    multiplier_dofs : unknowns of a stage alone, without memory.
    """

    def __init__(self, scene: Scene, dynamic: bool, pair: str = "Q1/P0"):
        check_pressures(scene)
        if not dynamic:
            check_static(scene)
        self.scene, self.dynamic = scene, dynamic
        self.numbering = Numbering(scene.body, pair_of(pair))
        self.blocks = self._blocks()
        self.couplings: list[Coupling] = couplings_of(scene, self.numbering)
        self._number_unknowns()
        self._find_held(pair)

    def _blocks(self) -> list[Block]:
        """Blocks of the volume and of each surface that terms name."""
        named = zip(self.scene.labels, self.scene.terms, strict=True)
        forms = [(label, term) for label, term in named if isinstance(term, FormTerm)]
        blocks = []
        for surface in dict.fromkeys([None, *(term.domain for _, term in forms)]):
            terms = [(label, term) for label, term in forms if term.domain == surface]
            domain = (
                volume_domain(self.numbering)
                if surface is None
                else surface_domain(self.numbering, surface)
            )
            blocks.append(Block(domain, terms, self.dynamic))
        return blocks

    def _number_unknowns(self) -> None:
        numbering, empty = self.numbering, np.zeros(0, dtype=np.int64)
        self.size = numbering.size + sum(coupling.count for coupling in self.couplings)
        #: Unknowns of sliding nodes and of rigid bodies.
        self.sliding_dofs = np.concatenate([empty, *(c.multipliers for c in self.couplings)])
        self.rigid_dofs = np.concatenate([empty, *(c.positions for c in self.couplings)])
        every = np.arange(numbering.size)
        self.position_dofs = np.concatenate([every[numbering.displacements], self.rigid_dofs])
        self.multiplier_dofs = np.concatenate([every[numbering.pressures], self.sliding_dofs])

    def _find_held(self, pair: str) -> None:
        scene, numbering = self.scene, self.numbering
        held = [support.nodes(scene.body) for support in scene.held]
        groups = numbering.following(np.concatenate([*held, []]).astype(np.int64))
        points = np.concatenate([part for part, _ in groups])
        self._held_corners = [corners for _, corners in groups]
        self._held_dofs = 3 * points[:, None] + np.arange(3)
        self._held_places = [scene.body.points[part] for part in held]
        self._moves = any(support.moves for support in scene.held)
        moved = [part.carried for part in self.couplings]
        stuck = numbering.cells_of_stuck_pressures(np.concatenate([points, *moved]))
        if stuck.size:
            raise BadScene(
                f"nothing determines the pressure at a corner of cell(s) {listing(stuck)}: all "
                f"displacement around it is held; refine the mesh or take another pair than {pair}"
            )

    @property
    def volume(self) -> Block:
        """The block of the volume."""
        return self.blocks[0]

    # -- arguments ---------------------------------------------------------------------------------

    def at_state(self, state: State, now: Instant | None = None) -> Arguments:
        """Arguments of a state without acceleration; its end is itself.

        Parameters
        ----------
        state : any.
        now : time and memory, if not those of the state.
        """
        y, rate = self.vectors(state)
        now = Instant(state.time, state.memory) if now is None else now
        return Arguments(now, now.time, y, rate, np.zeros_like(y), y, state.load)

    # -- residual and Jacobian ---------------------------------------------------------------------

    def residual(self, at: Arguments, out: FloatArray) -> None:
        """Write the residual; N in rows of u, m3 in rows of p."""
        self._forms(at, out)
        for coupling in self.couplings:
            coupling.add_residual(at, out)
        if self._held_dofs.size:
            out[self._held_dofs] = at.end[self._held_dofs] - self._held_displacement(at)

    def _forms(self, at: Arguments, out: FloatArray) -> None:
        """Write the part of the residual that is stated by forms."""
        first, *others = self.blocks
        out[:] = first.residual(at, self.size)
        for block in others:
            out += block.residual(at, self.size)

    def _held_displacement(self, at: Arguments) -> FloatArray | float:
        """Prescribed displacement of the held points at the end, shape (k, 3), m; 0 if all rest."""
        if not self._moves:
            return 0.0
        supports = zip(self.scene.held, self._held_places, strict=True)
        nodes = np.concatenate([part.displacement(x, at.time_end) for part, x in supports])
        parts = [nodes[corners].mean(axis=1) for corners in self._held_corners[1:]]
        moved = np.concatenate([nodes, *parts]) if parts else nodes
        return moved if at.load == 1.0 else at.load * moved

    def reactions(self, at: Arguments) -> FloatArray:
        """Residual with the rows of momentum of held nodes too: what supports exert on them, N."""
        out = np.zeros(self.size)
        self._forms(at, out)
        for coupling in self.couplings:
            if not coupling.gathers:
                coupling.add_residual(at, out)
        return out

    def support_work(self, at: Arguments, way: FloatArray) -> float:
        """Work of moving supports on a small way of the unknowns, J."""
        rows = self.reactions(at)
        held = float(np.sum(rows[self._held_dofs] * way[self._held_dofs]))
        return held + sum(part.work(at, rows, way) for part in self.couplings)

    @cached_property
    def _pattern(self) -> sp.csr_array:
        """Places of all entries of the Jacobian of the forms, and of its diagonal."""
        diagonal = np.arange(self.size)
        rows = np.concatenate([diagonal, *(block.entries[0] for block in self.blocks)])
        columns = np.concatenate([diagonal, *(block.entries[1] for block in self.blocks)])
        ones = np.ones(len(rows))
        pattern = sp.coo_array((ones, (rows, columns)), shape=(self.size, self.size)).tocsr()
        pattern.sort_indices()
        pattern.data[:] = 1.0
        return pattern

    @cached_property
    def _places(self) -> list[IntArray]:
        """For each block the place of its entries in the data of the pattern."""
        pattern, size = self._pattern, np.int64(self.size)
        key = np.repeat(np.arange(size), np.diff(pattern.indptr)) * size + pattern.indices
        return [np.searchsorted(key, row * size + column) for row, column in self._entries]

    @property
    def _entries(self) -> list[tuple[IntArray, IntArray]]:
        return [block.entries for block in self.blocks]

    def jacobian(self, at: Arguments, shifts: Shifts, matrix: PETSc.Mat) -> None:
        """Write dG/dy + shifts . dG/d(y', y'', y_end) into a matrix of `new_matrix`."""
        total, count = self._pattern, self._pattern.nnz
        data = np.zeros(count)
        for block, places in zip(self.blocks, self._places, strict=True):
            data += sums_at(places, block.tangent(at, shifts), count)
        total = sp.csr_array((data, total.indices, total.indptr), shape=total.shape)
        if self.couplings:
            rows = np.zeros(self.size)
            self._forms(at, rows)
            for coupling in self.couplings:
                total = coupling.with_tangent(total, at, shifts, rows)
                coupling.add_residual(at, rows)
            total = total.tocsr()
            matrix.zeroEntries()
        matrix.setValuesCSR(*_integers(total), total.data)
        matrix.assemble()
        if self._held_dofs.size:
            matrix.zeroRows(self._held_dofs.ravel().astype(PETSc.IntType), diag=shifts.end)

    def new_matrix(self) -> PETSc.Mat:
        """Empty matrix with the sparsity of the Jacobian."""
        pattern = self._pattern
        for coupling in self.couplings:
            pattern = coupling.pattern(pattern)
        pattern = pattern.tocsr()
        pattern.sort_indices()
        csr = (*_integers(pattern), np.zeros(pattern.nnz))
        matrix = PETSc.Mat().createAIJ(self.size, csr=csr, comm=PETSc.COMM_SELF)
        matrix.setOption(PETSc.Mat.Option.KEEP_NONZERO_PATTERN, True)
        return matrix

    # -- volumes -----------------------------------------------------------------------------------

    def volume_change(self, residual: FloatArray) -> FloatArray:
        """Relative volume change that each pressure sees, from a residual vector.

        For Q1/P0 that is the relative volume change of every cell, shape (m,), in the body's order.
        """
        return -residual[self.numbering.pressures] / self._pressure_weights

    @cached_property
    def _pressure_weights(self) -> FloatArray:
        """Integral of q^2 of each pressure shape function, m3; for Q1/P0 the cells' volumes."""
        if self.numbering.pair.pressure == ("DG", 0):
            return self.scene.body.volumes
        return self.volume.pressure_weights[self.numbering.pressures]

    # -- between vectors and states ----------------------------------------------------------------

    def displacement(self, y: FloatArray) -> FloatArray:
        """Displacement (or velocity) of the nodes from a vector of all unknowns, shape (n, 3)."""
        return y[self.numbering.nodes].reshape(-1, 3)

    def state_of(
        self, now: Instant, y: FloatArray, rate: FloatArray, step: float = 0.0, iterations: int = 0
    ) -> State:
        """State in the body's order from vectors of y and y'."""
        fields = (self.displacement(y).copy(), self.displacement(rate).copy())
        unknowns = None if self.numbering.nodal_only else (y.copy(), rate.copy())
        rigid = (y[self.rigid_dofs].reshape(-1, 3), rate[self.rigid_dofs].reshape(-1, 3))
        return State(
            now.time, *fields, self.numbering.cell_pressure(y), step, iterations, unknowns, *rigid,
            y[self.sliding_dofs], memory=now.memory,
        )  # fmt: skip

    def vectors(self, state: State) -> tuple[FloatArray, FloatArray]:
        """Vectors of y and y' of a state; new ones.

        Raises
        ------
        BadScene : a state of another body or pair of spaces.
        """
        if state.unknowns is not None and not self.numbering.nodal_only:
            y, rate = state.unknowns
            if len(y) != self.size:
                raise BadScene(f"the state has {len(y)} unknowns, and the scene {self.size}")
            return y.copy(), rate.copy()
        y, rate = self.vector(state.displacement, state.pressure), self.vector(state.velocity)
        if self.rigid_dofs.size and state.rigid.size:
            y[self.rigid_dofs] = state.rigid.ravel()
            rate[self.rigid_dofs] = state.rigid_rate.ravel()
        if self.sliding_dofs.size and state.sliding.size:
            y[self.sliding_dofs] = state.sliding
        return y, rate

    def vector(self, displacement: FloatArray, pressure: FloatArray | float = 0.0) -> FloatArray:
        """Vector of displacements of the nodes, shape (n, 3), and pressures, shape (m,).

        Points of a quadratic displacement between nodes move with the mean of their corners.
        """
        body = self.scene.body
        if displacement.shape != body.points.shape:
            raise BadScene(
                f"a displacement of shape {body.points.shape} is needed, not {displacement.shape}"
            )
        y = np.zeros(self.size)
        corners = self.numbering.corners.values()
        y[self.numbering.displacements] = np.concatenate(
            [displacement[rows].mean(axis=1) for rows in corners]
        ).ravel()
        y[self.numbering.pressures] = self.numbering.pressures_of(pressure)
        return y

    # -- memory ------------------------------------------------------------------------------------

    def sides(self, state: State) -> Memory:
        """Which points of a contact are behind a sheet or beyond its reach, by the contact's name.

        A step judges its points by where they were when it began.
        """
        parts = [coupling for coupling in self.couplings if coupling.has_sides]
        if not parts:
            return NOTHING
        y, _ = self.vectors(state)
        return {"sides": {part.label: part.sides(state.time, y, state.load) for part in parts}}


def _integers(matrix: sp.csr_array) -> tuple[IntArray, IntArray]:
    """Row starts and columns in the integers of PETSc."""
    return matrix.indptr.astype(PETSc.IntType), matrix.indices.astype(PETSc.IntType)
