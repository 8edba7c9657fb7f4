"""Equilibrium with PETSc SNES and load stepping."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from petsc4py import PETSc

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.base.errors import NotConverged, OutOfRange, is_number
from dolfin_tongue.body.state import NOTHING, State
from dolfin_tongue.control import Instant, Memory
from dolfin_tongue.fenicsx.arguments import STATIC, Arguments
from dolfin_tongue.fenicsx.newton import SNES_OPTIONS, Newton, reason_name, set_options
from dolfin_tongue.fenicsx.observation import SystemObserver
from dolfin_tongue.fenicsx.system import System
from dolfin_tongue.fenicsx.tolerances import STATIC_TOLERANCES, Tolerances
from dolfin_tongue.march.diagnosis import diagnosis
from dolfin_tongue.scene.scene import Scene


class Statics(SystemObserver):
    """Equilibrium of a scene under loads that grow from 0 to their full size.

    Gravity, activations, forces on bones, prescribed displacements and the ways of moved obstacles
    all grow alike with the load factor.

    Parameters
    ----------
    scene : its supports must hold the body; BadScene otherwise.
    tolerances : of Newton's method.
    time : at which controls and motions are read, s (default: when all ramps are over).
    pair : displacement and pressure spaces, see `pairs.PAIRS`.
    """

    newton: Newton

    def __init__(
        self,
        scene: Scene,
        tolerances: Tolerances = STATIC_TOLERANCES,
        time: float = 1e9,
        pair: str = "Q1/P0",
    ):
        if not is_number(time):
            raise OutOfRange("time", time, "a finite number", "s")
        super().__init__(System(scene, dynamic=False, pair=pair))
        self.time, self._tolerances = time, tolerances
        self._still: FloatArray = np.zeros(self.system.size)
        self._memory: Memory = NOTHING
        self._load = 0.0
        self._kept: FloatArray = self._still
        self._connect()

    def _connect(self) -> None:
        """Make SNES and its vectors; anew after PETSc broke off, since vectors stay locked."""
        snes = PETSc.SNES().create(PETSc.COMM_SELF)
        set_options(snes, SNES_OPTIONS)
        counts = self.newton.counts if hasattr(self, "newton") else None
        self.newton = Newton(self.system, snes, self._tolerances, counts)
        self._solution = PETSc.Vec().createSeq(self.system.size, comm=PETSc.COMM_SELF)
        function = self.newton.remember_errors(self._function)
        snes.setFunction(function, self._solution.duplicate())
        snes.setJacobian(self.newton.remember_errors(self._jacobian), self.newton.matrix)

    def _arguments(self, y: FloatArray) -> Arguments:
        now, still = Instant(self.time, self._memory), self._still
        return Arguments(now, self.time, y, still, still, y, self._load)

    def _function(self, snes: PETSc.SNES, state: PETSc.Vec, out: PETSc.Vec) -> None:
        self.newton.residuals += 1
        self.system.residual(self._arguments(state.array_r), out.array_w)
        out.array_w[:] -= self._kept

    def _jacobian(
        self, snes: PETSc.SNES, state: PETSc.Vec, matrix: PETSc.Mat, _: PETSc.Mat
    ) -> None:
        at = self._arguments(state.array_r)
        self.newton.jacobian(matrix, (), lambda: self.system.jacobian(at, STATIC, matrix))

    def load_steps(
        self, first: float = 1.0, smallest: float = 1e-4, start: State | None = None
    ) -> Iterator[State]:
        """Raise the loads to their full size; yields each equilibrium on the way.

        From a start that is no equilibrium of this scene, what is out of balance there is taken
        away instead: G(y) = (1 - s) G(start), with s from 0 to 1.

        Parameters
        ----------
        first : first increment of the load factor, in (0, 1]; later ones adapt.
        smallest : increment below which the search is given up.
        start : a state to start from, e.g. an equilibrium under other loads; default: at rest.

        Raises
        ------
        NotConverged : with the load factor reached and the most distorted cells.
        """
        factor, increment = 0.0, first
        accepted, out_of_balance = self._begin(start)
        slope: FloatArray = np.zeros_like(accepted)
        while factor < 1.0:
            increment = min(increment, 1.0 - factor)
            target = 1.0 if factor + increment > 1 - 1e-12 else factor + increment
            if start is None:
                self._load = target
            else:
                self._kept = (1.0 - target) * out_of_balance
            guess = accepted + slope * increment
            load = factor if start is None else 1.0
            converged, iterations = self._solve(accepted, load, guess)
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
                found = diagnosis(self.scene.body, self.system.displacement(accepted))
                raise NotConverged(f"{reason} at load factor {target:.4g}", factor, found)

    def _begin(self, start: State | None) -> tuple[FloatArray, FloatArray]:
        """First guess, and what is out of balance there."""
        body, size = self.scene.body, self.system.size
        zero = np.zeros(size)
        rest = start or self.system.state_of(Instant(self.time), zero, zero)
        self._memory = (start.memory if start else NOTHING) or self.scene.begin(body, rest)
        self._load, self._kept = 1.0, self._still
        if start is None:
            return zero, zero
        y, out = self.system.vectors(start)[0], np.zeros(size)
        self.system.residual(self._arguments(y), out)
        return y, out

    def solve(self, start: State | None = None) -> State:
        """Equilibrium under the full loads; see `load_steps`."""
        for state in self.load_steps(start=start):
            last = state
        return last

    def _solve(self, accepted: FloatArray, load: float, guess: FloatArray) -> tuple[bool, int]:
        """One Newton solve from an equilibrium and its load; (converged, iterations)."""
        state = self.system.state_of(Instant(self.time), accepted, self._still)
        state = replace(state, load=load)
        self._memory = {**self._memory, **self.sides(state)} or NOTHING
        self._solution.array_w[:] = guess
        self.newton.renew()
        try:
            self.newton.snes.solve(None, self._solution)
        except PETSc.Error as error:  # the factorisation broke down
            self.newton.reraise(error)
            self._connect()
            return False, 0
        at = self._arguments(self._solution.array_r)
        converged = self.newton.snes.getConvergedReason() > 0 and not any(
            part.reason_to_reject(at) for part in self.system.couplings
        )
        return converged, self.newton.snes.getIterationNumber()

    def _state(self, factor: float, y: FloatArray, step: float, iterations: int) -> State:
        now = Instant(self.time, self._memory)
        state = self.system.state_of(now, y, self._still, step, iterations)
        return replace(state, load=factor)
