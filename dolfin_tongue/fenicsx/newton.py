"""Newton's method in PETSc SNES with a factorisation that is kept as long as it serves.

Assembling and factoring the tangent costs about ten times a residual and a back-substitution. The
factorisation is therefore kept across iterations and steps, and renewed when the iteration
contracts too slowly, so that it falls back to full Newton by itself where that is needed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import isclose

import numpy as np
from petsc4py import PETSc

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.fenicsx.system import System
from dolfin_tongue.fenicsx.tolerances import Tolerances

Reason = PETSc.SNES.ConvergedReason
_NAMES = {value: name for name, value in vars(Reason).items() if isinstance(value, int)}


#: Newton with full steps (a merit function would mix newtons and volumes) and a direct solver.
SNES_OPTIONS = {
    "snes_type": "newtonls",
    "snes_linesearch_type": "basic",
    "ksp_type": "preonly",
    "pc_type": "lu",
    "pc_factor_mat_solver_type": "mumps",
    "mat_mumps_icntl_14": 200,  # room for pivoting: a saddle point needs more than MUMPS expects
}


def set_options(solver: PETSc.SNES | PETSc.TS, options: Mapping[str, object]) -> None:
    """Apply PETSc options to one solver alone: under a prefix of its own, removed afterwards."""
    prefix = f"tongue{id(solver)}_"
    solver.setOptionsPrefix(prefix)
    database = PETSc.Options(prefix)
    for name, value in options.items():
        database[name] = value
    solver.setFromOptions()
    for name in options:
        database.delValue(name)


def reason_name(reason: int) -> str:
    """Return PETSc's name of an SNES reason, e.g. ``DIVERGED_FNORM_NAN``."""
    return _NAMES.get(reason, str(reason))


def _same(first: tuple[float, ...], second: tuple[float, ...]) -> bool:
    """Whether two keys agree to a millionth."""
    pairs = zip(first, second, strict=False)
    return len(first) == len(second) and all(isclose(a, b, rel_tol=1e-6) for a, b in pairs)


class Newton:
    """Convergence test and renewal policy on an SNES; for statics and for a TS alike.

    Parameters
    ----------
    system : the equations.
    snes : a new SNES, or the one of a TS.
    tolerances : when it is done.
    counts : of an earlier one that this one replaces.
    """

    def __init__(
        self,
        system: System,
        snes: PETSc.SNES,
        tolerances: Tolerances,
        counts: tuple[int, int, int] | None = None,
    ):
        self.system, self.snes, self.tolerances = system, snes, tolerances
        self.matrix = system.new_matrix()
        self._stale = True
        self._key: tuple[float, ...] = ()
        self._step_sizes: list[float] = []
        self.residuals, self.iterations, self.factorisations = counts or (0, 0, 0)
        self._raised: BaseException | None = None
        self._positions = system.position_dofs
        snes.setConvergenceTest(self.remember_errors(self._converged))

    @property
    def counts(self) -> tuple[int, int, int]:
        """Residuals, iterations and factorisations so far."""
        return self.residuals, self.iterations, self.factorisations

    def remember_errors(self, callback: Callable) -> Callable:
        """Remember what a callback of PETSc raises: PETSc reports an error of its own instead."""

        def watched(*arguments: object) -> object:
            try:
                return callback(*arguments)
            except BaseException as error:
                self._raised = error
                raise

        return watched

    def reraise(self, error: BaseException) -> None:
        """Raise what a callback had raised (a user's control, Ctrl-C), if that was the cause."""
        if self._raised is not None:
            cause, self._raised = self._raised, None
            raise cause from error

    def renew(self) -> None:
        """Ask for a new factorisation at the next iteration."""
        self._stale = True

    def jacobian(
        self, matrix: PETSc.Mat, key: tuple[float, ...], assemble: Callable[[], None]
    ) -> None:
        """Assemble the matrix if it is stale; PETSc keeps the factors of an untouched matrix.

        Parameters
        ----------
        matrix : the matrix that SNES holds.
        key : numbers that the matrix depends on besides the state (shifts of the time step); a
            change of a millionth renews it.
        assemble : fills the matrix.
        """
        if self._stale or not _same(key, self._key):
            assemble()
            self.factorisations += 1
            self._stale, self._key = self.tolerances.renew_above == 0, key

    def _converged(
        self, snes: PETSc.SNES, iteration: int, norms: tuple[float, float, float]
    ) -> int | None:
        """Judge displacement update and volumes by their own units; plan a renewal."""
        _, _, residual_norm = norms
        if not np.isfinite(residual_norm):
            return Reason.DIVERGED_FNORM_NAN
        if iteration == 0:
            self._step_sizes = []
            return None
        self.iterations += 1
        update = snes.getSolutionUpdate().array_r[self._positions]
        size = float(np.abs(update).max())
        residual = snes.getFunction()[0].array_r
        converged = self.volume_error(residual) <= self.tolerances.volume and all(
            coupling.converged(residual) for coupling in self.system.couplings
        )
        if size <= self.tolerances.displacement and converged:
            return Reason.CONVERGED_SNORM_RELATIVE
        if iteration >= self.tolerances.iterations:
            return Reason.DIVERGED_MAX_IT
        self._plan(size)
        if len(self._step_sizes) > 3 and size > 10 * self._step_sizes[0]:
            return Reason.DIVERGED_DTOL
        return None

    def _plan(self, size: float) -> None:
        """Renew the factorisation where the updates shrink too slowly."""
        if self._step_sizes and size > self.tolerances.renew_above * self._step_sizes[-1]:
            self._stale = True
        self._step_sizes.append(size)

    def volume_error(self, residual: FloatArray) -> float:
        """Largest relative volume change of any cell, from a residual vector."""
        return float(np.abs(self.system.volume_change(residual)).max())
