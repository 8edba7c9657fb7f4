"""Statics: prescribed displacements in steps, warm starts, time and load of a state."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from dolfin_tongue.base.errors import BadScene, OutOfRange
from dolfin_tongue.boundary import Attached, Contact, Gravity
from dolfin_tongue.constitutive import ActiveMuscles, MooneyRivlin, ReportTissue
from dolfin_tongue.control import Ramp, SmoothMove, Still
from dolfin_tongue.geometry.simple import block_body
from dolfin_tongue.rigid import RigidBody, Spring
from dolfin_tongue.scene import Scene
from dolfin_tongue.surfaces import Plane
from dolfin_tongue.terms import Held

pytest.importorskip("dolfinx")
from dolfin_tongue.fenicsx import Statics, Tolerances


@dataclass(frozen=True)
class Pulled(Held):
    """The face x1 is moved along x."""

    way: float

    def nodes(self, body):
        return body.nodes("x1")

    def displacement(self, points, time):
        return np.tile([self.way, 0.0, 0.0], (len(points), 1))


def block(cells=(3, 2, 2)):
    return block_body((0.03, 0.02, 0.02), cells, muscles={"along": (1.0, 0.0, 0.3)})


def test_a_large_displacement_is_reached_in_steps():
    """Stretched to twice its length at once Newton's method is lost; in steps it arrives."""
    scene = Scene(block(), (MooneyRivlin(),), (Attached("x0"), Pulled(0.03)))
    solver = Statics(scene)
    states = list(solver.load_steps(first=1.0))
    assert states[-1].load == 1.0
    end = scene.body.nodes("x1")
    for state in states:  # the load factor moves the held nodes
        np.testing.assert_allclose(state.displacement[end, 0], 0.03 * state.load, rtol=1e-12)
    gentle = list(solver.load_steps(first=0.05))
    assert len(gentle) > 3
    np.testing.assert_allclose(
        gentle[-1].displacement, states[-1].displacement, rtol=0, atol=1e-7 * 0.03
    )


def test_a_warm_start_leads_to_the_same_equilibrium():
    weak = ActiveMuscles({"along": Ramp(0.3)}, 20e3)
    strong = ActiveMuscles({"along": Ramp(0.35)}, 20e3)
    first, second = (
        Scene(block(), (ReportTissue(), Gravity(), term), (Attached("x0"),))
        for term in (weak, strong)
    )
    tight = Tolerances(1e-11, 1e-11)
    start = Statics(first, tight).solve()
    cold, warm = Statics(second, tight), Statics(second, tight)
    expected, found = cold.solve(), warm.solve(start=start)
    assert np.abs(found.displacement - expected.displacement).max() < 1e-10
    assert found.pressure == pytest.approx(expected.pressure, rel=1e-6, abs=1e-4)
    # the start is worth iterations
    assert warm.newton.iterations < cold.newton.iterations
    again = Statics(second, tight)
    assert again.solve(start=expected).iterations <= 2


def test_a_warm_start_far_away_is_reached_on_the_way():
    """From an equilibrium with another support, whose force is taken away in shares."""
    scene = Scene(block(), (ReportTissue(), Gravity()), (Attached("x0"),))
    start = Statics(Scene(block(), (ReportTissue(),), (Attached("x0"), Pulled(0.006)))).solve()
    end = Statics(scene).solve(start=start)
    expected = Statics(scene).solve()
    assert np.abs(end.displacement - expected.displacement).max() < 1e-6


def test_a_start_of_another_body_is_refused():
    scene = Scene(block(), (ReportTissue(),), (Attached("x0"),))
    other = Statics(Scene(block((2, 2, 2)), (ReportTissue(),), (Attached("x0"),))).solve()
    with pytest.raises(BadScene, match="displacement of shape"):
        Statics(scene).solve(start=other)


def test_the_time_of_a_static_state_is_that_of_its_controls():
    """Controls and motions are read at one time; the load factor is a number of its own."""
    body = replace(block(), points=block().points + np.array([0.0, 0.0, 1e-3]))
    motion = (Still(), Still(), SmoothMove(3e-3, 0.0, 0.1))
    press = Contact(Plane(), "z0", motion=motion)
    scene = Scene(body, (ReportTissue(), press), (Attached("z1"),))
    half, full = (Statics(scene, time=time) for time in (0.05, 0.2))
    states = [solver.solve() for solver in (half, full)]
    assert [state.time for state in states] == [0.05, 0.2]
    assert [state.load for state in states] == [1.0, 1.0]
    (low,), (high,) = (
        solver.contacts(state).values() for solver, state in zip((half, full), states, strict=True)
    )
    assert low.force[2] < 0.5 * high.force[2]  # the wall has come half the way
    partial = next(iter(full.load_steps(first=0.3)))
    assert partial.load == pytest.approx(0.3) and partial.time == 0.2


def test_prescribed_coordinates_grow_with_the_load():
    body = block()
    bone = RigidBody(
        "bone", ("x1",), 0.02, 1e-5, (0.035, 0.01, 0.01),
        (Spring((0.035, 0.01, 0.01), (0.035, 0.01, 0.05), stiffness=10.0),),
        motion={"x": SmoothMove(2e-3)},
    )  # fmt: skip
    scene = Scene(body, (ReportTissue(),), (Attached("x0"), bone))
    states = list(Statics(scene).load_steps(first=0.25))
    for state in states:
        assert state.rigid[0, 0] == pytest.approx(2e-3 * state.load, rel=1e-9)


def test_a_time_that_is_no_number_is_refused():
    scene = Scene(block(), (ReportTissue(),), (Attached("x0"),))
    with pytest.raises(OutOfRange, match="time"):
        Statics(scene, time=float("nan"))
