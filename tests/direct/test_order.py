"""Orders of the methods, measured against a tight reference; break points and adapted steps."""

from __future__ import annotations

import numpy as np
import pytest
from cases import END, Shaken, element_body, final, mixed_body, random_state, relative

from dolfin_tongue.base.errors import OutOfRange
from dolfin_tongue.body.body import Body
from dolfin_tongue.body.state import State
from dolfin_tongue.boundary import Attached, Gravity
from dolfin_tongue.constitutive import ActiveMuscles, ReportTissue, Viscosity
from dolfin_tongue.control import Instant, Ramp, SmoothRamp, Step
from dolfin_tongue.direct import Adaptive, RungeKutta4, TrBdf2
from dolfin_tongue.direct.stage import Point, Stage
from dolfin_tongue.geometry.simple import block_body
from dolfin_tongue.march.steps import stretches
from dolfin_tongue.scene.scene import Scene


def bending(control=None, eta: float = 5.0) -> Scene:
    """Block that an oblique muscle bends."""
    body = block_body((0.03, 0.01, 0.01), (3, 1, 1), muscles={"pull": (1.0, 0.4, 0.2)})
    # A weak muscle: the force-velocity slope of a strong one is a damping that throttles
    # explicit steps more than any viscosity.
    muscle = ActiveMuscles({"pull": control or SmoothRamp(0.8, 0.0, 2 * END)}, max_stress=5e3)
    return Scene(body, (ReportTissue(), Viscosity(eta), muscle, Gravity()), (Attached("x0"),))


def errors(state: State, reference: State) -> np.ndarray:
    """Relative errors of displacement, velocity and pressure."""
    return np.array(
        [
            relative(getattr(state, name), getattr(reference, name))
            for name in ("displacement", "velocity", "pressure")
        ]
    )


def orders(scene: Scene, methods: list, reference: State) -> np.ndarray:
    """Orders of displacement, velocity and pressure from methods with halved steps."""
    error = np.array([errors(final(scene, method), reference) for method in methods])
    return np.log2(error[:-1] / error[1:])


@pytest.fixture(scope="module")
def reference() -> State:
    """Tight solution of the bending block."""
    return final(bending(), Adaptive(1e-13, rtol=1e-12))


def test_runge_kutta_has_order_4(reference):
    measured = orders(bending(), [RungeKutta4(dt) for dt in (8e-4, 4e-4, 2e-4)], reference)
    assert (measured[-1] > 3.7).all() and (measured[-1] < 4.6).all()


@pytest.mark.parametrize("corrections", [None, 1], ids=["newton", "linearly implicit"])
def test_implicit_method_has_order_2(reference, corrections):
    methods = [TrBdf2(dt, newton=1e-12, corrections=corrections) for dt in (1e-3, 5e-4, 2.5e-4)]
    measured = orders(bending(), methods, reference)
    assert (measured[-1] > 1.85).all() and (measured[-1] < 2.2).all()


@pytest.mark.parametrize(
    ("pair", "order", "steps"),
    [("RK45", 5, (8e-4, 4e-4, 2e-4)), ("DOP853", 8, (2e-3, 1e-3, 5e-4))],
)
def test_order_of_the_pairs_with_equal_steps(reference, pair, order, steps):
    methods = [Adaptive(1e9, rtol=1e9, pair=pair, largest=dt) for dt in steps]
    measured = orders(bending(), methods, reference)
    assert order - 0.6 < measured[:, 0].max() < order + 1.0


@pytest.mark.parametrize("pair", ["RK45", "DOP853"])
def test_error_of_the_pairs_falls_with_the_tolerance(reference, pair):
    loose, tight = (
        errors(final(bending(), Adaptive(t, rtol=t, pair=pair)), reference)[0] for t in (1e-5, 1e-8)
    )
    assert tight <= loose / 50
    assert tight <= 1e-7


def test_jumps_and_kinks_cost_no_order():
    for control in (Step(0.8, 0.011), Ramp(0.8, 0.011, 0.007)):
        scene = bending(control)
        tight = final(scene, Adaptive(1e-12, rtol=1e-11))
        measured = orders(scene, [RungeKutta4(dt) for dt in (3e-4, 1.5e-4, 7.5e-5)], tight)
        assert measured[-1, :2].min() > 3.5
        methods = [TrBdf2(dt, newton=1e-12) for dt in (5e-4, 2.5e-4, 1.25e-4)]
        assert orders(scene, methods, tight)[-1, :2].min() > 1.75


def test_break_points_are_met_and_close_ones_are_one():
    assert stretches(bending(Step(0.8, 0.011)), 0.0, END) == [(0.011, True), (END, False)]
    twice = bending(Ramp(0.2, 0.1, 0.05))
    late = ActiveMuscles({"pull": Step(0.1, 0.15)})
    scene = Scene(twice.body, (*twice.terms, late), twice.supports)
    assert len({0.1 + 0.05, 0.15}) == 2
    times = [stop for stop, _ in stretches(scene, 0.0, 0.2)]
    assert times == pytest.approx([0.1, 0.15, 0.2], abs=1e-12)
    assert [jump for *_, jump in stretches(scene, 0.0, 0.2)] == [False, True, False]


