"""One instant of a simulation, in the body's order: what solvers give and observers take."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from dolfin_tongue.base.arrays import FloatArray

#: Nothing to remember.
NOTHING: Mapping[str, Any] = {}


@dataclass(frozen=True)
class State:
    """State of a body.

    Parameters
    ----------
    time : s; in statics that at which controls are read.
    displacement : ndarray, shape (n, 3), m.
    velocity : ndarray, shape (n, 3), m/s; zero in statics.
    pressure : ndarray, shape (m,), Pa, positive in compression.
    step : length of the step that led here, s; 0 for an initial state.
    iterations : Newton iterations of that step.
    unknowns : the solver's own vectors of y and y', where nodal values do not say everything (a
        quadratic displacement).
    rigid, rigid_rate : ndarray, shape (b, 3) -- coordinates (m, m, rad) of the rigid bodies in the
        order of the scene, and their rates.
    sliding : ndarray, shape (s,) -- multipliers of the sliding nodes in the order of the scene:
        forces on them along dg/dy, N where that is a unit vector.
    load : factor on all loads; 1 in dynamics.
    memory : what controls, contacts and the method remember of the motion so far: arrays in nested
        mappings by name; see `control.timed`.
    """

    time: float
    displacement: FloatArray
    velocity: FloatArray
    pressure: FloatArray
    step: float = 0.0
    iterations: int = 0
    unknowns: tuple[FloatArray, FloatArray] | None = None
    rigid: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    rigid_rate: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    sliding: FloatArray = field(default_factory=lambda: np.zeros(0))
    load: float = 1.0
    memory: Mapping[str, Any] = field(default_factory=lambda: NOTHING)
