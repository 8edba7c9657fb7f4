"""Semi-discrete equations of a scene: G(t, y, y', y'') = 0. There is no dt here.

y = (u, p, unknowns of the couplings): displacement, pressure and, where a scene has them,
multipliers of sliding nodes and coordinates of rigid bodies.

The residual is a pure function of its arguments. The rows of the volume condition and of the held
nodes are kinematic: they are stated for the state at the *end* of a time step, so that every
accepted state keeps its volumes, while the rows of momentum are stated at the stage of the method.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp
import ufl
from dolfinx import fem
from dolfinx.fem.petsc import assemble_matrix, create_matrix
from petsc4py import PETSc

from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.base.errors import BadScene, listing
from dolfin_tongue.boundary.contact import Contact
from dolfin_tongue.fenicsx.compile import compile_form
from dolfin_tongue.fenicsx.couplings import (
    Arguments,
    ContactSurface,
    Coupling,
    RigidBodies,
    Shifts,
    SlidingNodes,
)
from dolfin_tongue.fenicsx.fields import CellFields
from dolfin_tongue.fenicsx.incompressible import pressure_power, volume_condition
from dolfin_tongue.fenicsx.mesh import mixed_space
from dolfin_tongue.march.state import State
from dolfin_tongue.scene.scene import Scene
from dolfin_tongue.terms.kinematics import Kinematics
from dolfin_tongue.terms.term import labels_of


class System:
    """Residual and Jacobian of a scene on the mixed space.

    Parameters
    ----------
    scene : body, terms, supports.
    dynamic : with inertia and rates; otherwise a static problem with a load factor, in which no
        velocity, no acceleration and no mass exist.
    pair : displacement and pressure spaces, see `mesh.PAIRS`.
    """

    def __init__(self, scene: Scene, dynamic: bool, pair: str = "Q1/P0"):
        scene.check_volumes()
        if not dynamic:
            scene.check_static()
        self.scene, self.dynamic = scene, dynamic
        self.space = mixed_space(scene.body, pair)
        self.fields = CellFields(self.space)
        self._build_states()
        self._build_couplings()
        self.terms_in_form: list = []
        residual = self._residual_form()
        self.residual_form = residual
        self.jacobian_form = self._jacobian_form(residual)
        self._residual = compile_form(residual)
        self._jacobian = compile_form(self.jacobian_form)
        self._pressure_dofs = self.space.pressure_dofs
        self._pressure_weights = self._weights_of_pressure()
        held = [support.nodes(scene.body) for support in scene.held]
        groups = self.space.held(np.concatenate([*held, []]).astype(np.int64))
        self._held_corners = [corners for _, corners in groups]
        self._held_dofs = np.concatenate([dofs for dofs, _ in groups]).astype(np.int32)
        self._held_points = [scene.body.points[part] for part in held]
        moved = [part.dofs for part in self.couplings if isinstance(part, RigidBodies)]
        every = np.concatenate([self._held_dofs, *moved])
        stuck = self.space.cells_of_stuck_pressures(every)
        if stuck.size:
            raise BadScene(
                f"nothing determines the pressure at a corner of cell(s) {listing(stuck)}: all "
                f"displacement around it is held; refine the mesh or take another pair than {pair}"
            )

    # -- couplings -----------------------------------------------------------------------------

    def _build_couplings(self) -> None:
        """Parts outside the forms, and the numbers of their unknowns."""
        scene, space = self.scene, self.space
        contacts = [term for term in scene.terms if isinstance(term, Contact)]
        named = zip(contacts, labels_of(contacts), strict=True)
        self.couplings: list[Coupling] = [ContactSurface(x, space, name) for x, name in named]
        size = space.size
        for support in scene.sliding:
            self.couplings.append(SlidingNodes(support, space, size))
            size += len(self.couplings[-1].multipliers)
        self.size = size
        if scene.rigid_bodies:
            self.couplings.append(RigidBodies(scene, space, size))
            self.size += len(self.couplings[-1].positions)
        empty = np.zeros(0, dtype=np.int64)
        #: Unknowns of sliding nodes and of rigid bodies.
        self.sliding_dofs = np.concatenate([empty, *(c.multipliers for c in self.couplings)])
        self.rigid_dofs = np.concatenate([empty, *(c.positions for c in self.couplings)])
        #: Unknowns that are positions, with inertia; and those of a stage alone, without memory.
        self.position_dofs = np.concatenate([space.all_displacement_dofs.ravel(), self.rigid_dofs])
        self.multiplier_dofs = np.concatenate([space.pressure_dofs, self.sliding_dofs])

    # -- forms ---------------------------------------------------------------------------------

    def _build_states(self) -> None:
        """Coefficients for the states the residual depends on, and the constants of the method."""
        grid, space = self.space.mesh, self.space.space
        degree = self.space.pair.quadrature_degree
        self.dx = ufl.Measure("dx", grid, metadata={"quadrature_degree": degree})
        self.state = fem.Function(space, name="state")
        self.load: Any = None if self.dynamic else fem.Constant(grid, 1.0)
        self.end_state = fem.Function(space, name="end") if self.dynamic else self.state
        self.rate: Any = fem.Function(space, name="rate") if self.dynamic else None
        self.acceleration: Any = fem.Function(space, name="acceleration") if self.dynamic else None
        self._shifts = [fem.Constant(grid, 0.0) for _ in range(3)] if self.dynamic else []

    def number(self, value: float) -> fem.Constant:
        """Return a constant of the forms: another value needs no new compilation."""
        return fem.Constant(self.space.mesh, float(value))

    def kinematics(self, state: fem.Function, rate: fem.Function | None) -> Kinematics:
        """Kinematics of a mixed state (and its rate)."""
        velocity = None if rate is None else ufl.split(rate)[0]
        return Kinematics(ufl.split(state)[0], self.dx, self.number, velocity, self.load)

    def _residual_form(self) -> ufl.Form:
        """Sum of the virtual powers of all terms, inertia, pressure and volume condition."""
        test_u, test_p = ufl.TestFunctions(self.space.space)
        kin = self.kinematics(self.state, self.rate)
        form = pressure_power(kin, ufl.split(self.state)[1], test_u)
        for term in self.scene.terms:
            part = term.virtual_power(kin, self.fields, test_u)
            if part is not None:
                form += part
                self.terms_in_form.append(term)
        if self.dynamic:
            density = self.number(self.scene.body.density)
            acceleration = ufl.split(self.acceleration)[0]
            form += density * ufl.inner(acceleration, test_u) * self.dx  # (40)
        end = self.kinematics(self.end_state, None) if self.dynamic else kin
        return form + volume_condition(end, test_p)

    def _jacobian_form(self, residual: ufl.Form) -> ufl.Form:
        """Differentiate by the state, plus shifted derivatives by those other states that occur."""
        trial = ufl.TrialFunction(self.space.space)
        form = ufl.derivative(residual, self.state, trial)
        if self.dynamic:
            others = (self.rate, self.acceleration, self.end_state)
            present = residual.coefficients()
            for shift, other in zip(self._shifts, others, strict=True):
                if other in present:
                    form += shift * ufl.derivative(residual, other, trial)
        return form

    # -- residual and Jacobian -----------------------------------------------------------------

    def set_state(
        self,
        time: float,
        state: FloatArray,
        rate: FloatArray | None = None,
        acceleration: FloatArray | None = None,
        end_state: FloatArray | None = None,
    ) -> None:
        """Set the arguments (t, y, y', y'', y at the end of the step); mixed arrays."""
        self.fields.set_time(time)
        inside = slice(self.space.size)
        self.state.x.array[:] = state[inside]
        if self.dynamic:
            assert rate is not None and acceleration is not None and end_state is not None
            self.rate.x.array[:] = rate[inside]
            self.acceleration.x.array[:] = acceleration[inside]
            self.end_state.x.array[:] = end_state[inside]
        self._arrays = (time, state, rate, acceleration, end_state)

    def arguments(self, time_end: float) -> Arguments:
        """Arguments that were set, for the couplings."""
        time, state, rate, acceleration, end = self._arrays
        if rate is None or acceleration is None or end is None:
            rest = np.zeros_like(state)
            return Arguments(time, time_end, state, rest, rest, state, float(self.load.value))
        return Arguments(time, time_end, state, rate, acceleration, end)

    def residual(self, time_end: float, out: FloatArray) -> None:
        """Residual at the arguments that were set; N in rows of u, m3 in rows of p."""
        out[:] = 0.0
        fem.assemble_vector(out[: self.space.size], self._residual)
        if self.couplings:
            at = self.arguments(time_end)
            for coupling in self.couplings:
                coupling.add_residual(at, out)
        if self._held_dofs.size:
            out[self._held_dofs] = self.end_state.x.array[self._held_dofs] - self.held_displacement(
                time_end
            )

    def reactions(self, time_end: float) -> FloatArray:
        """Residual with the rows of momentum of held nodes too: what supports exert on them, N."""
        out, at = np.zeros(self.size), self.arguments(time_end)
        fem.assemble_vector(out[: self.space.size], self._residual)
        for coupling in self.couplings:
            if not isinstance(coupling, RigidBodies):
                coupling.add_residual(at, out)
        return out

    def support_work(self, time: float, way: FloatArray) -> float:
        """Work of moving supports on a small way of the mixed unknowns, J."""
        at, rows = self.arguments(time), self.reactions(time)
        held = float(np.sum(rows[self._held_dofs] * way[self._held_dofs]))
        bodies = [part for part in self.couplings if isinstance(part, RigidBodies)]
        return held + sum(part.work(at, rows, way) for part in bodies)

    def jacobian(
        self,
        matrix: PETSc.Mat,
        shifts: tuple[float, float, float] = (0, 0, 0),
        time_end: float = 0.0,
    ) -> None:
        """Jacobian at the arguments that were set: dG/dy + shifts . dG/d(y', y'', y_end)."""
        for constant, shift in zip(self._shifts, shifts, strict=False):
            constant.value = shift
        form_matrix = self._form_matrix if self.couplings else matrix
        form_matrix.zeroEntries()
        assemble_matrix(form_matrix, self._jacobian)
        form_matrix.assemble()
        end = shifts[2] if self.dynamic else 1.0
        if self.couplings:
            self._couple(matrix, Shifts(shifts[0], shifts[1], end), time_end)
        if self._held_dofs.size:
            matrix.zeroRows(self._held_dofs.ravel(), diag=end)

    def _couple(self, matrix: PETSc.Mat, shifts: Shifts, time_end: float) -> None:
        """Add the couplings to the matrix of the forms."""
        at, rows = self.arguments(time_end), np.zeros(self.size)
        fem.assemble_vector(rows[: self.space.size], self._residual)
        total = self._embedded(self._form_matrix)
        for coupling in self.couplings:
            total = coupling.with_tangent(total, at, shifts, rows)
            coupling.add_residual(at, rows)
        total = total.tocsr()
        matrix.zeroEntries()
        matrix.setValuesCSR(*_places(total), total.data)
        matrix.assemble()

    def _embedded(self, matrix: PETSc.Mat) -> sp.csr_array:
        """Matrix of the forms with empty rows and columns of the couplings."""
        indptr, indices, values = matrix.getValuesCSR()
        indptr = np.pad(indptr, (0, self.size - self.space.size), mode="edge")
        return sp.csr_array((values, indices, indptr), shape=(self.size, self.size))

    def new_matrix(self) -> PETSc.Mat:
        """Empty matrix with the sparsity of the Jacobian."""
        matrix = create_matrix(self._jacobian)
        if self.couplings:
            assemble_matrix(matrix, self._jacobian)  # PETSc drops places that were never filled
            matrix.assemble()
            self._form_matrix, entries = matrix, self._embedded(matrix)
            entries.data[:] = 1.0
            for coupling in self.couplings:
                entries = coupling.pattern(entries)
            pattern = (entries + sp.eye_array(self.size)).tocsr()
            pattern.sort_indices()
            csr = (*_places(pattern), np.zeros(pattern.nnz))
            matrix = PETSc.Mat().createAIJ(self.size, csr=csr, comm=PETSc.COMM_SELF)
        matrix.setOption(PETSc.Mat.Option.KEEP_NONZERO_PATTERN, True)
        return matrix

    def held_displacement(self, time: float) -> FloatArray:
        """Prescribed displacement of the held dofs, shape (number of points, 3), m."""
        supports = zip(self.scene.held, self._held_points, strict=True)
        nodes = np.concatenate([support.displacement(x, time) for support, x in supports])
        if self.space.nodal_only:
            return nodes
        return np.concatenate([nodes[corners].mean(axis=1) for corners in self._held_corners])

    def volume_change(self, residual: FloatArray) -> FloatArray:
        """Relative volume change that each pressure dof sees, from a residual vector.

        For Q1/P0 that is the relative volume change of every cell, shape (m,), in the body's order.
        """
        return -residual[self._pressure_dofs] / self._pressure_weights

    def _weights_of_pressure(self) -> FloatArray:
        """Integral of q^2 of each pressure shape function, m3; for Q1/P0 the cells' volumes."""
        if self.space.pair.pressure == ("DG", 0):
            return self.scene.body.volumes
        _, trial_p = ufl.TrialFunctions(self.space.space)
        _, test_p = ufl.TestFunctions(self.space.space)
        matrix = fem.assemble_matrix(compile_form(trial_p * test_p * self.dx))
        return matrix.to_scipy().diagonal()[self._pressure_dofs]

    # -- between mixed arrays and arrays in the body's order -----------------------------------

    def displacement(self, mixed: FloatArray) -> FloatArray:
        """Displacement (or velocity) of the nodes from a mixed array, shape (n, 3)."""
        return mixed[self.space.displacement_dofs]

    def pressure(self, mixed: FloatArray) -> FloatArray:
        """Pressure in the middle of the cells from a mixed array, shape (m,), Pa."""
        return self.space.cell_pressure(mixed)

    def state_of(
        self, time: float, y: FloatArray, rate: FloatArray, step: float = 0.0, iterations: int = 0
    ) -> State:
        """State in the body's order from the mixed arrays of y and y'."""
        unknowns = None if self.space.nodal_only else (y.copy(), rate.copy())
        fields = (self.displacement(y), self.displacement(rate), self.pressure(y))
        rigid = (y[self.rigid_dofs].reshape(-1, 3), rate[self.rigid_dofs].reshape(-1, 3))
        return State(time, *fields, step, iterations, unknowns, *rigid, y[self.sliding_dofs])

    def vectors(self, state: State) -> tuple[FloatArray, FloatArray]:
        """Mixed arrays of y and y' of a state; new ones."""
        if state.unknowns is not None:
            y, rate = state.unknowns
            return y.copy(), rate.copy()
        y, rate = self.mixed(state.displacement, state.pressure), self.mixed(state.velocity)
        if self.rigid_dofs.size and state.rigid.size:
            y[self.rigid_dofs] = state.rigid.ravel()
            rate[self.rigid_dofs] = state.rigid_rate.ravel()
        if self.sliding_dofs.size and state.sliding.size:
            y[self.sliding_dofs] = state.sliding
        return y, rate

    def mixed(self, displacement: FloatArray, pressure: FloatArray | float = 0.0) -> FloatArray:
        """Mixed array from displacement, shape (n, 3), and pressure, shape (m,)."""
        body = self.scene.body
        if displacement.shape != body.points.shape:
            raise BadScene(
                f"a displacement of shape {body.points.shape} is needed, not {displacement.shape}"
            )
        array = np.zeros(self.size)
        if not self.space.nodal_only:
            if np.any(displacement):
                raise BadScene("nodal values do not determine a quadratic displacement")
            return array  # at rest
        array[self.space.displacement_dofs] = displacement
        array[self.space.pressure_dofs] = pressure
        return array


def _places(matrix: sp.csr_array) -> tuple[IntArray, IntArray]:
    """Row starts and columns in the integers of PETSc."""
    return matrix.indptr.astype(PETSc.IntType), matrix.indices.astype(PETSc.IntType)