@pytest.mark.parametrize(
    "method", [RungeKutta4(3e-4), Adaptive(1e-7), TrBdf2(4e-3)], ids=["rk4", "pair", "implicit"]
)
def test_every_method_keeps_volumes_and_meets_the_end(method):
    solver = method.solver(bending(Step(0.8, 0.011)))
    states = list(solver.march(END))
    times = [state.time for state in states]
    assert times[0] == 0.0 and times[-1] == END and 0.011 in times
    assert (np.diff(times) > 0).all()
    tolerance = 1e-10 if isinstance(method, TrBdf2) else 1e-5
    for state in states:
        change, _ = solver.model.constraints.evaluate(state.displacement)
        assert np.abs(change / solver.model.body.volumes).max() <= tolerance


def test_a_march_goes_on_from_any_state(reference):
    for method in (RungeKutta4(2e-4), TrBdf2(1e-3, newton=1e-11)):
        whole = final(bending(), method)
        half = final(bending(), method, END / 2)
        *_, end = method.solver(bending()).march(END, half)
        bound = 1e-6 if isinstance(method, RungeKutta4) else 2 * errors(whole, reference)[0]
        assert relative(end.displacement, whole.displacement) <= bound


def test_adapted_steps_keep_the_tolerance(reference):
    solver = TrBdf2(2e-4, tolerance=3e-7, newton=1e-10).solver(bending())
    states = list(solver.march(END))
    steps = np.array([state.step for state in states[1:]])
    assert steps.max() > 1.5 * steps.min()
    error = np.abs(states[-1].displacement - reference.displacement).max()
    assert error <= len(steps) * 3e-7


def test_supports_that_move_are_followed():
    body = bending().body
    scene = Scene(body, (ReportTissue(), Viscosity(5.0), Gravity()), (Shaken(),))
    tight = final(scene, Adaptive(1e-12, rtol=1e-11))
    held = tight.displacement[body.nodes("x0"), 2]
    np.testing.assert_allclose(held, 1e-3 * np.sin(50 * END), rtol=1e-12)
    assert errors(final(scene, RungeKutta4(2e-4)), tight)[:2].max() <= 1e-6
    methods = [TrBdf2(dt, newton=1e-12) for dt in (1e-3, 5e-4)]
    assert orders(scene, methods, tight)[-1].min() > 1.7


def kinds(body: Body) -> str:
    """Name of a test case."""
    return "-".join(body.cells)


@pytest.mark.parametrize("body", [element_body("hexahedron20"), mixed_body(0.1)], ids=kinds)
def test_other_elements_move_alike_with_every_method(body):
    """Free flight under gravity with a spin: explicit and implicit agree, volumes are kept."""
    muscle = ActiveMuscles({"along": SmoothRamp(0.5, 0.0, 0.02)}, max_stress=5e3)
    scene = Scene(body, (ReportTissue(), Viscosity(1.0), muscle, Gravity()))
    tight = final(scene, Adaptive(1e-12, rtol=1e-11), 0.01)
    fall = -9.81 * 0.01**2 / 2
    mass = TrBdf2().solver(scene).model.mass.sum(axis=1)
    np.testing.assert_allclose(mass @ tight.displacement[:, 2] / mass.sum(), fall, rtol=1e-9)
    last = errors(final(scene, TrBdf2(1e-4, newton=1e-12), 0.01), tight)
    assert (last <= [1e-3, 1e-2, 1e-2]).all(), last


def test_an_end_before_the_start_is_refused():
    solver = TrBdf2().solver(bending())
    with pytest.raises(OutOfRange, match=r"end = 0\.0"):
        next(solver.march(0.0))


def test_newton_s_matrix_is_the_derivative_of_the_stage():
    """Full Newton is quadratic only with all parts of it: mass, tangents, Hessians, gradients.

    Then a solve leaves nothing of a small change of where it begins, if it uses the factors that
    were made in the middle.
    """
    solver = TrBdf2(corrections=1).solver(bending())
    model, step = solver.model, 1e-3
    u, pressure = random_state(model.body.points)[0], np.array([4e3, -2e3, 3e3])
    still = np.zeros_like(u)
    model.hold(0.0, u)
    stage = Stage(Instant(0.01), step, step, u, still)

    def solved(v: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        point = Point(stage.read, u, v.copy(), still, p.copy())
        solver.stepper.stages.solve(point, stage)
        return point.v, point.pressure

    solved(still, pressure)  # makes the factors
    random = np.random.default_rng(2)
    dv, dp = 0.1 * random.standard_normal(u.shape), 100 * random.standard_normal(3)
    model.hold(0.0, dv)
    plus, minus = (solved(e * dv, pressure + e * dp) for e in (1e-3, -1e-3))
    velocity, found = ((a - b) / 2e-3 for a, b in zip(plus, minus, strict=True))
    assert solver.counts()["factorisations"] == 1
    assert np.abs(velocity).max() <= 1e-7 * np.abs(dv).max()
    assert np.abs(found).max() <= 1e-6 * np.abs(dp).max()


@pytest.mark.parametrize("patience", [0.0, 2.0, 100.0])
def test_the_answer_does_not_depend_on_when_factors_are_renewed(patience):
    usual = final(bending(), TrBdf2(2e-3, newton=1e-12))
    other = TrBdf2(2e-3, newton=1e-12, patience=patience).solver(bending())
    *_, state = other.march(END)
    # Only the projection sees the age of the factors: its metric, for a drift of order dt^3.
    assert relative(state.displacement, usual.displacement) <= 2e-4
    assert (other.counts()["factorisations"] > 30) == (patience == 0.0)
