"""The multipliers (53)-(57): every way to solve D lambda = r, both masses, both metrics."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from cases import MUSCLES, Shaken, random_state, relative

from dolfin_tongue.base.errors import OutOfRange
from dolfin_tongue.boundary import Attached, Gravity
from dolfin_tongue.constitutive import ActiveMuscles, ReportTissue, Viscosity
from dolfin_tongue.control import Constant, Instant
from dolfin_tongue.direct import Model, multipliers, saddle
from dolfin_tongue.direct.limits import assembled
from dolfin_tongue.direct.multipliers import Acceleration, dense_gradient
from dolfin_tongue.geometry.simple import block_body, distort
from dolfin_tongue.scene.scene import Scene
from dolfin_tongue.terms.support import Support

TAU = 2e-3
START = Instant(0.0)


def model_of(mass: str = "consistent", support: Support | None = None) -> Model:
    """Held block of distorted bricks."""
    body = distort(block_body((0.03, 0.02, 0.02), (3, 2, 2), muscles=MUSCLES), 0.3)
    terms = (ReportTissue(), Viscosity(20.0), ActiveMuscles({"along": Constant(0.5)}), Gravity())
    return Model(Scene(body, terms, (support or Attached("x0"),)), mass)


def held_state(model: Model, now: Instant = START) -> tuple[np.ndarray, np.ndarray]:
    """Random state with the supports in place."""
    u, v = random_state(model.body.points)
    model.hold(now.time, u, v)
    return u, v


@pytest.mark.parametrize("mass", ["consistent", "lumped"])
@pytest.mark.parametrize("support", [Attached("x0"), Shaken()], ids=["still", "shaken"])
def test_accelerations_fulfil_motion_and_constraint(mass, support):
    model, now = model_of(mass, support), Instant(0.013)
    u, v = held_state(model, now)
    a, pressure = Acceleration(model, TAU)(now, u, v)
    change, gradients = model.constraints.evaluate(u)
    second = model.constraints.curvature(u, v) + model.constraints.rate(gradients, a)
    damped = 2 / TAU * model.constraints.rate(gradients, v) + change / TAU**2
    assert np.abs(second + damped).max() <= 1e-11 * np.abs(damped).max()
    force = model.force(now, u, v)
    model.constraints.add_force(gradients, pressure, force)
    inertia = (model.mass @ a)[model.numbering.free]
    assert relative(inertia, force[model.numbering.free]) <= 1e-10
    if isinstance(support, Shaken):
        expected = -1e-3 * 2500 * np.sin(50 * now.time)
        np.testing.assert_allclose(a[model.numbering.held, 2], expected, rtol=1e-5)


def test_conjugate_gradients_give_what_the_dense_factors_give(monkeypatch):
    model = model_of()
    u, v = held_state(model)
    dense = Acceleration(model, TAU)
    monkeypatch.setattr(multipliers, "DENSE_NODES", 0)
    iterative = Acceleration(model, TAU)
    assert dense.dense and not iterative.dense
    for one, other in zip(dense(START, u, v), iterative(START, u, v), strict=True):
        assert relative(one, other) <= 1e-9


def test_printed_metric_pushes_without_the_mass():
    model = model_of()
    u, v = held_state(model)
    a, pressure = Acceleration(model, TAU, "report")(START, u, v)
    b, same = Acceleration(model, TAU)(START, u, v)
    assert relative(pressure, same) <= 1e-9
    change, gradients = model.constraints.evaluate(u)
    second = model.constraints.rate(gradients, a - b)
    assert np.abs(second).max() <= 1e-9 * np.abs(change).max() / TAU**2
    # The difference to d'Alembert's is a push along dA/dU itself.
    G = dense_gradient(model, gradients)
    force = model.force(START, u, v)[model.numbering.free]
    inverse = np.linalg.inv(model.mass[model.numbering.free][:, model.numbering.free].toarray())
    push = (a[model.numbering.free] - inverse @ force).ravel()
    inside = G.T @ np.linalg.lstsq(G.T, push, rcond=None)[0]
    assert relative(inside, push) <= 1e-9


def test_D_is_sparse_with_the_lumped_mass():
    model = model_of("lumped")
    acceleration = Acceleration(model, TAU)
    G = acceleration.sparse_gradient(model.constraints.gradients(np.zeros_like(model.body.points)))
    D = acceleration.lumped_D(G)
    assert sp.issparse(D)
    np.testing.assert_allclose(D.toarray(), D.toarray().T, rtol=1e-12)
    line = Scene(block_body((0.06, 0.01, 0.01), (6, 1, 1)), (ReportTissue(),))
    chain = Acceleration(Model(line, "lumped"), TAU)
    still = np.zeros_like(chain.model.body.points)
    neighbours = chain.lumped_D(chain.sparse_gradient(chain.model.constraints.gradients(still)))
    assert neighbours.nnz == 6 + 2 * 5


def test_sparse_and_dense_saddle_systems_agree(monkeypatch):
    model = model_of()
    u, v = held_state(model)
    matrices = model.element_tangents(model.at(START, u, v), 1e-3, 1.0)
    gradients = model.constraints.gradients(u)
    random = np.random.default_rng(0)
    momentum = random.standard_normal(3 * len(model.numbering.free))
    volume = 1e-6 * random.standard_normal(model.body.cell_count)
    dense = saddle.Saddle(model)
    monkeypatch.setattr(saddle, "DENSE_SIZE", 0)
    sparse = saddle.Saddle(model)
    assert dense.dense and not sparse.dense
    x, y = dense.factor(matrices, gradients)(momentum, volume)
    again = sparse.factor(matrices, gradients)(momentum, volume)
    assert max(relative(again[0], x), relative(again[1], y)) <= 1e-9
    G, A = dense_gradient(model, gradients), assembled(model, matrices)
    assert np.abs(A @ x - G.T @ y - momentum).max() <= 1e-9 * np.abs(momentum).max()
    assert np.abs(G @ x - volume).max() <= 1e-9 * np.abs(volume).max()


def test_unknown_metric_and_time_constant_are_refused():
    with pytest.raises(OutOfRange, match="constraint_metric"):
        Acceleration(model_of(), TAU, "euclid")
    with pytest.raises(OutOfRange, match="tau"):
        Acceleration(model_of(), 0.0)
