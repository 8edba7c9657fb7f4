"""Numbers by region, muscle, cell and quadrature point, and named parameters, in both solvers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dolfin_tongue.base.errors import BadScene, OutOfRange, UnknownName
from dolfin_tongue.base.values import Parameter
from dolfin_tongue.body import Fibres, MuscleFibres, State
from dolfin_tongue.boundary import Attached, Gravity, Skin, SurfaceTension
from dolfin_tongue.constitutive import (
    ActiveMuscles,
    ConstantFibreStress,
    FibreReinforcedTissue,
    MooneyRivlin,
    ReportTissue,
    StressMobilisation,
    Viscosity,
)
from dolfin_tongue.control import Constant, Instant, Ramp
from dolfin_tongue.direct import Model, TrBdf2
from dolfin_tongue.geometry.simple import block_body, distort
from dolfin_tongue.scene import Scene

NOW = Instant(0.03)
MUSCLES = {"along": (1.0, 0.2, 0.0), "across": (0.0, 1.0, 1.0)}


def two_regions():
    """Distorted block of 12 cells; every other one is "gland", and has no fibres across."""
    body = distort(block_body((0.03, 0.02, 0.025), (3, 2, 2), muscles=MUSCLES), 0.3)
    gland = np.arange(0, body.cell_count, 2)
    along, across = body.fibres.muscles
    rest = np.setdiff1d(np.arange(body.cell_count), gland)
    part = MuscleFibres("across", rest, across.directions[rest], across.density[rest])
    return replace(body, cell_sets={"gland": gland}, fibres=Fibres((along, part)))


BODY = two_regions()
CELLS = np.random.default_rng(1).uniform(0.5, 2.0, BODY.cell_count)
POINTS = np.random.default_rng(2).uniform(0.5, 2.0, (BODY.cell_count, 8))
ACTIVE = {"along": Constant(0.6), "across": Constant(0.3)}

#: What a number may be, in multiples of a default.
KINDS = {
    "number": lambda x: 2.5 * x,
    "region": lambda x: {"gland": 3.0 * x, "elsewhere": x},
    "cells": lambda x: x * CELLS,
    "points": lambda x: x * POINTS,
    "parameter": lambda x: Parameter("it", 1.7 * x),
    "parameter in a region": lambda x: {"gland": Parameter("it", 1.7 * x), "elsewhere": x},
}


def law(**numbers):
    """Active muscles whose law has other numbers than the default."""
    return ActiveMuscles(ACTIVE, law=StressMobilisation(**numbers))


#: A term with one of its numbers replaced; the default.
TERMS = {
    "a0": (lambda x: ReportTissue(a0=x), 500.0),
    "a1": (lambda x: ReportTissue(a1=x), 2.0),
    "a2": (lambda x: ReportTissue(a2=x), 6.0),
    "a3": (lambda x: FibreReinforcedTissue(muscle="across", a3=x), 3.0),
    "c10": (lambda x: MooneyRivlin(c10=x), 1037.0),
    "c20": (lambda x: MooneyRivlin(c20=x), 486.0),
    "c01": (lambda x: MooneyRivlin(c01=x), 300.0),
    "eta": (lambda x: Viscosity(x), 40.0),
    "max_stress": (lambda x: ActiveMuscles(ACTIVE, max_stress=x), 2e5),
    "constant": (lambda x: ConstantFibreStress(ACTIVE, max_stress=x), 2e4),
    "a": (lambda x: law(a=x), 3.0),
    "b": (lambda x: law(b=x), 5.0),
    "rate1": (lambda x: law(rate1=x), 25.0),
}
SURFACES = {
    "sigma": (lambda x: SurfaceTension(x), 3.0),
    "shear_modulus": (lambda x: Skin(x, 1e-3), 20e3),
    "thickness": (lambda x: Skin(20e3, x), 1e-3),
}


def state(seed: int = 0):
    """Displacement of up to 1 mm and velocity of up to 0.3 m/s of every node."""
    random = np.random.default_rng(seed)
    shape = BODY.points.shape
    return 1e-3 * random.uniform(-1, 1, shape), 0.3 * random.uniform(-1, 1, shape)


def both_forces(scene: Scene):
    """Nodal forces by the direct solver and by FEniCSx, N."""
    from dolfin_tongue.fenicsx import System
    from dolfin_tongue.fenicsx.arguments import Arguments

    u, v = state()
    system = System(scene, dynamic=True)
    y, rate, zero = system.vector(u), system.vector(v), np.zeros(system.size)
    out = np.zeros(system.size)
    system.residual(Arguments(NOW, NOW.time, y, rate, zero, y), out)
    return Model(scene).force(NOW, u, v), -system.displacement(out)


def assert_alike(scene: Scene):
    pytest.importorskip("dolfinx")
    mine, theirs = both_forces(scene)
    assert np.abs(theirs).max() > 0
    assert np.abs(mine - theirs).max() <= 1e-12 * np.abs(theirs).max()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", TERMS)
def test_both_solvers_take_any_value(name, kind):
    make, default = TERMS[name]
    assert_alike(Scene(BODY, (make(KINDS[kind](default)),)))


@pytest.mark.parametrize("kind", ["number", "region", "cells", "parameter"])
@pytest.mark.parametrize("name", SURFACES)
def test_both_solvers_take_any_value_on_surfaces(name, kind):
    make, default = SURFACES[name]
    assert_alike(Scene(BODY, (make(KINDS[kind](default)),)))


@pytest.mark.parametrize("kind", [kind for kind in KINDS if "parameter" not in kind])
def test_density_by_place(kind):
    body = replace(BODY, density=KINDS[kind](1040.0))
    scene = Scene(body, (Gravity(),))
    assert_alike(scene)
    weight = both_forces(scene)[0].sum(axis=0)
    assert weight == pytest.approx([0, 0, -9.81 * body.mass], rel=1e-12, abs=1e-14)


def test_a_value_is_the_same_by_region_and_by_cell():
    named = Scene(BODY, (ReportTissue(a0={"gland": 1500.0, "elsewhere": 500.0}),))
    cells = np.full(BODY.cell_count, 500.0)
    cells[BODY.cell_sets["gland"]] = 1500.0
    by_cell = Scene(BODY, (ReportTissue(a0=cells),))
    by_point = Scene(BODY, (ReportTissue(a0=np.repeat(cells[:, None], 8, axis=1)),))
    forces = [Model(scene).force(NOW, *state()) for scene in (named, by_cell, by_point)]
    np.testing.assert_array_equal(forces[0], forces[1])
    np.testing.assert_array_equal(forces[0], forces[2])


def test_a_stiffer_part_beside_a_softer_one_in_closed_form():
    """Two halves in series under one traction: each has the shear modulus that its stretch tells.

    Small strain of an incompressible bar: T = 3 mu e, with e the strain of each half, far from the
    ends of the halves, where the jump of the modulus disturbs it.
    """
    pytest.importorskip("dolfinx")
    from dolfin_tongue.fenicsx import Statics

    body = block_body((0.2, 0.01, 0.01), (40, 2, 2), muscles={"along": (1, 0, 0)})
    middle = body.points[body.cells].mean(axis=1)[:, 0]
    body = replace(body, cell_sets={"front": np.flatnonzero(middle > 0.1)})
    tissue = MooneyRivlin(c10={"front": 4e3, "elsewhere": 1e3}, c20=0.0)
    # a bar that hangs in its own weight would vary along its length; a constant stress does not
    pull = ConstantFibreStress({"along": Constant(1.0)}, 10.0)
    u = Statics(Scene(body, (tissue, pull), (Attached("x0"),))).solve().displacement
    x = body.points[:, 0]

    def strain(low, high):
        ends = [u[np.isclose(x, place), 0].mean() for place in (low, high)]
        return (ends[1] - ends[0]) / (high - low)

    # 2 c10 = mu; T / (3 mu), less terms of the order of the strain itself
    assert strain(0.03, 0.07) == pytest.approx(-10.0 / 6e3, rel=5e-3)
    assert strain(0.13, 0.17) == pytest.approx(-10.0 / 24e3, rel=5e-3)


# -- by muscle ----------------------------------------------------------------------------------


def test_largest_stress_by_muscle():
    scene = Scene(BODY, (ActiveMuscles(ACTIVE, max_stress={"along": 3e5, "elsewhere": 1e5}),))
    assert_alike(scene)
    alone = [
        Model(Scene(BODY, (ActiveMuscles({name: ACTIVE[name]}, max_stress=stress),)))
        for name, stress in (("along", 3e5), ("across", 1e5))
    ]
    total = sum(model.force(NOW, *state()) for model in alone)
    mine = Model(scene).force(NOW, *state())
    assert np.abs(mine - total).max() <= 1e-12 * np.abs(total).max()


def test_another_law_for_a_muscle():
    quick = StressMobilisation(a=2.0, b=4.0, y0=0.6, y1=0.1, rate1=60.0)
    laws = {"along": quick, "elsewhere": StressMobilisation()}
    scene = Scene(BODY, (ActiveMuscles(ACTIVE, law=laws),))
    assert_alike(scene)
    alone = [
        Model(Scene(BODY, (ActiveMuscles({name: ACTIVE[name]}, law=own),)))
        for name, own in (("along", quick), ("across", StressMobilisation()))
    ]
    total = sum(model.force(NOW, *state()) for model in alone)
    mine = Model(scene).force(NOW, *state())
    assert np.abs(mine - total).max() <= 1e-12 * np.abs(total).max()


# -- parameters ---------------------------------------------------------------------------------


def derivative(make, value: float, seed: int = 3) -> np.ndarray:
    """Derivative of the nodal forces by a number, by central differences of order 4."""
    step = 1e-3 * value

    def force(number):
        u, v = state(seed)
        return Model(Scene(BODY, (make(number),))).force(NOW, u, v)

    near = force(value + step) - force(value - step)
    far = force(value + 2 * step) - force(value - 2 * step)
    return (8 * near - far) / (12 * step)


@pytest.mark.parametrize("name", TERMS)
def test_derivative_of_the_forces_by_a_parameter(name):
    pytest.importorskip("dolfinx")
    from dolfin_tongue.fenicsx import GeneralisedAlpha

    make, default = TERMS[name]
    value = 1.7 * default
    expected = derivative(make, value)
    u, v = state(3)
    at = State(NOW.time, u, v, np.zeros(BODY.cell_count))
    scene = Scene(BODY, (make(Parameter("it", value)),))
    for method, tolerance in ((GeneralisedAlpha(), 1e-8), (TrBdf2(), 1e-7)):
        found = method.solver(scene).force_by_parameter("it", at)
        scale = np.abs(expected).max()
        assert np.abs(found - expected).max() <= tolerance * scale, type(method).__name__


def test_a_parameter_is_changed_without_building_anew():
    pytest.importorskip("dolfinx")
    from dolfin_tongue.fenicsx import GeneralisedAlpha, System
    from dolfin_tongue.fenicsx.arguments import Arguments

    scene = Scene(BODY, (ReportTissue(a0=Parameter("stiffness", 500.0)), Viscosity(20.0)))
    assert scene.parameters == {"stiffness": 500.0}
    solver = GeneralisedAlpha().solver(scene)
    u, v = state()

    def residual(system: System):
        y, zero, out = system.vector(u), np.zeros(system.size), np.zeros(system.size)
        system.residual(Arguments(NOW, NOW.time, y, system.vector(v), zero, y), out)
        return out

    before = residual(solver.system)
    solver.set_parameter("stiffness", 900.0)
    assert solver.scene.parameters == {"stiffness": 900.0}
    fresh = System(Scene(BODY, (ReportTissue(a0=900.0), Viscosity(20.0))), dynamic=True)
    np.testing.assert_allclose(residual(solver.system), residual(fresh), rtol=0, atol=1e-15)
    assert np.abs(before - residual(fresh)).max() > 1e-3
    direct = TrBdf2().solver(scene)
    direct.set_parameter("stiffness", 900.0)
    expected = Model(Scene(BODY, (ReportTissue(a0=900.0), Viscosity(20.0)))).force(NOW, u, v)
    np.testing.assert_array_equal(direct.model.force(NOW, u, v), expected)
    for each in (solver, direct):
        with pytest.raises(UnknownName, match="known parameter names: stiffness"):
            each.set_parameter("stifness", 1.0)


def test_one_name_is_one_parameter():
    with pytest.raises(BadScene, match=r"eta.*40.*50"):
        Scene(BODY, (Viscosity(Parameter("eta", 40.0)), Viscosity(Parameter("eta", 50.0))))


# -- refusals -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "value, error, text",
    [
        ({"glnd": 2e3, "elsewhere": 5e2}, UnknownName, "region of cells.*gland"),
        ({"gland": 2e3}, BadScene, "add 'elsewhere'"),
        ({"gland": 2e3, "along": 1e3}, BadScene, "belong to 'gland' and to 'along'"),
        ({"gland": -2e3, "elsewhere": 5e2}, OutOfRange, "a0 of 'gland'"),
        ({}, BadScene, "must map names"),
        (np.ones(5), BadScene, "values for 5 cells, and .* has 12"),
        (np.ones((12, 4)), BadScene, "values at 4 quadrature points.* have 8"),
        (np.ones((12, 8, 3)), BadScene, "not of shape"),
        (np.full(12, np.nan), OutOfRange, "in cell 0"),
        (Parameter("x", -1.0), OutOfRange, "a0"),
        ("soft", OutOfRange, "a0"),
        (True, OutOfRange, "a0"),
    ],
)
def test_values_that_are_refused(value, error, text):
    with pytest.raises(error, match=text):
        Scene(BODY, (ReportTissue(a0=value),))


def test_bad_parameters_are_refused():
    with pytest.raises(BadScene, match="needs a name"):
        Parameter("", 1.0)
    with pytest.raises(OutOfRange, match="finite"):
        Parameter("x", float("nan"))


def test_muscles_that_are_left_out_are_named():
    with pytest.raises(BadScene, match="no value for 'across'"):
        Scene(BODY, (ActiveMuscles(ACTIVE, max_stress={"along": 3e5}),))
    crossing = StressMobilisation(y0={"along": 0.3}, y1={"along": 0.4})
    with pytest.raises(OutOfRange, match="y1 < y0"):
        Scene(BODY, (ActiveMuscles({"along": Ramp(0.5)}, law=crossing),))
