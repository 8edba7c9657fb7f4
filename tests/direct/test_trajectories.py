"""The same motion from both solvers: the difference falls at order 2 with the FEniCSx step."""

from __future__ import annotations

import numpy as np
import pytest
from cases import relative

from dolfin_tongue.boundary import Attached, Gravity
from dolfin_tongue.constitutive import ActiveMuscles, ReportTissue, Viscosity
from dolfin_tongue.control import SmoothRamp
from dolfin_tongue.direct import Adaptive, TrBdf2
from dolfin_tongue.geometry.simple import block_body
from dolfin_tongue.scene.scene import Scene

pytest.importorskip("dolfinx")
END = 0.04


@pytest.fixture(scope="module")
def scene() -> Scene:
    """Block under gravity whose muscle contracts."""
    body = block_body((0.03, 0.02, 0.01), (3, 2, 1), muscles={"pull": (1.0, 0.3, 0.1)})
    muscle = ActiveMuscles({"pull": SmoothRamp(0.2, 0.0, END)})
    terms = (ReportTissue(), Viscosity(10.0), muscle, Gravity())
    return Scene(body, terms, (Attached("x0"),))


@pytest.fixture(scope="module")
def reference(scene):
    """Tight direct solution."""
    *_, state = Adaptive(1e-12, rtol=1e-11).solver(scene).march(END)
    return state


def test_difference_falls_at_order_2(scene, reference):
    from dolfin_tongue.fenicsx import GeneralisedAlpha

    error = []
    for dt in (1e-3, 5e-4, 2.5e-4):
        *_, state = GeneralisedAlpha(dt=dt).solver(scene).march(END)
        error.append(
            [
                relative(getattr(state, name), getattr(reference, name))
                for name in ("displacement", "velocity", "pressure")
            ]
        )
    order = np.log2(np.array(error[:-1]) / np.array(error[1:]))
    assert (order[-1] > 1.8).all(), order
    # Velocities are the least accurate: fast vibrations carry them, not the displacements.
    assert (np.array(error[-1]) <= [2e-4, 2e-2, 1e-3]).all(), error[-1]


def test_pressures_agree_with_the_multipliers(scene, reference):
    from dolfin_tongue.fenicsx import GeneralisedAlpha

    *_, state = GeneralisedAlpha(dt=2.5e-4).solver(scene).march(END)
    assert np.abs(reference.pressure).max() > 100.0  # Pa: not the trivial agreement of zeros
    assert relative(state.pressure, reference.pressure) <= 2e-3


def test_the_implicit_direct_method_gives_that_motion_too(scene, reference):
    *_, state = TrBdf2(5e-4, newton=1e-11).solver(scene).march(END)
    for name, bound in (("displacement", 5e-4), ("velocity", 2e-2), ("pressure", 1e-3)):
        assert relative(getattr(state, name), getattr(reference, name)) <= bound
