"""Every term against energy, finite differences and rigid motion; what a scene leaves out.

Worth reading first: `test_tangent` and `test_force_is_the_gradient_of_the_energy` are
parametrised over all terms; `test_every_term_is_tested` fails when a new one is left out.
"""

import inspect
import pkgutil
from dataclasses import fields, is_dataclass, replace
from importlib import import_module

import numpy as np
import pytest
import ufl
from term_cases import TERMS, arguments, random_states, residual, small_body, system_of

import dolfin_tongue
from dolfin_tongue.boundary import Attached, Contact, Gravity
from dolfin_tongue.constitutive import ReportTissue, Viscosity
from dolfin_tongue.control import Instant
from dolfin_tongue.fenicsx import GeneralisedAlpha, System
from dolfin_tongue.fenicsx.arguments import Shifts
from dolfin_tongue.geometry.preliminary import preliminary_tongue
from dolfin_tongue.scene.scene import Scene
from dolfin_tongue.terms.term import EnergyTerm, Term


@pytest.mark.parametrize("name", TERMS)
def test_tangent(name):
    """The assembled tangent is the derivative of the residual, shifts included."""
    system = system_of(name)
    y, v, a = random_states(system)
    rng = np.random.default_rng(5)
    body = system.scene.body
    pressure = 1e3 * rng.standard_normal(body.cell_count)
    d = system.vector(rng.standard_normal(body.points.shape), pressure)
    shifts = Shifts(30.0, 500.0, 1.8)

    def along(e):
        rate, acceleration = v + e * shifts.rate * d, a + e * shifts.acceleration * d
        out = np.zeros_like(d)
        system.residual(arguments(y + e * d, rate, acceleration, y + e * shifts.end * d), out)
        return out

    h = 1e-7
    difference = (along(h) - along(-h)) / (2 * h)
    matrix = system.new_matrix()
    system.jacobian(arguments(y, v, a), shifts, matrix)
    vector = matrix.createVecRight()
    vector.array[:] = d
    product = (matrix * vector).array
    for dofs in (system.numbering.displacements, system.numbering.pressures):
        scale = np.abs(difference[dofs]).max()
        assert np.abs(product[dofs] - difference[dofs]).max() <= 1e-6 * scale


@pytest.mark.parametrize("name", [k for k, v in TERMS.items() if isinstance(v, EnergyTerm)])
def test_force_is_the_gradient_of_the_energy(name):
    """Virtual power along a direction equals the central difference of the energy."""
    scene = Scene(small_body(), (TERMS[name],))
    solver = GeneralisedAlpha().solver(scene)
    system, (label,) = solver.system, scene.labels
    y, _, _ = random_states(system)
    y[system.numbering.pressures] = 0.0
    d = system.vector(np.random.default_rng(6).standard_normal(scene.body.points.shape))

    def energy(e):
        return solver.energies(system.state_of(Instant(0.0), y + e * d, 0 * y))[label]

    h = 1e-7
    force = residual(system, y)[system.numbering.displacements]
    power = float((force * d[system.numbering.displacements]).sum())
    difference = (energy(h) - energy(-h)) / (2 * h)
    assert abs(power - difference) <= 1e-7 * np.abs(force).sum()


@pytest.mark.parametrize("name", [k for k in TERMS if k != "gravity"])
def test_internal_forces_have_no_resultant_and_no_moment(name):
    """A free body feels no net force and no net moment from its own stress."""
    system = system_of(name)
    y, v, _ = random_states(system)
    force = system.displacement(residual(system, y, v))
    place = system.scene.body.points + system.displacement(y)
    scale = np.abs(force).sum()
    assert np.abs(force.sum(axis=0)).max() <= 1e-12 * scale
    assert np.abs(np.cross(place, force).sum(axis=0)).max() <= 1e-12 * scale * np.abs(place).max()


@pytest.mark.parametrize("name", [k for k in TERMS if k != "gravity"])
def test_objectivity(name):
    """A superposed rotation rotates the forces and does nothing else."""
    system = system_of(name)
    body = system.scene.body
    y, v, _ = random_states(system)
    axis = np.array([0.3, -0.5, 0.8])
    spin = np.cross(np.eye(3), axis)
    w, vectors = np.linalg.eig(spin)
    rotation = (vectors @ np.diag(np.exp(w)) @ np.linalg.inv(vectors)).real
    u, velocity = system.displacement(y), system.displacement(v)
    p = system.numbering.cell_pressure(y)
    turned = system.vector((body.points + u) @ rotation.T - body.points, p)
    # a spinning frame adds a rigid velocity, which must not matter either
    rate = velocity @ rotation.T + np.cross([1.0, 2.0, -3.0], (body.points + u) @ rotation.T)
    force = system.displacement(residual(system, y, v))
    again = system.displacement(residual(system, turned, system.vector(rate)))
    assert np.abs(again - force @ rotation.T).max() <= 1e-11 * np.abs(force).max()


@pytest.mark.parametrize("name", ["report", "fibre reinforced", "Yeoh", "Mooney-Rivlin"])
def test_passive_stress_is_deviatoric(name):
    """The trace of the Cauchy stress of a passive term vanishes: virtual power of dilation is 0."""
    system = system_of(name)
    y, _, _ = random_states(system)
    y[system.numbering.pressures] = 0.0
    place = system.scene.body.points + system.displacement(y)
    force = system.displacement(residual(system, y))
    assert abs((force * place).sum()) <= 1e-12 * np.abs(force * place).sum()


