"""Contact with obstacles in the direct solver: forces, derivatives, and what is asked for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cases import (
    apply_matrices,
    body_model,
    energy_of,
    mixed_body,
    raised_block,
    random_body,
    relative,
)

from dolfin_tongue.base.errors import NoDirectForce
from dolfin_tongue.body.body import Body
from dolfin_tongue.boundary import Barrier, Contact, ReportContact
from dolfin_tongue.constitutive import ReportTissue
from dolfin_tongue.control import Instant, SmoothMove, Still
from dolfin_tongue.direct import Model, TrBdf2
from dolfin_tongue.direct.limits import StabilityLimits
from dolfin_tongue.direct.multipliers import Acceleration
from dolfin_tongue.scene.scene import Scene
from dolfin_tongue.surfaces import Plane, Sphere, Surface

NOW = Instant(0.1)
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
    shape = model.body.points.shape
    return 1.5e-4 * random.uniform(-1, 1, shape), 0.3 * random.uniform(-1, 1, shape)


#: A body may come behind an obstacle but not start there: it is raised, and then it sinks.
HEIGHT = np.array([0.0, 0.0, 1e-3])


def raised_model(term: Contact) -> Model:
    """Model of a contact alone, on mixed cells."""
    body = mixed_body(0.1)
    return body_model(replace(body, points=body.points + HEIGHT), term)


def central(function, step: float) -> np.ndarray:
    """Derivative at 0, of order 4 in the step."""
    near, far = function(step) - function(-step), function(2 * step) - function(-2 * step)
    return (8 * near - far) / (12 * step)


@pytest.mark.parametrize(
    "term", [c for c in CONTACTS if not c.law.rate_dependent], ids=name_of_contact
)
def test_force_is_minus_the_gradient_of_the_energy(term):
    model = raised_model(term)
    u = touching_state(model)[0] - HEIGHT
    still, force = np.zeros_like(u), model.force(NOW, u, np.zeros_like(u))
    assert np.abs(force).max() > 0
    direction = touching_state(model, 1)[0]
    slope = central(lambda s: energy_of(model, NOW.time, u + s * direction, still), 1e-3)
    assert abs(slope + np.sum(force * direction)) <= 1e-8 * np.abs(force * direction).sum()


@pytest.mark.parametrize("term", CONTACTS, ids=name_of_contact)
def test_tangents_are_the_derivatives_of_the_force(term):
    model = raised_model(term)
    u, v = touching_state(model)
    u -= HEIGHT
    direction = touching_state(model, 1)[0]
    assert model.rate_dependent == term.law.rate_dependent
    at = model.at(NOW, u, v)
    for factor, rate_factor in ((1.0, 0.0), (0.0, 1.0), (0.3, 0.7)):
        matrices = model.element_tangents(at, factor, rate_factor)
        product = apply_matrices(model, matrices, direction)
        expected = -factor * central(lambda s: model.force(NOW, u + s * direction, v), 1e-3)
        expected -= rate_factor * central(lambda s: model.force(NOW, u, v + s * direction), 1.0)
        scale = max(np.abs(expected).max(), np.abs(model.force(NOW, u, v)).max() * 1e-3)
        assert scale > 0
        assert np.abs(product - expected).max() <= 1e-7 * scale
    of_no_term = model.element_tangents(at, 1.0, 1.0, labels=())
    assert not any(part.any() for part in of_no_term)


#: Points on [-1, 1], the nodes among them, and their weights.
SIMPSON = ((-1.0, 1 / 3), (0.0, 4 / 3), (1.0, 1 / 3))


def stated(term: Contact, body: Body, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Nodal forces as the definition has them, face by face and point by point."""
    out = np.zeros_like(u)
    shift, drift = term.shift(NOW.time)
    for face in body.surface(term.surface):
        for a, weight_a in SIMPSON:
            for b, weight_b in SIMPSON:
                Y = np.array([(1 - a) * (1 - b), (1 + a) * (1 - b), (1 + a) * (1 + b),
                              (1 - a) * (1 + b)]) / 4  # fmt: skip
                by_a = np.array([b - 1, 1 - b, 1 + b, -1 - b]) / 4 @ body.points[face]
                by_b = np.array([a - 1, -1 - a, 1 + a, 1 - a]) / 4 @ body.points[face]
                area = weight_a * weight_b * np.linalg.norm(np.cross(by_a, by_b))
                gap = term.obstacle.gap((Y @ (body.points + u)[face] - shift)[None])
                rate = gap.normal[0] @ (Y @ v[face] - drift)
                traction, *_ = term.law.traction(gap.distance, np.array([rate]))
                out[face] += area * traction * Y[:, None] * gap.normal
    return out


