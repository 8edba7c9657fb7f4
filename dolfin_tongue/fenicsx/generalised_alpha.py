"""Motion in time: the generalised-alpha method by PETSc TS (see `ts_stepper`)."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from dolfin_tongue.base.errors import OutOfRange, is_number, require_positive
from dolfin_tongue.body.state import State
from dolfin_tongue.control import Instant
from dolfin_tongue.fenicsx.observation import SystemObserver
from dolfin_tongue.fenicsx.pairs import pair_of
from dolfin_tongue.fenicsx.system import System
from dolfin_tongue.fenicsx.tolerances import Tolerances
from dolfin_tongue.fenicsx.ts_stepper import TsStepper
from dolfin_tongue.march.solver import Solver
from dolfin_tongue.march.steps import StepControl
from dolfin_tongue.scene.scene import Scene

#: Members of the family and the options of TS that choose them, besides the spectral radius.
FAMILY: dict[str, dict[str, float]] = {
    "generalised_alpha": {},
    "backward_euler": {
        "ts_alpha_alpha_m": 1,
        "ts_alpha_alpha_f": 1,
        "ts_alpha_gamma": 1,
        "ts_alpha_beta": 0.5,
    },
}


@dataclass(frozen=True)
class GeneralisedAlpha:
    """How the FEniCSx solver marches in time.

    Parameters
    ----------
    dt : step, s, > 0; with `tolerance` the first step and the unit of the limits.
    method : ``"generalised_alpha"`` or, for comparisons, ``"backward_euler"`` (order 1, the member
        alpha_m = alpha_f = gamma = 1, beta = 1/2 of the same family).
    spectral_radius : of the method at high frequencies, in [0, 1]; 1 keeps all energy and dies of
        it, 0 damps the most. The default 0.8 damps what dt does not resolve within some steps.
    tolerance : largest error of a nodal displacement per step, m; None keeps dt fixed.
    largest : largest step where the step adapts, s; default 10 dt.
    smallest : step below which a run that loses convergence is given up, s; default dt / 1000.
    newton : tolerances of Newton's method.
    pair : displacement and pressure spaces, see `pairs.PAIRS`.
    """

    dt: float = 5e-3
    method: str = "generalised_alpha"
    spectral_radius: float = 0.8
    tolerance: float | None = None
    largest: float | None = None
    smallest: float | None = None
    newton: Tolerances = field(default_factory=Tolerances)
    pair: str = "Q1/P0"

    def __post_init__(self) -> None:
        require_positive(self, "s", dt=self.dt)
        if not (is_number(self.spectral_radius) and 0 <= self.spectral_radius <= 1):
            raise OutOfRange("GeneralisedAlpha.spectral_radius", self.spectral_radius, "in [0, 1]")
        if self.tolerance is not None:
            require_positive(self, "m", tolerance=self.tolerance)
        for name in ("smallest", "largest"):
            if getattr(self, name) is not None:
                require_positive(self, "s", **{name: getattr(self, name)})
        control = self.control
        if not control.smallest <= self.dt <= control.largest:
            limits = f"between {control.smallest:g} and {control.largest:g}"
            raise OutOfRange("GeneralisedAlpha.dt", self.dt, limits, "s")
        if not isinstance(self.newton, Tolerances):
            raise OutOfRange("GeneralisedAlpha.newton", self.newton, "of the class Tolerances")
        if self.method not in FAMILY:
            raise OutOfRange("GeneralisedAlpha.method", self.method, f"one of {', '.join(FAMILY)}")
        pair_of(self.pair)

    @property
    def stage(self) -> float:
        """Fraction of a step at which its stage stands, alpha_f."""
        return 1.0 if self.method == "backward_euler" else 1 / (1 + self.spectral_radius)

    @property
    def control(self) -> StepControl:
        """Sizes of steps.

        After a cut steps grow by half at most: the method carries the acceleration of a short step
        into the next one, and over a step four times as long it would be a push that no force gave.
        """
        smallest, largest = self.smallest or self.dt / 1000, self.largest or 10 * self.dt
        return StepControl(self.dt, self.tolerance, smallest, largest, cut=0.25, growth=1.5)

    def with_pair(self, pair: str) -> GeneralisedAlpha:
        """Return the same method with another pair of spaces."""
        return replace(self, pair=pair)

    def solver(self, scene: Scene) -> GeneralisedAlphaSolver:
        """Return the solver of a scene."""
        return GeneralisedAlphaSolver(scene, self)


class GeneralisedAlphaSolver(SystemObserver, Solver):
    """Motion of a scene by DOLFINx and PETSc.

    Parameters
    ----------
    scene : body, terms, supports.
    method : step size, tolerances, spaces.
    """

    name = "FEniCSx"
    stepper: TsStepper

    def __init__(self, scene: Scene, method: GeneralisedAlpha):
        super().__init__(System(scene, dynamic=True, pair=method.pair))
        self.method, self.control = method, method.control
        radius = {"ts_alpha_radius": method.spectral_radius}
        options = radius | FAMILY[method.method]
        self.stepper = TsStepper(self.system, options, method.stage, method.newton)

    def rest(self, time: float = 0.0) -> State:
        """Return the reference configuration at rest."""
        zero = np.zeros(self.system.size)
        return self.system.state_of(Instant(time), zero, zero)