def test_viscous_and_active_stress_are_deviatoric():
    for name in ("viscosity", "active"):
        system = system_of(name)
        y, v, _ = random_states(system)
        y[system.numbering.pressures] = 0.0
        place = system.scene.body.points + system.displacement(y)
        force = system.displacement(residual(system, y, v))
        assert abs((force * place).sum()) <= 1e-12 * np.abs(force * place).sum()


def test_viscous_power_is_never_negative():
    system = system_of("viscosity")
    for seed in range(5):
        y, v, _ = random_states(system, seed)
        y[system.numbering.pressures] = 0.0
        force = system.displacement(residual(system, y, v))
        assert (force * system.displacement(v)).sum() > 0


def changed_numbers(term):
    """Name of each number of a term that is not zero, and the term with that number raised by 10 %."""
    for field in fields(term):
        value = getattr(term, field.name)
        if isinstance(value, float) and value:
            yield field.name, replace(term, **{field.name: 1.1 * value})
        elif isinstance(value, tuple):
            for i, x in enumerate(value):
                other = (*value[:i], 1.1 * x, *value[i + 1 :])
                yield f"{field.name}[{i}]", replace(term, **{field.name: other})
        elif is_dataclass(value):
            for inner, other in changed_numbers(value):
                yield f"{field.name}.{inner}", replace(term, **{field.name: other})


@pytest.mark.parametrize("name", TERMS)
def test_term_moves_with_its_numbers(name):
    """A term whose number Newton cannot see is inert."""
    body = small_body()
    base = TERMS[name]
    system = System(Scene(body, (base,)), True)
    y, v, a = random_states(system)
    reference = residual(system, y, v, a)
    changed = dict(changed_numbers(base))
    assert changed  # every term has one
    for number, term in changed.items():
        other = residual(System(Scene(body, (term,)), True), y, v, a)
        assert np.abs(other - reference).max() > 1e-9 * np.abs(reference).max(), number


def concrete_terms():
    for module in pkgutil.walk_packages(dolfin_tongue.__path__, "dolfin_tongue."):
        if any(part in module.name for part in ("constitutive", "boundary")):
            import_module(module.name)
    found, queue = set(), Term.__subclasses__()
    while queue:
        cls = queue.pop()
        queue += cls.__subclasses__()
        if not inspect.isabstract(cls) and cls.__module__.startswith("dolfin_tongue"):
            found.add(cls)
    return found - {Contact}  # it has no form: see test_contact.py


def test_every_term_is_tested():
    assert concrete_terms() == {type(term) for term in TERMS.values()}


# -- what a scene leaves out ----------------------------------------------------------------------


def test_scene_without_muscles_and_rates_has_none_in_its_form():
    body = small_body()
    passive = System(Scene(body, (ReportTissue(),)), True)
    muscles = System(Scene(body, (ReportTissue(), TERMS["active"])), True)
    viscous = System(Scene(body, (ReportTissue(), Viscosity(1.0))), True)

    def held(system):
        return system.volume.residual_form.coefficients()

    assert passive.volume.rate not in held(passive)  # nothing depends on the velocity
    assert viscous.volume.rate in held(viscous)
    assert muscles.volume.rate in held(muscles)
    assert len(held(muscles)) - len(held(viscous)) == 2  # fibre directions and levels
    assert passive.volume.rate not in passive.volume.jacobian_form.coefficients()
    assert muscles.volume.rate in muscles.volume.jacobian_form.coefficients()


def test_static_scene_has_no_mass_and_no_rates():
    body = small_body()
    terms = (ReportTissue(), Viscosity(1.0), Gravity())
    static = System(Scene(body, terms, (Attached("x0"),)), False).volume
    dynamic = System(Scene(body, terms, (Attached("x0"),)), True).volume
    assert static.rate is None and static.acceleration is None
    assert list(static.residual_form.coefficients()) == [static.state]
    assert not any(isinstance(t, Viscosity) for _, t, _ in static.terms)
    assert len(dynamic.residual_form.coefficients()) == 4


def test_muscles_that_overlap_share_slots():
    """Eight muscles cost as many slots as the largest overlap in a cell, not eight."""
    body = preliminary_tongue()
    slots = body.fibres.slots(body.fibres.names, body.cell_count)
    assert slots.count <= 4 < len(body.fibres.names)
    rng = np.random.default_rng(0)
    activation = rng.random(len(body.fibres.names))
    tensor = np.einsum(
        "mk,mki,mkj->mij", slots.level(activation), slots.directions, slots.directions
    )
    expected = np.zeros_like(tensor)
    for value, muscle in zip(activation, body.fibres.muscles, strict=True):
        outer = np.einsum("ki,kj->kij", muscle.directions, muscle.directions)
        expected[muscle.cells] += value * muscle.density[:, None, None] * outer
    assert tensor == pytest.approx(expected)


def test_a_new_number_needs_no_new_form():
    """The signature of the form does not depend on the numbers of its terms."""
    signatures = set()
    for a0 in (500.0, 700.0):
        system = System(Scene(small_body(), (ReportTissue(a0=a0), Viscosity(a0 / 10))), True)
        signatures.add(system.volume.residual_form.signature())
    assert len(signatures) == 1


def test_ufl_and_numpy_agree_on_the_mobilisation():
    law = TERMS["active"].law
    for stretch in (0.1, 0.6, 1.0, 1.7, 5.0):
        assert law.length_factor(stretch) == pytest.approx(
            float(law.length_factor(ufl.as_ufl(stretch)))
        )
    for rate in (-50.0, 0.0, 3.0):
        assert law.rate_factor(rate) == pytest.approx(float(law.rate_factor(ufl.as_ufl(rate))))
