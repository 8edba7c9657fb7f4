"""Equilibrium with PETSc SNES and load stepping."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from petsc4py import PETSc

from dolfin_tongue.base.errors import NotConverged
from dolfin_tongue.fenicsx.newton import SNES_OPTIONS, Newton, Tolerances, reason_name, set_options
from dolfin_tongue.fenicsx.system import System
from dolfin_tongue.march.diagnosis import where_and_why
from dolfin_tongue.march.state import State
from dolfin_tongue.scene.scene import Scene

#: Full Newton: from one load step to the next the tangent changes too much to keep it.
STATIC_TOLERANCES = Tolerances(iterations=25, renew_above=0.0)


class Statics:
    """Equilibrium of a scene under loads that grow from 0 to their full size.

    Parameters
    ----------
    scene : its supports must hold the body; BadScene otherwise.
    tolerances : of Newton's method.
    time : at which activations are evaluated, s (default: when all ramps are over).
    pair : displacement and pressure spaces, see `mesh.PAIRS`.
    """

    newton: Newton

    def __init__(
        self,
        scene: Scene,
        tolerances: Tolerances = STATIC_TOLERANCES,
        time: float = 1e9,
        pair: str = "Q1/P0",
    ):
        self.system = System(scene, dynamic=False, pair=pair)
        self.time, self._tolerances = time, tolerances
        self._connect()

    def _connect(self) -> None:
        """Make SNES and its vectors; anew after PETSc broke off, since vectors stay locked."""
        snes = PETSc.SNES().create(PETSc.COMM_SELF)
        set_options(snes, SNES_OPTIONS)
        counts = self.newton.counts if hasattr(self, "newton") else None
        self.newton = Newton(self.system, snes, self._tolerances, counts)
        self._solution = PETSc.Vec().createSeq(self.system.size)
        snes.setFunction(self.newton.careful(self._function), self._solution.duplicate())
        snes.setJacobian(self.newton.careful(self._jacobian), self.newton.matrix)

    def _function(self, snes: PETSc.SNES, state: PETSc.Vec, out: PETSc.Vec) -> None:
        self.newton.residuals += 1
        self.system.set_state(self.time, state.array_r)
        self.system.residual(self.time, out.array_w)

    def _jacobian(
        self, snes: PETSc.SNES, state: PETSc.Vec, matrix: PETSc.Mat, _: PETSc.Mat
    ) -> None:
        self.system.set_state(self.time, state.array_r)
        self.newton.jacobian(matrix, (), lambda: self.system.jacobian(matrix, time_end=self.time))

    def load_steps(self, first: float = 1.0, smallest: float = 1e-4) -> Iterator[State]:
        """Raise the loads to their full size; yields each equilibrium on the way.

        Parameters
        ----------
        first : first increment of the load factor, in (0, 1]; later ones adapt.
        smallest : increment below which the search is given up.

        Raises
        ------
        NotConverged : with the load factor reached and the most distorted cells.
        """
        factor, increment = 0.0, first
        accepted = np.zeros(self.system.size)
        slope = np.zeros_like(accepted)
        while factor < 1.0:
            increment = min(increment, 1.0 - factor)
            target = 1.0 if factor + increment > 1 - 1e-12 else factor + increment
            converged, iterations = self._solve(target, accepted, accepted + slope * increment)
            if converged:
                reached = self._solution.array_r.copy()
                slope, accepted = (reached - accepted) / increment, reached
                factor = target
                yield self._state(factor, accepted, increment, iterations)
                increment *= 2.0 if iterations <= 6 else 1.0
                continue
            increment /= 4.0
            slope = slope if increment < 0.05 else np.zeros_like(slope)
            if increment < smallest:
                reason = reason_name(self.newton.snes.getConvergedReason())
                where = where_and_why(self.system.scene.body, self.system.displacement(accepted))
                raise NotConverged(f"{reason} at load factor {target:.4g}", factor, where)

    def solve(self) -> State:
        """Equilibrium under the full loads; see `load_steps`."""
        for state in self.load_steps():
            last = state
        return last

    def _solve(self, factor: float, accepted: np.ndarray, guess: np.ndarray) -> tuple[bool, int]:
        """One Newton solve at a load factor; (converged, iterations)."""
        self.system.load.value = factor
        for part in self.system.couplings:
            part.begin(self.time, accepted)
        self._solution.array_w[:] = guess
        self.newton.renew()
        try:
            self.newton.snes.solve(None, self._solution)
        except PETSc.Error as error:  # the factorisation broke down
            self.newton.reraise(error)
            self._connect()
            return False, 0
        converged = self.newton.snes.getConvergedReason() > 0 and not any(
            part.refusal(self.time, self._solution.array_r) for part in self.system.couplings
        )
        return converged, self.newton.snes.getIterationNumber()

    def _state(self, factor: float, mixed: np.ndarray, step: float, iterations: int) -> State:
        return self.system.state_of(factor, mixed, np.zeros_like(mixed), step, iterations)