@pytest.mark.parametrize("surface", ["z0", "boundary"])
@pytest.mark.parametrize("term", CONTACTS, ids=name_of_contact)
def test_the_force_is_as_defined(term, surface):
    body = random_body()
    nearest = term.obstacle.gap(body.points).distance.min() - 1.5e-3
    if isinstance(term.obstacle, Plane):
        point = np.array(PLANE.point) + nearest * PLANE.gradient(body.points)[0]
        moved = replace(PLANE, point=tuple(point))
    else:
        moved = replace(BALL, radius=BALL.radius + nearest)
    term = replace(term, surface=surface, obstacle=moved)
    model = Model(Scene(body, (term,)))
    u, v = touching_state(model)
    expected = stated(term, body, u, v)
    assert np.abs(expected).max() > 0
    assert relative(model.force(NOW, u, v), expected) <= 1e-12


# -- edges ---------------------------------------------------------------------------------------


def test_the_limit_names_the_contact():
    terms = (ReportTissue(), Contact(Plane(), "z0"))
    model = Model(Scene(raised_block(False, 5e-5), terms))
    zero = np.zeros_like(model.body.points)
    still = NOW, zero, zero, np.zeros(model.body.cell_count)
    limit = StabilityLimits(Acceleration(model, 1e-2))(*still)
    assert "the contact stiffness of 'z0' on Plane" in limit.cause
    far = Model(Scene(raised_block(False, 5e-3), terms))
    free = StabilityLimits(Acceleration(far, 1e-2))(*still)
    assert limit.step < free.step


def test_a_subclass_of_contact_is_refused_by_name():
    class Sticky(Contact):
        pass

    with pytest.raises(NoDirectForce, match="Sticky"):
        TrBdf2().solver(Scene(raised_block(False, 1e-3), (ReportTissue(), Sticky(Plane()))))


class Counted(Surface):
    """The plane z = 0, which counts how often it is asked for gaps; inf beyond x = 0 if `rim`."""

    def __init__(self, rim: bool = False):
        self.rim, self.count, self.plane = rim, 0, Plane()

    def value(self, points):
        return self.plane.value(points)

    def gradient(self, points):
        return self.plane.gradient(points)

    def hessian(self, points):
        return self.plane.hessian(points)

    def gap(self, points):
        self.count += 1
        gap = self.plane.gap(points)
        if self.rim:
            out = points[:, 0] > 0
            gap.distance[out], gap.normal[out] = np.inf, 0.0
        return gap


@pytest.mark.parametrize("rim", [False, True])
def test_a_far_obstacle_is_not_asked_until_points_may_be_near(rim):
    obstacle = Counted(rim)
    model = Model(Scene(raised_block(False, 5e-3), (ReportTissue(), Contact(obstacle))))
    zero = np.zeros_like(model.body.points)
    down, count = np.broadcast_to([0.0, 0.0, -1.0], zero.shape), obstacle.count
    model.force(NOW, zero, zero)
    for fraction in (0.2, 0.5, 0.95):
        assert np.abs(model.force(NOW, fraction * 4.8e-3 * down, zero)).max() <= 1e-15
        # Where some points have no distance, nothing bounds the others.
        assert obstacle.count == count + 1 if not rim else obstacle.count > count + 1
    assert model.force(NOW, 4.9e-3 * down, zero).sum() > 0.1
    assert obstacle.count > count + 1
