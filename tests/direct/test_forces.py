"""Forces against energies and tangents against forces, term by term, on every kind of element."""

from __future__ import annotations

import numpy as np
import pytest
from cases import (
    TERMS,
    apply_matrices,
    body_model,
    element_model,
    energy_of,
    load_of,
    mixed_body,
    name_of,
    relative,
)

from dolfin_tongue.base.errors import NoDirectForce, OutOfRange
from dolfin_tongue.body.cells import KINDS
from dolfin_tongue.boundary import Gravity
from dolfin_tongue.constitutive import ReportTissue, Viscosity
from dolfin_tongue.control import Instant
from dolfin_tongue.direct import Model, RungeKutta4
from dolfin_tongue.geometry.simple import block_body
from dolfin_tongue.scene.scene import Scene
from dolfin_tongue.terms.term import EnergyTerm, Term

NAMES = sorted(KINDS)
NOW = Instant(0.03)
INNER = [term for term in TERMS if not isinstance(term, Gravity)]


def state_of(model: Model, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Displacement of 5 % of a centimetre and velocity of every node."""
    random = np.random.default_rng(seed)
    shape = model.body.points.shape
    return 5e-4 * random.uniform(-1, 1, shape), 0.2 * random.uniform(-1, 1, shape)


def central(function, step: float) -> np.ndarray:
    """Derivative at 0, of order 4 in the step."""
    near, far = function(step) - function(-step), function(2 * step) - function(-2 * step)
    return (8 * near - far) / (12 * step)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("term", [t for t in TERMS if isinstance(t, EnergyTerm)], ids=name_of)
def test_force_is_minus_the_gradient_of_the_energy(term, name):
    model = element_model(name, term)
    u, _ = state_of(model)
    still, force = np.zeros_like(u), model.force(NOW, u, np.zeros_like(u))
    direction = state_of(model, 1)[0]
    slope = central(lambda s: energy_of(model, NOW.time, u + s * direction, still), 1e-3)
    assert abs(slope + np.sum(force * direction)) <= 1e-8 * np.abs(force * direction).sum()


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("term", TERMS, ids=name_of)
def test_tangents_are_the_derivatives_of_the_force(term, name):
    model = element_model(name, term)
    u, v = state_of(model)
    direction, _ = state_of(model, 1)
    for factor, rate_factor in ((1.0, 0.0), (0.0, 1.0), (0.3, 0.7)):
        matrices = model.element_tangents(model.at(NOW, u, v), factor, rate_factor)
        stiffness = apply_matrices(model, matrices, direction)
        # The matrix acts on one vector: its rate part sees the same direction.
        expected = -factor * central(lambda s: model.force(NOW, u + s * direction, v), 1e-3)
        expected -= rate_factor * central(lambda s: model.force(NOW, u, v + s * direction), 1.0)
        scale = max(np.abs(expected).max(), np.abs(model.force(NOW, u, v)).max() * 1e-3)
        assert np.abs(stiffness - expected).max() <= 1e-7 * scale


@pytest.mark.parametrize("term", INNER, ids=name_of)
def test_inner_forces_of_a_free_body_balance(term):
    model = body_model(mixed_body(0.1), term)
    u, v = state_of(model)
    force = model.force(NOW, u, v)
    moment = np.cross(model.body.points + u, force)
    assert np.abs(force.sum(axis=0)).max() <= 1e-13 * np.abs(force).sum()
    assert np.abs(moment.sum(axis=0)).max() <= 1e-13 * np.abs(moment).sum()


@pytest.mark.parametrize("term", INNER, ids=name_of)
def test_forces_turn_with_the_body(term):
    model = body_model(mixed_body(0.1), term)
    u, v = state_of(model)
    turn, _ = np.linalg.qr(np.random.default_rng(3).standard_normal((3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    spin = np.array([[0, -3.0, 1], [3, 0, -2], [-1, 2, 0]])
    x = (model.body.points + u) @ turn.T
    turned = model.force(NOW, x - model.body.points, v @ turn.T + x @ spin.T)
    assert relative(turned, model.force(NOW, u, v) @ turn.T) <= 1e-12


def test_gravity_is_the_weight():
    model = body_model(mixed_body(0.1), Gravity())
    weight = load_of(model).sum(axis=0)
    mass = 1000.0 * model.body.volumes.sum()
    np.testing.assert_allclose(weight, [0, 0, -9.81 * mass], rtol=1e-12, atol=1e-15)


def test_a_term_that_is_absent_is_not_evaluated(monkeypatch):
    def fail(*arguments):
        raise AssertionError("evaluated")

    for kernel in ("viscous_stress", "active_stress", "viscous_moduli", "active_moduli"):
        monkeypatch.setattr(f"dolfin_tongue.direct.rates.{kernel}", fail)
    model = body_model(mixed_body(), ReportTissue())
    u, v = state_of(model)
    assert not model.rate_dependent
    F, rate = model.at(NOW, u, v).strains[0]
    assert rate is F
    model.force(NOW, u, v)
    with pytest.raises(AssertionError, match="evaluated"):
        body_model(mixed_body(), Viscosity(1.0)).force(NOW, u, v)


def test_a_term_without_a_force_is_refused_by_name():
    class Magnetism(Term):
        def virtual_power(self, kin, fields, test):
            return None

    class StifferTissue(ReportTissue):
        pass

    body = block_body(cells=(1, 1, 1))
    for term in (Magnetism(), StifferTissue()):
        with pytest.raises(NoDirectForce, match=type(term).__name__):
            RungeKutta4(1e-4).solver(Scene(body, (term,)))


def test_an_unknown_mass_is_refused():
    with pytest.raises(OutOfRange, match="consistent"):
        body_model(mixed_body(), ReportTissue(), mass="diagonal")
