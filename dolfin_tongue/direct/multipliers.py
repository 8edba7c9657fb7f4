"""Acceleration with the multipliers of the volume constraints (53)-(57).

Derivation. A = 0 is demanded through A'' + 2/tau A' + A/tau^2 = 0, critically damped with the time
constant tau. With G = dA/dU, A' = G V and A'' = V.H V + G V'. d'Alembert's principle lets the
constraint forces lambda G act on the nodes like all other forces,

    V' = Gamma (F + G^T lambda),      D lambda = r,      D = G Gamma G^T,                 (55)-(57)
    r = -V.H V - G Gamma F - 2/tau A' - A/tau^2,

with Gamma the inverse mass (54). As printed, (55) has V' = Gamma F + G^T lambda and D = G G^T:
there the constraint acts as if all nodes had the same mass. Internal forces then no longer add up
to zero, so that a free body does not keep its momentum, and lambda does work. Measured on a block
of 12 distorted bricks that flies, spins and vibrates for 0.1 s (`tests/direct/test_momentum.py`;
relative as in `balance.Drift`; volumes kept to 1e-10 in all cases):

    mass         metric      momentum   angular momentum   energy
    consistent   dalembert   6e-16      3e-13              8e-11
    consistent   report      2.6e-3     5.3e-3             1.9e-2
    lumped       dalembert   6e-16      5e-13              3e-11
    lumped       report      4.2e-3     1.1e-2             3.5e-2

Held nodes are eliminated: Gamma is the inverse of the free part of the mass; their prescribed
acceleration enters r and the inertia of their free neighbours.

Sliding nodes (51), (52) are rows of A and G like the cells (`slides`): as for the volumes, (52)
lacks the inverse mass as printed, and d'Alembert's form has it. Unknown coordinates of rigid bodies
(61), (62) are further columns of G, and Gamma is the inverse mass of free nodes and coordinates
(`border.MassBorder`). The printed metric has no meaning for either and refuses them.

How D lambda = r is solved. The lumped mass makes Gamma diagonal and D sparse: cells are coupled
only if they share a node; D is factored sparsely. Gamma of the consistent mass (40) is dense, and
so is D. Gamma (per component) is kept as a matrix for up to `DENSE_NODES` free nodes, and D is
factored by Cholesky's method. For larger bodies D is not formed: conjugate gradients with M
factored once, and the sparse D of the lumped mass as preconditioner. Milliseconds per evaluation
on one core, the report's tongue refined:

    cells   dense D   conjugate gradients   sparse LU of [M G^T; G 0]   lumped mass
       42    0.1        2.3                    2.1                       0.5
      168    3.8        7.0                   11                         1.0
      336   20         16                     52                         2.2
     1134    -         70                    645                         9.3
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.base.errors import BadScene, OutOfRange, require_positive
from dolfin_tongue.control import Instant
from dolfin_tongue.direct import points
from dolfin_tongue.direct.border import MassBorder, condensed_gradient
from dolfin_tongue.direct.model import Model

#: Free nodes up to which Gamma is kept as a dense matrix.
DENSE_NODES = 450

#: Relative residual at which conjugate gradients stop.
CG_TOLERANCE = 1e-13


class Acceleration:
    """V' and the multipliers of a model as functions of time, displacement and velocity.

    Parameters
    ----------
    model : forces, mass, volumes.
    tau : time constant of the constraints, s; None leaves out the terms in A and A' (then r keeps
        A'' = 0 only: for states that fulfil the constraints already).
    metric : ``"dalembert"`` or ``"report"`` (as printed).

    Raises
    ------
    BadScene : the printed metric with sliding nodes or rigid bodies.
    """

    def __init__(self, model: Model, tau: float | None, metric: str = "dalembert"):
        if tau is not None:
            require_positive(self, "s", tau=tau)
        if metric not in ("dalembert", "report"):
            raise OutOfRange("constraint_metric", metric, '"dalembert" or "report"')
        numbering = model.numbering
        if metric == "report" and (model.constraints.slide_scale.size or numbering.has_bodies):
            raise BadScene(
                'constraint_metric="report" has no inverse mass in the constraint forces, so that '
                'it can drive neither rigid bodies nor sliding nodes; take "dalembert"'
            )
        self.model, self.tau, self.metric = model, tau, metric
        free = numbering.free
        mass = model.mass[free][:, free]
        self._held = bool(numbering.held.size) or numbering.has_bodies
        self._lumped = np.asarray(model.mass.sum(axis=1)).ravel()[free]
        self.dense = len(free) <= DENSE_NODES
        if model.lumped:
            self.solve_mass = lambda rhs: rhs / self._lumped[:, None]
        elif self.dense:
            self._inverse = la.inv(mass.toarray())
            self.solve_mass = lambda rhs: self._inverse @ rhs
        else:
            self.solve_mass = splu(mass.tocsc()).solve
        #: `Bodies.columns` at the state of the last `update_geometry`; none without unknown ones.
        self.columns: FloatArray = np.zeros((len(model.bodies.rows), 3, 0))
        coordinates = model.bodies.unknown.size
        self._border = MassBorder(model, self.solve_mass) if coordinates else None
        self._preconditioner: Callable[[FloatArray], FloatArray] | None = None

    def __call__(
        self, now: Instant, displacement: FloatArray, velocity: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Acceleration of all rows, shape (N, 3), m/s2, and multipliers, shape (c,), Pa.

        With the printed metric the multipliers are no pressures: the pressures of d'Alembert's form
        are given there too.
        """
        model = self.model
        self.update_geometry(displacement)
        force = model.numbering.padded(model.force(now, displacement, velocity))
        acceleration = model.held_acceleration(now.time, displacement, velocity)
        if self._held:
            force -= model.inertia(acceleration)
        change, gradients = model.constraints.evaluate(displacement)
        force = model.reduced(now, displacement, velocity, acceleration, force)
        self.add(self.solve(force), acceleration)
        r = -model.constraints.curvature(displacement, velocity)
        r -= model.constraints.rate(gradients, acceleration)
        if self.tau is not None:
            r -= 2 / self.tau * model.constraints.rate(gradients, velocity)
            r -= change / self.tau**2
        push, pressure = self.push(gradients, r)
        self.add(push, acceleration)
        return acceleration, pressure

    def update_geometry(self, displacement: FloatArray) -> None:
        """Take the position of the rigid bodies, on which the mass of their coordinates depends."""
        if self._border is not None:
            self.columns = self.model.bodies.columns(displacement)
            self._border.update_geometry(self.columns)

    def solve(self, force: FloatArray) -> FloatArray:
        """Accelerations of the unknowns by forces on them, shape (d,) or (d, k): Gamma."""
        if self._border is None:
            return self.solve_mass(force.reshape(len(self.model.numbering.free), -1)).reshape(
                force.shape
            )
        nodal = force[: 3 * len(self.model.numbering.free)]
        free = self.solve_mass(nodal.reshape(len(self.model.numbering.free), -1)).reshape(
            nodal.shape
        )
        return self._border.complete(free, force[len(nodal) :])

    def add(self, values: FloatArray, rows: FloatArray) -> None:
        """Add accelerations of unknowns to an array of all rows, what they carry included."""
        self.model.numbering.add_unknowns(values, rows)
        if self.columns.shape[2]:
            own = values[3 * len(self.model.numbering.free) :]
            rows[self.model.bodies.rows] += self.columns @ own

    def push(self, gradients: list[FloatArray], r: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Acceleration of the unknowns, shape (d,), that changes A'' by r; the multipliers."""
        if not np.isfinite(r).all():
            return self._nothing()
        try:
            return self._push(gradients, r)
        except (la.LinAlgError, RuntimeError):  # a degenerate D: NaN, like all that is lost
            return self._nothing()

    def _nothing(self) -> tuple[FloatArray, FloatArray]:
        """NaN, which the steppers notice."""
        return np.full(self.model.numbering.size, np.nan), np.full(
            self.model.constraints.count, np.nan
        )

    def _push(self, gradients: list[FloatArray], r: FloatArray) -> tuple[FloatArray, FloatArray]:
        if self.metric == "report":
            G = self.sparse_gradient(gradients)
            multiplier = self._factored((G @ G.T).tocsc())(r)
            pressure = self._dalembert(gradients, r)[1]
            return G.T @ multiplier, pressure
        return self._dalembert(gradients, r)

    def _dalembert(
        self, gradients: list[FloatArray], r: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        if self.model.lumped:
            G = self.sparse_gradient(gradients)
            pressure = self._factored(self.lumped_D(G))(r)
            return self.solve(G.T @ pressure), pressure
        if self.dense:
            return self._dense_push(gradients, r)
        return self._iterative_push(self.sparse_gradient(gradients), r)

    def _dense_push(
        self, gradients: list[FloatArray], r: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Form Gamma G^T and D, factor D by Cholesky's method."""
        G = dense_gradient(self.model, gradients, self.columns)
        spread = self.solve(G.T)
        factor = la.cho_factor(G @ spread, check_finite=False)
        pressure = la.cho_solve(factor, r, check_finite=False)
        return spread @ pressure, pressure

    def _iterative_push(self, G: sp.csr_array, r: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Conjugate gradients on D with the lumped D of an earlier state as preconditioner."""
        precondition = self._preconditioner or self._factored(self.lumped_D(G))
        self._preconditioner = precondition
        pressure, push = np.zeros_like(r), np.zeros(self.model.numbering.size)
        residual = r.copy()
        direction = z = precondition(residual)
        product = residual @ z
        for count in range(200):
            step = self.solve(G.T @ direction)
            image = G @ step
            length = product / (direction @ image)
            pressure, push = pressure + length * direction, push + length * step
            residual = residual - length * image
            if np.abs(residual).max() <= CG_TOLERANCE * np.abs(r).max():
                if count > 30:  # the state has left the one of the preconditioner behind
                    self._preconditioner = None
                break
            z = precondition(residual)
            product, before = residual @ z, product
            direction = z + (product / before) * direction
        else:
            raise la.LinAlgError("conjugate gradients did not converge")
        return push, pressure

    def lumped_D(self, G: sp.csr_array) -> sp.csc_array:
        """G Gamma G^T with the lumped mass of the nodes."""
        if self._border is None:
            return ((G * (1.0 / np.repeat(self._lumped, 3))) @ G.T).tocsc()
        nodal, own = (
            G[:, : 3 * len(self.model.numbering.free)],
            G[:, 3 * len(self.model.numbering.free) :],
        )
        D = (nodal * (1.0 / np.repeat(self._lumped, 3))) @ nodal.T
        return (D + own @ sp.csr_array(self._border.inverse) @ own.T).tocsc()

    @staticmethod
    def _factored(D: sp.csc_array) -> Callable[[FloatArray], FloatArray]:
        """Solver of a sparse symmetric positive definite system."""
        return splu(D, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}).solve

    def sparse_gradient(self, gradients: list[FloatArray]) -> sp.csr_array:
        """G = dA/dU over the unknowns, shape (c, d), m2."""
        rows, columns, values = [], [], []
        for part, gradient in zip(self.model.constraints.parts, gradients, strict=True):
            numbers = np.arange(part.numbers.start, part.numbers.stop)
            rows.append(np.repeat(numbers, 3 * part.cells.shape[1]))
            columns.append(self.model.numbering.dofs[part.cells].ravel())
            values.append(gradient.ravel())
        row, column, value = (np.concatenate(part) for part in (rows, columns, values))
        keep = column >= 0
        shape = (self.model.constraints.count, 3 * len(self.model.numbering.free))
        G = sp.coo_array((value[keep], (row[keep], column[keep])), shape=shape).tocsr()
        if not self.columns.shape[2]:
            return G
        own = condensed_gradient(self.model, gradients, self.columns)
        return sp.hstack([G, sp.csr_array(own)], format="csr")


def dense_gradient(
    model: Model, gradients: list[FloatArray], columns: FloatArray | None = None
) -> FloatArray:
    """G = dA/dU as a dense matrix, shape (c, d), m2.

    Over the free components; with `Bodies.columns` also over the unknown coordinates.
    """
    G = np.zeros((model.constraints.count, 3 * len(model.numbering.free)))
    for part, gradient in zip(model.constraints.parts, gradients, strict=True):
        points.scatter_gradients(gradient, part.cells, model.numbering.dofs, G[part.numbers])
    if columns is None or not columns.shape[2]:
        return G
    return np.concatenate([G, condensed_gradient(model, gradients, columns)], axis=1)
