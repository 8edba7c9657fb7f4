"""Every example of docs/extend.md, in both solvers where both can."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from dolfin_tongue.base.errors import NoDirectForce
from dolfin_tongue.boundary import Attached
from dolfin_tongue.constitutive import ActiveMuscles, ReportTissue, Viscosity
from dolfin_tongue.control import Ramp
from dolfin_tongue.direct import TrBdf2
from dolfin_tongue.geometry.simple import block_body
from dolfin_tongue.record import load_run, simulate
from dolfin_tongue.scene import Scene

pytest.importorskip("dolfinx")

DOCUMENT = Path(__file__).resolve().parent.parent / "docs" / "extend.md"
TISSUE = (ReportTissue(), Viscosity(20.0))
HELD = (Attached("x0"),)


def example(title: str) -> dict:
    """What the code of a section defines."""
    text = DOCUMENT.read_text(encoding="utf-8")
    (section,) = (part for part in text.split("\n## ") if part.startswith(title))
    (code,) = re.findall(r"```python\n(.*?)```", section, re.S)
    names = {"__name__": "extend"}
    exec(compile(code, f"docs/extend.md, {title}", "exec", dont_inherit=True), names)
    return names


def block(**options):
    """Block of 24 x 10 x 10 mm with one muscle."""
    return block_body((0.024, 0.01, 0.01), (4, 2, 2), muscles={"along": (1, 0, 0)}, **options)


def fenicsx(dt: float = 2e-3):
    from dolfin_tongue.fenicsx import GeneralisedAlpha

    return GeneralisedAlpha(dt)


def last(scene, method, end=0.1):
    """Last state of a motion, and its solver."""
    solver = method.solver(scene)
    *_, state = solver.march(end)
    return state, solver


def test_every_example_is_run_here():
    text = DOCUMENT.read_text(encoding="utf-8")
    assert len(re.findall(r"```python", text)) == 6


def test_a_passive_law():
    from dolfin_tongue.fenicsx import Statics

    gent = example("A passive law")["GentTissue"]
    pull = ActiveMuscles({"along": Ramp(0.3, 0.0, 0.1)}, 20e3)
    soft, stiff = (
        Statics(Scene(block(), (gent(limit=limit), pull), HELD)).solve() for limit in (1e3, 0.5)
    )
    end = block().nodes("x1")
    reach = [np.abs(state.displacement[end, 0]).max() for state in (soft, stiff)]
    assert reach[1] < 0.9 * reach[0]  # its stretch is limited
    solver = Statics(Scene(block(), (gent(), pull), HELD))
    names = solver.fields(solver.solve()).parts
    assert set(names) == {"gent_tissue", "active_muscles"}
    with pytest.raises(NoDirectForce, match="GentTissue"):
        TrBdf2(1e-3).solver(Scene(block(), (gent(),), HELD))


def test_a_passive_law_with_values_by_region():
    from dolfin_tongue.fenicsx import Statics

    gent = example("A passive law")["GentTissue"]
    body = block()
    half = np.flatnonzero(np.arange(body.cell_count) % 2)
    values = np.where(np.isin(np.arange(body.cell_count), half), 4500.0, 1500.0)
    from dataclasses import replace

    named = replace(body, cell_sets={"half": half})
    pull = ActiveMuscles({"along": Ramp(0.3, 0.0, 0.1)}, 20e3)
    by_name, by_array = (
        Statics(Scene(named, (gent(mu), pull), HELD)).solve()
        for mu in ({"half": 4500.0, "elsewhere": 1500.0}, values)
    )
    np.testing.assert_allclose(by_name.displacement, by_array.displacement, rtol=0, atol=1e-15)


def test_an_active_law():
    bell = example("An active law")["BellShaped"]
    law = bell(width=0.3)
    scene = Scene(block(), (*TISSUE, ActiveMuscles({"along": Ramp(0.5, 0.0, 0.05)}, law=law)), HELD)
    state, solver = last(scene, fenicsx())
    muscle = solver.muscles(state)["along"]
    expected = 0.5 * 22e4 * law.length_factor(muscle.stretch) * law.rate_factor(muscle.rate)
    np.testing.assert_allclose(muscle.stress, expected, rtol=1e-12)
    with pytest.raises(NoDirectForce, match="BellShaped"):
        TrBdf2(1e-3).solver(scene)


def test_a_load_on_a_surface():
    pressure = example("A load on a surface")["Pressure"]
    body = block()
    load = pressure("x1", 200.0, Ramp(1.0, 0.01, 0.02))
    scene = Scene(body, (*TISSUE, load), HELD)
    assert scene.breakpoints == pytest.approx((0.01, 0.03))
    from dolfin_tongue.control import Instant
    from dolfin_tongue.fenicsx import System
    from dolfin_tongue.fenicsx.arguments import Arguments

    system = System(scene, dynamic=True)
    zero = np.zeros(system.size)
    out = np.zeros(system.size)
    system.residual(Arguments(Instant(0.02), 0.02, zero, zero, zero, zero), out)
    push = -system.displacement(out).sum(axis=0)  # half of the pressure, against the outward normal
    np.testing.assert_allclose(push, [-200.0 * 0.5 * 1e-4, 0.0, 0.0], rtol=1e-12, atol=1e-16)
    state, _ = last(scene, fenicsx())
    assert state.displacement[body.nodes("x1"), 0].mean() < -1e-5


def test_a_support_in_both_solvers():
    shaken = example("A support")["Shaken"]
    scene = Scene(block(), TISSUE, (shaken("x0", 1e-3, 10.0),))
    mine, _ = last(scene, TrBdf2(1e-3), 0.05)  # half of a period: the largest way
    theirs, _ = last(scene, fenicsx(1e-3), 0.05)
    scale = np.abs(mine.displacement).max()
    assert scale > 1e-3
    assert np.abs(mine.displacement - theirs.displacement).max() < 2e-3 * scale


def test_a_control_with_memory_in_both_solvers(tmp_path):
    reflex = example("A control with a memory")["StretchReflex"]
    body = block()
    a, b = body.nodes("x0")[0], body.nodes("x1")[0]
    shaken = example("A support")["Shaken"]
    scene = Scene(
        body,
        (*TISSUE, ActiveMuscles({"along": reflex((int(a), int(b)))}, 20e3)),
        (Attached("x0"), shaken("x1", 2e-3, 5.0)),
    )
    mine, solver = last(scene, TrBdf2(1e-3))
    theirs, other = last(scene, fenicsx(1e-3))
    level = solver.muscles(mine)["along"].activation
    assert level > 0.05
    assert other.muscles(theirs)["along"].activation == pytest.approx(level, rel=1e-6)
    # saved with the run, and taken up again
    whole = simulate(scene, 0.1, tmp_path / "whole", TrBdf2(1e-3))
    simulate(scene, 0.05, tmp_path / "parts", TrBdf2(1e-3))
    parts = simulate(scene, 0.1, tmp_path / "parts", TrBdf2(1e-3), resume=True)
    kept, expected = (run.last.memory["active_muscles"]["along"] for run in (parts, whole))
    assert kept["level"] == pytest.approx(expected["level"], rel=1e-12)
    read = load_run(tmp_path / "whole", own=(reflex, shaken))
    assert read.frames[-1].memory == whole.last.memory


def test_a_law_of_both_solvers():
    names = example("The same law in the direct solver")
    springs = names["Springs"]
    try:
        body = block()
        push = ActiveMuscles({"along": Ramp(0.3, 0.0, 0.02)}, 20e3)
        scene = Scene(body, (*TISSUE, push, springs("x1", 2e5)), HELD)
        mine, solver = last(scene, TrBdf2(5e-4))
        theirs, other = last(scene, fenicsx(5e-4))
        free, _ = last(Scene(body, (*TISSUE, push), HELD), TrBdf2(5e-4))
        scale = np.abs(free.displacement).max()
        assert np.abs(mine.displacement).max() < 0.9 * scale  # the springs hold
        assert np.abs(mine.displacement - theirs.displacement).max() < 1e-3 * scale
        for own, state in ((solver, mine), (other, mine)):
            energy = own.energies(state)["springs"]
            assert energy == pytest.approx(solver.energies(mine)["springs"], rel=1e-12)
    finally:
        names["PARTS"].pop(springs)
