"""Static contact: a ball between planes against closed forms, and both solvers' balance."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq
from test_rest_and_impact import pressed_block

from dolfin_tongue.boundary import Attached, Barrier, Contact
from dolfin_tongue.constitutive import MooneyRivlin
from dolfin_tongue.control import Instant, SmoothMove, Still
from dolfin_tongue.direct import Model
from dolfin_tongue.fenicsx import Statics, Tolerances
from dolfin_tongue.geometry.simple import ball_body
from dolfin_tongue.scene.scene import Scene
from dolfin_tongue.surfaces import Plane

BALL, MU = 0.01, 1000.0


def graded_ball(cells):
    """A ball with small cells at both poles; five nodes in its middle for statics to hold."""
    body = ball_body(BALL, cells)
    r = np.linalg.norm(body.points, axis=1)
    polar = np.arccos(np.clip(body.points[:, 2] / np.maximum(r, 1e-30), -1, 1))
    azimuth = np.arctan2(body.points[:, 1], body.points[:, 0])
    from_equator = 1 - np.abs(1 - polar / (np.pi / 2))  # 0 at the poles, 1 at the equator
    graded = np.sinh(4 * from_equator) / np.sinh(4.0) * np.pi / 2
    polar = np.where(polar <= np.pi / 2, graded, np.pi - graded)
    r = BALL * (1 - np.sinh(3 * (1 - r / BALL)) / np.sinh(3.0))
    directions = [np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)]
    points = r[:, None] * np.stack(directions, axis=1)
    off = np.abs(points[:, 2]) > 1e-12
    core = np.argsort(r + off)[:5]
    return replace(body, points=points, node_sets={"core": core})


def pressed_ball(cells, share):
    """A ball between two planes, with an approach of that share of its radius per plane."""
    d = share * BALL
    reach = d / 50
    law = Barrier(reach, 2 / np.pi * 4 * MU * np.sqrt(share), 10.0)
    way = d + 1.5 * reach
    planes = [
        Contact(
            Plane((0, 0, s * (BALL + reach)), (0, 0, -s)), law=law,
            motion=(Still(), Still(), SmoothMove(-s * way)),
        )
        for s in (1.0, -1.0)
    ]  # fmt: skip
    terms = (MooneyRivlin(MU / 2, 0.0, 0.0), *planes)
    return Scene(graded_ball(cells), terms, (Attached("core"),))


def squeezed(cells, share):
    """Force and radius of contact of a ball between two planes, over Hertz and over Tatara.

    nu = 1/2: E = 3 mu, E* = E/(1 - nu^2) = 4 mu; Hertz: a^2 = R d, F = 16/3 mu a^3 / R for the
    approach d per plane. Of a whole ball between two planes the far side gives way the less
    (Tatara 1991): d = a^2/R - F/(pi E) (3 R^2 (a^2 + 4 R^2)^-1.5 + 0.75 (a^2 + 4 R^2)^-0.5).
    The approach is that of the planes less the mean gap, weighted with the force; range d/50.
    """
    d = share * BALL
    reach = d / 50
    solver = Statics(pressed_ball(cells, share))
    state = solver.solve()
    upper, lower = solver.contacts(state).values()
    force = -upper.force[2]
    assert lower.force[2] == pytest.approx(force, rel=1e-6)  # symmetric
    surface = solver.system.couplings[0]
    pressed = surface.pressed(solver.system.at_state(state))
    share_of_force = surface.weights[pressed.watched.points[pressed.near]] * pressed.traction
    d += reach / 2 - share_of_force @ pressed.gap.distance / share_of_force.sum()

    def approach(a):
        far, load = a**2 + 4 * BALL**2, 16 / 3 * MU * a**3 / BALL
        return a**2 / BALL - load / (3 * np.pi * MU) * (3 * BALL**2 / far**1.5 + 0.75 / far**0.5)

    a = brentq(lambda a: approach(a) - d, 0.0, BALL / 2)
    radius = np.sqrt(upper.area / np.pi)
    hertz = 16 / 3 * MU * np.sqrt(BALL) * d**1.5
    return force / hertz, force / (16 / 3 * MU * a**3 / BALL), radius / np.sqrt(BALL * d)


def test_hertz():
    """864 cells: 3 cells across the radius of contact at d = R/50, so about 5 % in the force."""
    hertz, tatara, radius = squeezed(6, 0.02)
    assert 1.05 < hertz < 1.2  # a/R = 0.14: a whole ball is stiffer than a half space by 10 %
    assert tatara == pytest.approx(1.0, abs=0.1)  # 1.068, and 1.046 with 8 cells per edge
    assert radius == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize(
    "make", [lambda: pressed_ball(4, 0.02), pressed_block], ids=["ball", "block"]
)
def test_what_rests_in_contact_rests_in_the_direct_solver_too(make):
    """All nodal forces there, pressures included, vanish where no support holds."""
    scene = make()
    solver = Statics(scene, Tolerances(1e-11, iterations=25, renew_above=0.0))
    state = solver.solve()
    model, now = Model(scene), Instant(solver.time)
    u, v = model.rows(state)
    largest = np.abs(model.force(now, u, v)).max()
    force = model.balance(state, u, v)
    assert np.abs(force[model.numbering.free]).max() <= 1e-6 * largest
    obstacle = model.obstacles[0]
    touch, other = obstacle.touch(model.at(now, u, v)), solver.contacts(state)[obstacle.labels[0]]
    assert touch.force[2] == pytest.approx(other.force[2], rel=1e-9)
    assert touch.area == pytest.approx(other.area, rel=1e-9)


@pytest.mark.slow
def test_hertz_converges():
    """To Tatara's force with the mesh, and to Hertz' as a/R = sqrt(d/R) falls."""
    rows = {(n, s): squeezed(n, s) for n in (6, 8, 10) for s in (0.005, 0.02, 0.04)}
    for key, row in rows.items():
        print(*key, *(f"{value:.4f}" for value in row))
    error = {n: np.mean([abs(rows[n, s][1] - 1) for s in (0.005, 0.02, 0.04)]) for n in (6, 8, 10)}
    assert error[10] < error[8] < error[6] and error[10] < 0.02
    by_load = [rows[10, share][0] for share in (0.005, 0.02, 0.04)]
    assert 1.0 < by_load[0] < by_load[1] < by_load[2] and by_load[0] < 1.06
    assert rows[10, 0.02][2] == pytest.approx(1.0, abs=0.06)
