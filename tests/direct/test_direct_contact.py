"""Contact with obstacles: derivatives, balance, and steps that neither pass nor gain energy."""

from __future__ import annotations

import numpy as np
import pytest
from cases import apply_matrices, mesh_model, mixed_mesh

from dolfin_tongue.boundary import Barrier, Contact, ReportContact
from dolfin_tongue.control import SmoothMove, Still
from dolfin_tongue.surfaces import Plane, Sphere
from dolfin_tongue.term import Term

TIME = 0.1
MOVED = (Still(1e-4), SmoothMove(4e-4), Still())
PLANE = Plane((0.0, 0.0, -3e-4), (0.1, -0.05, 1.0))
BALL = Sphere((0.012, 0.004, -0.0505), 0.05)
#: A range of millimetres brings most points of a distorted body near the obstacle.
BARRIER, REPORT = Barrier(range=4e-3), ReportContact(range=4e-3, a2=1.5, a3=2.0)


def name_of_contact(term: Contact) -> str:
    moved = "moved" if term.motion else "still"
    return f"{type(term.law).__name__}-{type(term.obstacle).__name__}-{moved}"


CONTACTS = [
    Contact(obstacle, law=law, motion=motion)
    for law in (BARRIER, REPORT)
    for obstacle in (PLANE, BALL)
    for motion in (None, MOVED)
]


def touching_state(model, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Displacements of up to 0.15 mm and velocities of up to 0.3 m/s."""
    random = np.random.default_rng(seed)
    shape = model.mesh.points.shape
    return 1.5e-4 * random.uniform(-1, 1, shape), 0.3 * random.uniform(-1, 1, shape)


def central(function, step: float) -> np.ndarray:
    """Derivative at 0, of order 4 in the step."""
    near, far = function(step) - function(-step), function(2 * step) - function(-2 * step)
    return (8 * near - far) / (12 * step)


@pytest.mark.parametrize("term", [c for c in CONTACTS if not c.law.rated], ids=name_of_contact)
def test_force_is_minus_the_gradient_of_the_energy(term):
    model = mesh_model(mixed_mesh(0.1), term)
    u, _ = touching_state(model)
    still, force = np.zeros_like(u), model.force(TIME, u, np.zeros_like(u))
    assert np.abs(force).max() > 0
    direction = touching_state(model, 1)[0]
    slope = central(lambda s: model.energy(u + s * direction, still, time=TIME), 1e-3)
    assert abs(slope + np.sum(force * direction)) <= 1e-8 * np.abs(force * direction).sum()


@pytest.mark.parametrize("term", CONTACTS, ids=name_of_contact)
def test_tangents_are_the_derivatives_of_the_force(term):
    model = mesh_model(mixed_mesh(0.1), term)
    u, v = touching_state(model)
    direction = touching_state(model, 1)[0]
    assert model.rated == term.law.rated
    for factor, rate_factor in ((1.0, 0.0), (0.0, 1.0), (0.3, 0.7)):
        matrices = model.element_tangents(TIME, u, v, factor, rate_factor)
        product = apply_matrices(model, matrices, direction)
        expected = -factor * central(lambda s: model.force(TIME, u + s * direction, v), 1e-3)
        expected -= rate_factor * central(lambda s: model.force(TIME, u, v + s * direction), 1.0)
        scale = max(np.abs(expected).max(), np.abs(model.force(TIME, u, v)).max() * 1e-3)
        assert scale > 0
        assert np.abs(product - expected).max() <= 1e-7 * scale
    other: tuple[Term, ...] = ()
    assert not any(part.any() for part in model.element_tangents(TIME, u, v, 1.0, 1.0, other))
