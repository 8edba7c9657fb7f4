"""Muscles, palate, mandible, hyoid and gravity in one scene, in both solvers."""

from __future__ import annotations

from math import radians

import numpy as np
import pytest

from dolfin_tongue.anatomy.bones import opening
from dolfin_tongue.anatomy.scenes import CLEARANCE, SURROUNDINGS, published_mouth, report_mouth
from dolfin_tongue.base.errors import TongueError
from dolfin_tongue.boundary import Contact
from dolfin_tongue.control import SmoothRamp
from dolfin_tongue.direct import TrBdf2

pytest.importorskip("dolfinx")

PRESSED = {
    "genioglossus_posterior": SmoothRamp(1.0, 0.0, 0.08),
    "styloglossus": SmoothRamp(0.6, 0.0, 0.08),
}


def last_of(scene, end, dt, name):
    """Last state of one of the solvers."""
    from dolfin_tongue.fenicsx import GeneralisedAlpha

    solver = GeneralisedAlpha(dt).solver(scene) if name == "fenicsx" else TrBdf2(dt).solver(scene)
    *_, last = solver.march(end)
    return last


def test_all_parts_together_move_alike_in_both_solvers():
    """Pressed to the palate while the mandible opens; order 1, since contact is implicit."""
    motion = opening(0.06, 0.2)
    pull = SmoothRamp(0.2, 0.0, 0.1)
    scene = report_mouth(PRESSED, motion=motion, geniohyoid=pull)
    gaps = []
    for dt in (5e-3, 2.5e-3):
        one, two = (last_of(scene, 0.12, dt, name) for name in ("fenicsx", "direct"))
        gaps.append(np.abs(one.displacement - two.displacement).max())
        assert np.abs(one.rigid - two.rigid)[:, 2].max() < 1e-3
    reach = np.abs(two.displacement).max()
    assert gaps[1] < 0.01 * reach
    assert gaps[1] < 0.7 * gaps[0]
    mandible, hyoid = two.rigid
    assert mandible == pytest.approx([motion[x].at(0.12)[0] for x in ("x", "z", "angle")])
    assert np.abs(hyoid[:2]).max() > 1e-4  # carried along by tissue and muscle
    (contact,) = (term for term in scene.terms if isinstance(term, Contact))
    nodes = np.unique(scene.body.surface("upper"))
    for state in (one, two):
        places = (scene.body.points + state.displacement)[nodes]
        distance = contact.obstacle.gap(places).distance
        assert distance.min() > 0  # not even a node has passed
        assert distance.min() < contact.law.range  # and they touch


def test_the_mandible_opens_by_ten_degrees_and_the_tongue_follows():
    scene = report_mouth({}, ("mandible", "hyoid"), motion=opening(0.0, 0.2))
    last = last_of(scene, 0.22, 5e-3, "direct")
    assert last.rigid[0, 2] == pytest.approx(radians(-10.0))
    tip, origin = (
        last.displacement[node]
        for node in (scene.body.landmark("tip"), scene.body.nodes("genioglossus_origin")[0])
    )
    assert tip[2] < -0.01  # down
    assert origin[2] < -0.005  # with the chin


@pytest.mark.parametrize("part", SURROUNDINGS)
def test_what_is_left_out_is_held_or_not_there(part):
    scene = report_mouth({}, tuple(x for x in SURROUNDINGS if x != part))
    names = {body.name for body in scene.rigid_bodies}
    assert names == {"mandible", "hyoid"} - {part}
    assert any(isinstance(term, Contact) for term in scene.terms) == (part != "palate")
    held = {region for support in scene.held for region in support.regions}
    carried = {"mandible": "genioglossus_origin", "hyoid": "base"}
    assert held == {"styloglossus_insertion", *([carried[part]] if part in carried else [])}


def test_an_unknown_part_is_refused():
    with pytest.raises(TongueError, match="velum"):
        report_mouth({}, ("palate", "velum"))


def test_published_tongue_in_its_mouth(published_folder):
    """Palate dented to the clearance, jaw and hyoid; both solvers for 20 ms."""
    scene = published_mouth(published_folder, {"GGP": SmoothRamp(0.3, 0.0, 0.02)})
    (contact,) = (term for term in scene.terms if isinstance(term, Contact))
    nodes = np.unique(scene.body.surface("palatal"))
    assert contact.obstacle.gap(scene.body.points[nodes]).distance.min() >= 0.99 * CLEARANCE
    assert 0.5e-3 < contact.obstacle.largest_retraction < 1.5e-3  # overlap 0.72 mm and clearance
    one, two = (last_of(scene, 0.02, 2.5e-3, name) for name in ("fenicsx", "direct"))
    reach = np.abs(two.displacement).max()
    assert reach > 1e-4
    assert np.abs(one.displacement - two.displacement).max() < 0.02 * reach
    assert np.abs(one.rigid - two.rigid).max() < 1e-4
