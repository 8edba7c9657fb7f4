"""Largest stable step of explicit methods, and what sets it.

Linearised at a state, the motion obeys M dU'' + C dU' + K dU = constraint forces, with the volumes
kept. Let c and w^2 be the spectral radii of Gamma C and Gamma K on motions that keep the volumes.
All eigenvalues s of the motion then have |s| <= (c + sqrt(c^2 + 4 w^2)) / 2. The constraint itself
adds the double eigenvalue -1/tau. Runge-Kutta 4 is stable where |s| dt <= 2.61 anywhere in the left
half-plane (2.785 on the real axis), so that dt is refused beyond 2.61 / max(|s|, 1/tau).

The radii come from power iterations; each term has its own, which tells the cause. Contact is seen
where it presses at the state; what it may become within a step is judged after the step, by the
energy that it made (`impacts`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from dolfin_tongue.arrays import FloatArray
from dolfin_tongue.boundary.contact import Contact
from dolfin_tongue.constitutive.active import FibreStress
from dolfin_tongue.direct.model import Model
from dolfin_tongue.direct.multipliers import Acceleration
from dolfin_tongue.term import SurfaceTerm, Term

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
        self, time: float, displacement: FloatArray, velocity: FloatArray, pressure: FloatArray
    ) -> Limit:
        """Limit at a state; the pressures enter through the Hessians of the volumes (101)."""
        state = (time, displacement, velocity)
        rate = _bound(*self._radii("all", state, pressure, None))
        by_tau = 1.0 / self.acceleration.tau if self.acceleration.tau else 0.0
        if by_tau >= rate:
            cause = f"the constraint time constant tau = {self.acceleration.tau:g} s"
            return Limit(RK4_RADIUS / by_tau, cause)
        if rate == 0.0:
            return Limit(np.inf, "nothing")
        return Limit(RK4_RADIUS / rate, self._cause(state, rate))

    def _cause(self, state: tuple[float, FloatArray, FloatArray], rate: float) -> str:
        """Name the term whose own radius is the largest."""
        model = self.model
        terms = [term for term, _ in (*model.laws, *model.membranes, *model.obstacles)]
        parts = [self._radii(i, state, None, (term,)) for i, term in enumerate(terms)]
        bounds = [_bound(*part) for part in parts]
        worst = int(np.argmax(bounds)) if bounds else 0
        if not bounds or bounds[worst] < 0.3 * rate:
            return f"the pressures of the volume constraint (fastest rate {rate:.3g} 1/s)"
        return _describe(terms[worst], *parts[worst], rate)

    def _radii(
        self,
        key: object,
        state: tuple[float, FloatArray, FloatArray],
        pressure: FloatArray | None,
        terms: tuple[Term, ...] | None,
    ) -> tuple[float, float]:
        """Radii c, 1/s, and w, 1/s, of some terms."""
        stiffness = self.model.element_tangents(*state, 1.0, 0.0, terms)
        if pressure is not None:
            self.model.add_constraint_hessians(state[1], -pressure, stiffness)
        w2 = self._power((key, "stiffness"), stiffness, state[1])
        if not self.model.rated:
            return 0.0, float(np.sqrt(w2))
        damping = self.model.element_tangents(*state, 0.0, 1.0, terms)
        return self._power((key, "damping"), damping, state[1]), float(np.sqrt(w2))

    def _power(
        self, key: tuple[object, str], matrices: list[FloatArray], displacement: FloatArray
    ) -> float:
        """Spectral radius of Gamma A on volume-keeping motions; starts from the last vector."""
        matrix = assembled(self.model, matrices)
        if not matrix.nnz or not np.abs(matrix.data).max() > 0:
            return 0.0
        gradients = self.model.volume_gradients(displacement)
        vector = self._vectors.get(key)
        if vector is None:
            vector = np.random.default_rng(0).standard_normal(matrix.shape[0])
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
        """Acceleration by a force, with the volumes kept."""
        free = self.acceleration.solve_mass(force.reshape(-1, 3))
        full = np.zeros_like(self.model.load)
        full[self.model.free] = free
        push, _ = self.acceleration.push(gradients, -self.model.constraint_rate(gradients, full))
        return (free + push).ravel()


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
    for dofs, part in zip(model.block_dofs, matrices, strict=True):
        row = np.broadcast_to(dofs[:, :, None], part.shape)
        column = np.broadcast_to(dofs[:, None], part.shape)
        keep = (row >= 0) & (column >= 0)
        rows.append(row[keep])
        columns.append(column[keep])
        values.append(part[keep])
    place = (np.concatenate(rows), np.concatenate(columns))
    size = 3 * len(model.free)
    return sp.coo_array((np.concatenate(values), place), shape=(size, size)).tocsr()
