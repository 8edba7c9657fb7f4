"""Steps of PETSc TS ``alpha2``, the generalised-alpha method of Chung and Hulbert 1993.

The stage of the method stands at t_n + alpha_f dt. Momentum is stated there. The volume condition
and the held nodes are stated at the end of the step, whose state follows from the stage by
y_end = y_n + (y_stage - y_n) / alpha_f. So every accepted state keeps its volumes to the tolerance
of Newton's method; stated at the stage, they would be lost at order dt^2.
The pressure is an unknown of the stage and has no memory.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from petsc4py import PETSc

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.body.shape import smallest_ratios
from dolfin_tongue.body.state import State
from dolfin_tongue.control import Instant
from dolfin_tongue.fenicsx.arguments import Arguments, Shifts
from dolfin_tongue.fenicsx.newton import (
    SNES_OPTIONS,
    Newton,
    Reason,
    reason_name,
    set_options,
)
from dolfin_tongue.fenicsx.system import System
from dolfin_tongue.fenicsx.tolerances import Tolerances
from dolfin_tongue.march.solver import Attempt, Stepper


@dataclass(eq=False)
class Begin:
    """Where a step begins.

    Parameters
    ----------
    state : the last accepted one.
    time : of TS, s.
    y, rate : vectors of TS.
    iterations : of Newton's method so far.
    rejected : whether a try of it has been rejected already.
    """

    state: State
    time: float
    y: FloatArray
    rate: FloatArray
    iterations: int
    rejected: bool = False


class TsStepper(Stepper):
    """One run.

    Parameters
    ----------
    system : a dynamic one.
    options : of TS, which choose the member of the family.
    stage : fraction of a step at which its stage stands, alpha_f.
    tolerances : of Newton's method.
    """

    newton: Newton

    def __init__(
        self, system: System, options: Mapping[str, object], stage: float, tolerances: Tolerances
    ):
        self.system, self.stage = system, stage
        self._options, self._tolerances = dict(options), tolerances
        self._velocity_before: FloatArray | None = None
        self._multipliers_before: FloatArray | None = None
        self._multipliers = np.zeros(len(system.multiplier_dofs))
        self._begin: Begin | None = None
        self._end = 0.0, self._multipliers
        self._memory = Instant(0.0).memory
        self._solved = self._broken = False
        self.steps = 0
        self._connect()

    def _connect(self) -> None:
        """Make TS and Newton; anew after PETSc broke off, since its vectors stay locked."""
        self.ts = self._new_ts()
        counts = self.newton.counts if hasattr(self, "newton") else None
        self.newton = Newton(self.system, self.ts.getSNES(), self._tolerances, counts)
        self.ts.setI2Jacobian(self.newton.remember_errors(self._jacobian), self.newton.matrix)
        function = self.newton.remember_errors(self._function)
        empty = PETSc.Vec().createSeq(self.system.size, comm=PETSc.COMM_SELF)
        self.ts.setI2Function(function, empty)
        self.ts.getSNES().setInitialGuess(self.newton.remember_errors(self._predict))

    def _new_ts(self) -> PETSc.TS:
        ts = PETSc.TS().create(PETSc.COMM_SELF)
        ts.setType("alpha2")
        ts.setMaxTime(1e300)  # the end is ours to meet; see `attempt`
        ts.setMaxSteps(2**31 - 2)
        ts.setMaxSNESFailures(-1)
        ts.setMaxStepRejections(0)  # a failed step comes back to us
        ts.setErrorIfStepFails(False)
        set_options(ts, {"ts_adapt_type": "none"} | self._options | SNES_OPTIONS)
        return ts

    def counts(self) -> dict[str, int]:
        """Return how often what was done."""
        return {
            "steps": self.steps,
            "newton_iterations": self.newton.iterations,
            "residuals": self.newton.residuals,
            "factorisations": self.newton.factorisations,
        }

    # -- callbacks of PETSc ------------------------------------------------------------------------

    def _arguments(
        self, time: float, state: PETSc.Vec, rate: PETSc.Vec, acceleration: PETSc.Vec
    ) -> tuple[Arguments, float]:
        """Arguments of the system at a stage; fraction of the step at which it stands.

        While TS estimates an initial acceleration by two backward Euler steps of half size, its
        step is that half, and the stage stands at or beyond the end: there stage and end agree.
        """
        dt, begin = self.ts.getTimeStep(), self.ts.getTime()
        y, fraction = state.array_r, (time - begin) / dt
        if fraction > 1 - 1e-9:
            fraction, time_end, end = 1.0, time, y
        else:
            start = self.ts.getSolution().array_r
            end = start + (y - start) / fraction
            time_end = begin + dt
        now = Instant(time, self._memory)
        return Arguments(now, time_end, y, rate.array_r, acceleration.array_r, end), fraction

    def _function(self, ts: PETSc.TS, time: float, *vectors: PETSc.Vec) -> None:
        state, rate, acceleration, out = vectors
        at, _ = self._arguments(time, state, rate, acceleration)
        self.newton.residuals += 1
        self.system.residual(at, out.array_w)
        self._multipliers = at.state[self.system.multiplier_dofs]

    def _jacobian(self, ts: PETSc.TS, time: float, *given: Any) -> None:
        state, rate, acceleration, shift_v, shift_a, matrix, _ = given

        def assemble() -> None:
            at, fraction = self._arguments(time, state, rate, acceleration)
            self.system.jacobian(at, Shifts(shift_v, shift_a, 1.0 / fraction), matrix)

        self.newton.jacobian(matrix, (shift_v, shift_a), assemble)

    def _predict(self, snes: PETSc.SNES, guess: PETSc.Vec) -> None:
        """Start Newton from an extrapolated displacement; TS itself would start from no motion."""
        _, rate = self.ts.getSolution2()
        velocity = rate.array_r
        if self._velocity_before is not None:
            velocity = 1.5 * velocity - 0.5 * self._velocity_before
        dofs = self.system.position_dofs
        guess.array_w[dofs] += self.ts.getTimeStep() * velocity[dofs]

    # -- steps -------------------------------------------------------------------------------------

    def begin(self, state: State) -> State:
        """Give TS the vectors of a state and let it begin there, without an acceleration."""
        self._set_vectors(state.time, *self.system.vectors(state))
        return state

    def _set_vectors(self, time: float, y: FloatArray, rate: FloatArray) -> None:
        self.ts.setTime(time)
        vectors = [PETSc.Vec().createWithArray(x.copy(), comm=PETSc.COMM_SELF) for x in (y, rate)]
        self.ts.setSolution2(*vectors)
        self.ts.restartStep()
        self._velocity_before = self._multipliers_before = None
        self.newton.renew()

    def attempt(self, state: State, dt: float, end: float) -> Attempt:
        """Take one TS step and judge its end."""
        if self._begin is None or self._begin.state is not state:
            solution, rate = self.ts.getSolution2()
            y, v = solution.array_r.copy(), rate.array_r.copy()
            self._begin = Begin(state, self.ts.getTime(), y, v, self.newton.iterations)
        self._memory = state.memory
        self.ts.setTimeStep(dt)
        cause = self._try_step()
        if cause:
            return Attempt(None, cause=cause)
        time = end if abs(self.ts.getTime() - end) <= 1e-9 * dt else self.ts.getTime()
        return Attempt(self._accepted(time, dt), self._error(state, dt))

    def _try_step(self) -> str:
        """One TS step; why it must not be accepted, or nothing."""
        self._solved = self._broken = False
        self.ts.setConvergedReason(PETSc.TS.ConvergedReason.ITERATING)
        try:
            self.ts.step()
        except PETSc.Error as error:  # the factorisation broke down: a smaller step may do
            self.newton.reraise(error)
            self._broken = True
            return reason_name(Reason.DIVERGED_LINEAR_SOLVE)
        reason = self.ts.getSNES().getConvergedReason()
        self._solved = reason > 0
        return self._judged() if self._solved else reason_name(reason)

    def _judged(self) -> str:
        """Refuse a step whose end, beyond the stage that was solved, is impossible."""
        assert self._begin is not None
        solution, rate = self.ts.getSolution2()
        y = solution.array_r
        if not (smallest_ratios(self.system.scene.body, self.system.displacement(y)) > 0).all():
            return "INVERTED_CELL"
        if self.system.couplings:
            now = Instant(self.ts.getTime(), self._memory)
            at = Arguments(now, now.time, y, rate.array_r, np.zeros_like(y), y)
            for part in self.system.couplings:
                if reason := part.reason_to_reject(at, self._begin.y):
                    return reason
        return ""

    def _error(self, state: State, dt: float) -> float | None:
        """Error of the step, m: a third of the difference to the extrapolated velocity's path."""
        if self._velocity_before is None:
            return None
        solution, _ = self.ts.getSolution2()
        previous = self.system.displacement(self._velocity_before)
        ratio = dt / state.step if state.step else 1.0
        predicted = state.velocity + 0.5 * ratio * (state.velocity - previous)
        path = state.displacement + dt * predicted
        return float(np.abs(self.system.displacement(solution.array_r) - path).max()) / 3

    def _accepted(self, time: float, dt: float) -> State:
        """State at the end of a step, with the multipliers extrapolated from the stages."""
        assert self._begin is not None
        solution, rate = self.ts.getSolution2()
        y, dofs = solution.array_r.copy(), self.system.multiplier_dofs
        if self._multipliers_before is None:
            y[dofs] = self._multipliers
        else:
            change = self._multipliers - self._multipliers_before
            y[dofs] = self._multipliers + (1 - self.stage) * change
        iterations = self.newton.iterations - self._begin.iterations
        self._end = time, y[dofs]
        now = Instant(time, self._memory)
        return self.system.state_of(now, y, rate.array_r, dt, iterations)

    def accept(self) -> None:
        """Keep the step."""
        assert self._begin is not None
        time, multipliers = self._end
        self.ts.setTime(time)
        self.ts.getSolution2()[0].array_w[self.system.multiplier_dofs] = multipliers
        self._velocity_before = self._begin.rate
        self._multipliers_before = self._multipliers
        self._begin = None
        self.steps += 1

    def reject(self) -> None:
        """Return to the begin of the step, with the acceleration that was there.

        TS keeps that for the next try if it was told to roll back. A try that fails does not undo
        the telling; one that TS completed, and that we refuse, does. An acceleration estimated anew
        would add the velocity's error across the volume condition over and over, until repeated
        cuts let the velocities grow as 1/dt.
        """
        begin = self._begin
        assert begin is not None
        if self._broken:
            self._connect()
            self._set_vectors(begin.time, begin.y, begin.rate)
            begin.rejected = False
            return
        if self._solved or not begin.rejected:
            self.ts.rollBack()
        begin.rejected = True
        solution, rate = self.ts.getSolution2()
        solution.array_w[:], rate.array_w[:] = begin.y, begin.rate
        self.ts.setTime(begin.time)
        self.newton.renew()
