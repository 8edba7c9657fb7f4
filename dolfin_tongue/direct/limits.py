"""Largest stable step of explicit methods, and what sets it.

Linearised at a state, the motion obeys M dU'' + C dU' + K dU = constraint forces, with the volumes
kept. Let c and w^2 be the spectral radii of Gamma C and Gamma K on motions that keep the volumes.
All eigenvalues s of the motion then have |s| <= (c + sqrt(c^2 + 4 w^2)) / 2. The constraint itself
adds the double eigenvalue -1/tau. Runge-Kutta 4 is stable where |s| dt <= 2.61 anywhere in the left
half-plane (2.785 on the real axis), so that dt is refused beyond 2.61 / max(|s|, 1/tau).

The radii come from power iterations; each term has its own, which tells the cause. The unknown
coordinates of rigid bodies take part, with their springs and dampers as one more term, which sets
the limit of a light body. Tissue on a body, however light, is not faster than without it: rigid
motion of its nodes and more mass both lower Rayleigh's quotient. Sliding nodes stay on surfaces.
Contact is seen where it presses at the state; what it may become within a step is judged after the
step, by the energy that it made (`impacts`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.boundary.contact import Contact
from dolfin_tongue.constitutive.fibre_stress import FibreStress
from dolfin_tongue.control import Instant
from dolfin_tongue.direct.border import condensed
from dolfin_tongue.direct.model import Model
from dolfin_tongue.direct.multipliers import Acceleration
from dolfin_tongue.terms.term import SurfaceTerm, Term

#: Instant, displacement and velocity (all rows).
Motion = tuple[Instant, FloatArray, FloatArray]

#: Smallest |z| on the boundary of the stability region of Runge-Kutta 4 in the left half-plane.
RK4_RADIUS = 2.61


@dataclass(frozen=True)
class Limit:
    """A stability limit.

    Parameters
    ----------
    step : largest stable step, s.
    cause : what sets it, in words.
    """

    step: float
    cause: str


class StabilityLimits:
    """Estimates the largest stable step at a state.

    Parameters
    ----------
    acceleration : the motion, with its constraint and tau.
    """

    def __init__(self, acceleration: Acceleration):
        self.acceleration, self.model = acceleration, acceleration.model
        self._vectors: dict[tuple[object, str], FloatArray] = {}

    def __call__(
        self, now: Instant, displacement: FloatArray, velocity: FloatArray, pressure: FloatArray
    ) -> Limit:
        """Limit at a state; the multipliers enter through the Hessians of the constraints (101)."""
        state = (now, displacement, velocity)
        rate = _bound(*self._radii("all", state, pressure, None))
        by_tau = 1.0 / self.acceleration.tau if self.acceleration.tau else 0.0
        if by_tau >= rate:
            cause = f"the constraint time constant tau = {self.acceleration.tau:g} s"
            return Limit(RK4_RADIUS / by_tau, cause)
        if rate == 0.0:
            return Limit(np.inf, "nothing")
        return Limit(RK4_RADIUS / rate, self._cause(state, rate))

    def _cause(self, state: Motion, rate: float) -> str:
        """Name the term whose own radius is the largest."""
        model = self.model
        named = dict(zip(model.scene.labels, model.scene.terms, strict=True))
        labels = dict.fromkeys(label for part in model.parts for label in part.labels)
        terms: list[Term | None] = [named[label] for label in labels]
        own: list[tuple[str, ...]] = [(label,) for label in labels]
        if self.acceleration.columns.shape[2]:
            terms.append(None)  # the loads of the rigid bodies
            own.append(())
        parts = [self._radii(i, state, None, labels) for i, labels in enumerate(own)]
        bounds = [_bound(*part) for part in parts]
        worst = int(np.argmax(bounds)) if bounds else 0
        if not bounds or bounds[worst] < 0.3 * rate:
            return f"the pressures of the volume constraint (fastest rate {rate:.3g} 1/s)"
        term, (c, w) = terms[worst], parts[worst]
        if term is not None:
            return _describe(term, c, w, rate)
        name = self._moved(self._vectors[worst, "damping" if c > w else "stiffness"])
        return f"springs and dampers of {name} (fastest rate {rate:.3g} 1/s)"

    def _moved(self, vector: FloatArray) -> str:
        """Name of the rigid body with most of the kinetic energy of a mode."""
        bodies = self.model.bodies
        energy = np.zeros(bodies.given.size)
        own = np.diag(bodies.loads.mass(np.zeros(len(energy))))[bodies.unknown]
        energy[bodies.unknown] = own * vector[3 * len(self.model.numbering.free) :] ** 2
        return bodies.bodies[int(energy.reshape(-1, 3).sum(axis=1).argmax())].name

    def _radii(
        self,
        key: object,
        state: Motion,
        pressure: FloatArray | None,
        labels: tuple[str, ...] | None,
    ) -> tuple[float, float]:
        """Radii c, 1/s, and w, 1/s, of some terms; of no terms: of the loads of rigid bodies."""
        model = self.model
        self.acceleration.update_geometry(state[1])
        own, at = self._own(state, pressure, labels), model.at(*state)
        stiffness = model.element_tangents(at, 1.0, 0.0, labels)
        if pressure is not None:
            model.constraints.add_hessians(state[1], -pressure, stiffness)
        w2 = self._power((key, "stiffness"), self._matrix(stiffness, own[0]), state[1])
        if not (model.rate_dependent or np.any(own[1])):
            return 0.0, float(np.sqrt(w2))
        damping = model.element_tangents(at, 0.0, 1.0, labels)
        c = self._power((key, "damping"), self._matrix(damping, own[1]), state[1])
        return c, float(np.sqrt(w2))

    def _own(
        self, state: Motion, pressure: FloatArray | None, labels: tuple[str, ...] | None
    ) -> tuple[FloatArray | float, FloatArray | float]:
        """Stiffness and damping of the coordinates that do not come from the elements."""
        model = self.model
        if not self.acceleration.columns.shape[2] or labels:
            return 0.0, 0.0
        force = np.zeros_like(model.body.points)
        if pressure is not None:
            force = model.force(*state)
            model.constraints.add_force(model.constraints.gradients(state[1]), pressure, force)
        return model.bodies.tangents(*state, model.numbering.padded(force))

    def _matrix(self, matrices: list[FloatArray], own: FloatArray | float) -> sp.csr_array:
        """Sparse matrix over the unknowns."""
        matrix, columns = assembled(self.model, matrices), self.acceleration.columns
        if not columns.shape[2]:
            return matrix
        C, R, E = condensed(self.model, matrices, columns, columns)
        return sp.block_array([[matrix, C], [R, E + own]], format="csr")

    def _power(
        self, key: tuple[object, str], matrix: sp.csr_array, displacement: FloatArray
    ) -> float:
        """Spectral radius of Gamma A on motions that keep the constraints; from the last vector."""
        vector = self._vectors.get(key)
        if vector is None:
            vector = np.random.default_rng(0).standard_normal(matrix.shape[0])
            self._vectors[key] = vector
        if not matrix.nnz or not np.abs(matrix.data).max() > 0:
            return 0.0
        gradients = self.model.constraints.gradients(displacement)
        radius = 0.0
        for _ in range(200):
            vector = vector / np.linalg.norm(vector)
            before, vector = radius, self._project(matrix @ vector, gradients)
            radius = float(np.linalg.norm(vector))
            if abs(radius - before) <= 2e-3 * radius:
                break
        self._vectors[key] = vector
        return 1.02 * radius  # the iteration approaches it from below

    def _project(self, force: FloatArray, gradients: list[FloatArray]) -> FloatArray:
        """Acceleration by a force, with the constraints kept."""
        free = self.acceleration.solve(force)
        full = np.zeros(self.model.numbering.shape)
        self.acceleration.add(free, full)
        push, _ = self.acceleration.push(gradients, -self.model.constraints.rate(gradients, full))
        return free + push


def _bound(c: float, w: float) -> float:
    """Bound of the eigenvalues, (c + sqrt(c^2 + 4 w^2)) / 2, 1/s."""
    return 0.5 * (c + float(np.sqrt(c * c + 4.0 * w * w)))


def _describe(term: Term, c: float, w: float, rate: float) -> str:
    """Cause in words."""
    name = type(term).__name__
    if isinstance(term, FibreStress):
        kind = "the active stiffness" + (" (force-velocity slope)" if c > w else "")
    elif isinstance(term, Contact):
        kind = "the contact damping" if c > w else "the contact stiffness"
        name = f"{term.surface!r} on {type(term.obstacle).__name__}"
    elif isinstance(term, SurfaceTerm):
        kind = "the surface stiffness"
    else:
        kind = "the viscosity" if c > w else "the passive stiffness"
    return f"{kind} of {name} (fastest rate {rate:.3g} 1/s)"


def assembled(model: Model, matrices: list[FloatArray]) -> sp.csr_array:
    """Sparse matrix over the free components from element matrices (m, 3k, 3k)."""
    rows, columns, values = [], [], []
    for dofs, part in zip(model.numbering.part_dofs, matrices, strict=True):
        row = np.broadcast_to(dofs[:, :, None], part.shape)
        column = np.broadcast_to(dofs[:, None], part.shape)
        keep = (row >= 0) & (column >= 0)
        rows.append(row[keep])
        columns.append(column[keep])
        values.append(part[keep])
    place = (np.concatenate(rows), np.concatenate(columns))
    size = 3 * len(model.numbering.free)
    return sp.coo_array((np.concatenate(values), place), shape=(size, size)).tocsr()
