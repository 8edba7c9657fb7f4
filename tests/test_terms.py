"""Every term against energy, finite differences and rigid motion.

Worth reading first: `test_tangent` and `test_force_is_the_gradient_of_the_energy` are
parametrised over all terms; `test_every_term_is_tested` fails when a new one is left out.
"""

import inspect
import pkgutil
from importlib import import_module

import numpy as np
import pytest
import ufl
from dolfinx import fem

import dolfin_tongue
from dolfin_tongue.boundary import Contact, Gravity, Skin, SurfaceTension
from dolfin_tongue.constitutive import (
    ActiveMuscles,
    ConstantFibreStress,
    FibreReinforcedTissue,
    MooneyRivlin,
    ReportTissue,
    Viscosity,
)
from dolfin_tongue.control import Constant
from dolfin_tongue.fenicsx.system import System
from dolfin_tongue.geometry.simple import block_body, distort
from dolfin_tongue.scene.scene import Scene
from dolfin_tongue.terms.term import EnergyTerm, Term

MUSCLES = {"along": (1.0, 0.0, 0.0), "across": (0.0, 0.6, 0.8)}
TERMS = {
    "report": ReportTissue(),
    "fibre reinforced": FibreReinforcedTissue(muscle="across"),
    "Yeoh": MooneyRivlin(),
    "Mooney-Rivlin": MooneyRivlin(c10=800.0, c20=0.0, c01=300.0),
    "viscosity": Viscosity(40.0),
    "active": ActiveMuscles({"along": Constant(0.3), "across": Constant(0.7)}, 20e3),
    "constant fibre": ConstantFibreStress({"across": Constant(0.7)}, 20e3),
    "gravity": Gravity((1.0, -2.0, -9.81)),
    "surface tension": SurfaceTension(3.0, surface="x1"),
    "skin": Skin(20e3, 1e-3),
}


def small_body():
    body = block_body((0.03, 0.02, 0.02), (2, 2, 1), muscles=MUSCLES)
    return distort(body, 0.15, seed=3)


def random_states(system, seed=1, amplitude=0.1):
    """Displacement, velocity, acceleration of random size on a cell's scale, and pressures."""
    rng = np.random.default_rng(seed)
    shape, cells = system.scene.body.points.shape, len(system.scene.body.cells)
    edge = 0.01
    pressure = 500 * rng.standard_normal(cells)
    y = system.mixed(amplitude * edge * rng.standard_normal(shape), pressure)
    v = system.mixed(3 * amplitude * edge * rng.standard_normal(shape))
    a = system.mixed(rng.standard_normal(shape))
    return y, v, a


def residual(system, y, v=None, a=None):
    system.set_state(0.0, y, v, a, y)
    out = np.zeros(system.space.size)
    system.residual(0.0, out)
    return out


def system_of(name, dynamic=True):
    return System(Scene(small_body(), (TERMS[name],)), dynamic)


def integral(system, expression):
    return fem.assemble_scalar(fem.form(expression * system.dx))


@pytest.mark.parametrize("name", TERMS)
def test_tangent(name):
    """The assembled tangent is the derivative of the residual, shifts included."""
    system = system_of(name)
    y, v, a = random_states(system)
    rng = np.random.default_rng(5)
    shape, cells = system.scene.body.points.shape, len(system.scene.body.cells)
    d = system.mixed(rng.standard_normal(shape), 1e3 * rng.standard_normal(cells))
    shifts = (30.0, 500.0, 1.8)

    def along(e):
        state = (y + e * d, v + e * shifts[0] * d, a + e * shifts[1] * d, y + e * shifts[2] * d)
        system.set_state(0.0, *state)
        out = np.zeros_like(d)
        system.residual(0.0, out)
        return out

    h = 1e-7
    difference = (along(h) - along(-h)) / (2 * h)
    matrix = system.new_matrix()
    system.set_state(0.0, y, v, a, y)
    system.jacobian(matrix, shifts)
    vector = matrix.createVecRight()
    vector.array[:] = d
    product = (matrix * vector).array
    for dofs in (system.space.displacement_dofs, system.space.pressure_dofs):
        scale = np.abs(difference[dofs]).max()
        assert np.abs(product[dofs] - difference[dofs]).max() <= 1e-6 * scale


@pytest.mark.parametrize("name", [k for k, v in TERMS.items() if isinstance(v, EnergyTerm)])
def test_force_is_the_gradient_of_the_energy(name):
    """Virtual power along a direction equals the central difference of the energy."""
    system = system_of(name)
    y, v, a = random_states(system)
    y[system.space.pressure_dofs] = 0.0
    d = system.mixed(np.random.default_rng(6).standard_normal(system.scene.body.points.shape))
    kin = system.kinematics(system.state, system.rate)
    form = fem.form(TERMS[name].energy(kin, system.fields))

    def energy(e):
        system.state.x.array[:] = y + e * d
        return fem.assemble_scalar(form)

    h = 1e-7
    force = residual(system, y, 0 * v, 0 * a)[system.space.displacement_dofs]
    power = float((force * d[system.space.displacement_dofs]).sum())
    difference = (energy(h) - energy(-h)) / (2 * h)
    assert abs(power - difference) <= 1e-7 * np.abs(force).sum()


@pytest.mark.parametrize("name", [k for k in TERMS if k != "gravity"])
def test_internal_forces_have_no_resultant_and_no_moment(name):
    """A free body feels no net force and no net moment from its own stress."""
    system = system_of(name)
    y, v, a = random_states(system)
    force = system.displacement(residual(system, y, v, 0 * a))
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
    u, p, velocity = system.displacement(y), system.pressure(y), system.displacement(v)
    turned = system.mixed((body.points + u) @ rotation.T - body.points, p)
    # a spinning frame adds a rigid velocity, which must not matter either
    rate = velocity @ rotation.T + np.cross([1.0, 2.0, -3.0], (body.points + u) @ rotation.T)
    force = system.displacement(residual(system, y, v, 0 * v))
    again = system.displacement(residual(system, turned, system.mixed(rate), 0 * v))
    assert np.abs(again - force @ rotation.T).max() <= 1e-11 * np.abs(force).max()


@pytest.mark.parametrize("name", ["report", "fibre reinforced", "Yeoh", "Mooney-Rivlin"])
def test_passive_stress_is_deviatoric(name):
    """The trace of the Cauchy stress of a passive term vanishes: virtual power of dilation is 0."""
    system = system_of(name)
    y, v, a = random_states(system)
    y[system.space.pressure_dofs] = 0.0
    place = system.scene.body.points + system.displacement(y)
    force = system.displacement(residual(system, y, 0 * v, 0 * a))
    assert abs((force * place).sum()) <= 1e-12 * np.abs(force * place).sum()


def test_viscous_and_active_stress_are_deviatoric():
    for name in ("viscosity", "active"):
        system = system_of(name)
        y, v, a = random_states(system)
        y[system.space.pressure_dofs] = 0.0
        place = system.scene.body.points + system.displacement(y)
        force = system.displacement(residual(system, y, v, 0 * a))
        assert abs((force * place).sum()) <= 1e-12 * np.abs(force * place).sum()


def test_viscous_power_is_never_negative():
    system = system_of("viscosity")
    for seed in range(5):
        y, v, a = random_states(system, seed)
        y[system.space.pressure_dofs] = 0.0
        force = system.displacement(residual(system, y, v, 0 * a))
        assert (force * system.displacement(v)).sum() > 0


@pytest.mark.parametrize("name", TERMS)
def test_term_moves_with_its_numbers(name):
    """A term whose number Newton cannot see is inert."""
    from dataclasses import fields, replace

    body = small_body()
    base = TERMS[name]
    y, v, a = random_states(System(Scene(body, (base,)), True))
    reference = residual(System(Scene(body, (base,)), True), y, v, a)
    for field in fields(base):
        value = getattr(base, field.name)
        if isinstance(value, float) and value:
            changed = replace(base, **{field.name: 1.1 * value})
            other = residual(System(Scene(body, (changed,)), True), y, v, a)
            assert np.abs(other - reference).max() > 1e-9 * np.abs(reference).max(), field.name


def concrete_terms():
    for module in pkgutil.walk_packages(dolfin_tongue.__path__, "dolfin_tongue."):
        if any(part in module.name for part in ("constitutive", "boundary")):
            import_module(module.name)
    found, queue = set(), [Term]
    while queue:
        cls = queue.pop()
        queue += cls.__subclasses__()
        if not inspect.isabstract(cls) and cls.__module__.startswith("dolfin_tongue"):
            found.add(cls)
    return found - {Contact}  # it has no form: see test_contact.py


def test_every_term_is_tested():
    assert concrete_terms() == {type(term) for term in TERMS.values()}


# -- closed forms ---------------------------------------------------------------------------------


def homogeneous(system, F):
    """Mixed state with the deformation gradient F everywhere."""
    body = system.scene.body
    return system.mixed(body.points @ (F - np.eye(3)).T)


def cauchy(term, F):
    """Mean first Piola-Kirchhoff stress times F^T / J of a term under homogeneous deformation."""
    system = System(Scene(block_body((1.0, 1.0, 1.0), (1, 1, 1), muscles=MUSCLES), (term,)), True)
    y = homogeneous(system, F)
    force = system.displacement(residual(system, y, 0 * y, 0 * y))
    # sum over nodes of f x X is the volume integral of P
    piola = np.einsum("ki,kj->ij", force, system.scene.body.points)
    return piola @ F.T / np.linalg.det(F)


def deviator(T):
    return T - np.trace(T) / 3 * np.eye(3)


@pytest.mark.parametrize("stretch", [0.7, 0.9, 1.2, 1.5])
def test_uniaxial_closed_form(stretch):
    """Simple stretch at constant volume: stress differences from W as a function of the stretch.

    For isochoric uniaxial stretch, T11 - T22 = stretch dW/dstretch.
    """
    F = np.diag([stretch, stretch**-0.5, stretch**-0.5])

    def report(s):
        e1, e2 = (s**2 - 1) / 2, (1 / s - 1) / 2
        j1 = e1 + 2 * e2
        j2 = (e1**2 + 2 * e2**2 - j1**2) / 2
        return 500 * (np.exp(3 * j1**2 + 6 * j2) - 1)

    def yeoh(s):
        i1 = s**2 + 2 / s
        return 1037 * (i1 - 3) + 486 * (i1 - 3) ** 2

    for term, energy in ((ReportTissue(), report), (MooneyRivlin(), yeoh)):
        T = cauchy(term, F)
        h = 1e-6
        expected = stretch * (energy(stretch + h) - energy(stretch - h)) / (2 * h)
        assert T[0, 0] - T[1, 1] == pytest.approx(expected, rel=1e-7)


@pytest.mark.parametrize(("stretch", "shear"), [(1.0, 0.3), (0.8, -0.4), (1.3, 0.2)])
def test_plane_stretch_and_shear(stretch, shear):
    """Deformation (72) of fig. 4: S of the report by hand, (70), (71), and its deviator (36)."""
    C = np.array([[stretch**2, stretch * shear, 0], [stretch * shear, 1 / stretch + shear**2, 0],
                  [0, 0, 1 / stretch]])  # fmt: skip
    assert np.linalg.det(C) == pytest.approx(1.0)
    F = np.array([[stretch, shear, 0], [0, stretch**-0.5, 0], [0, 0, stretch**-0.5]])
    assert pytest.approx(C) == F.T @ F
    E = (C - np.eye(3)) / 2
    j1 = np.trace(E)
    j2 = (np.sum(E * E) - j1**2) / 2
    W = 500 * np.exp(3 * j1**2 + 6 * j2)
    S = W * (6 * j1 * np.eye(3) + 6 * (E - j1 * np.eye(3)))
    T = F @ S @ F.T
    assert cauchy(ReportTissue(), F) == pytest.approx(deviator(T), abs=1e-9 * np.abs(T).max())


def test_shear_modulus_at_rest():
    """a0 a2 / 2 = 1.5 kPa for the report's constants, 2 c10 for the published tongue."""
    g = 1e-6
    F = np.eye(3)
    F[0, 1] = g
    assert cauchy(ReportTissue(), F)[0, 1] / g == pytest.approx(1500, rel=1e-5)
    assert cauchy(MooneyRivlin(), F)[0, 1] / g == pytest.approx(2 * 1037, rel=1e-5)


def test_active_stress_is_tensile_along_the_fibre():
    """T = tau n x n with n = F N / stretch (31), (32), up to its spherical part."""
    F = np.array([[0.9, 0.1, 0.0], [0.05, 1.05, 0.2], [0.0, -0.1, 1.1]])
    F /= np.linalg.det(F) ** (1 / 3)
    term = ActiveMuscles({"across": Constant(0.5)}, 30e3)
    along = F @ np.array(MUSCLES["across"])
    stretch = np.linalg.norm(along)
    n = along / stretch
    tau = 30e3 * 0.5 * term.law.length_factor(stretch) * 0.7  # g(0) = y0
    assert cauchy(term, F) == pytest.approx(deviator(tau * np.outer(n, n)), rel=1e-9, abs=1e-6)


def test_constant_fibre_stress_is_what_it_says():
    """T = T0 (F N) x (F N) / J, spherical part included."""
    F = np.array([[0.9, 0.1, 0.0], [0.05, 1.05, 0.2], [0.0, -0.1, 1.1]])
    along = F @ np.array(MUSCLES["across"])
    term = ConstantFibreStress({"across": Constant(0.5)}, 30e3)
    expected = 15e3 * np.outer(along, along) / np.linalg.det(F)
    assert cauchy(term, F) == pytest.approx(expected, rel=1e-9, abs=1e-6)


def test_static_active_stress_is_that_of_a_standing_muscle():
    """Without rates the force-velocity factor is g(0) = y0, as in dynamics at rest."""
    body = block_body((0.03, 0.02, 0.02), (2, 2, 1), muscles=MUSCLES)
    from dolfin_tongue.boundary import Attached

    scene = Scene(body, (TERMS["report"], TERMS["active"]), (Attached("x0"),))
    dynamic, static = System(scene, True), System(scene, False)
    y, v, _ = random_states(dynamic)
    first = residual(dynamic, y, 0 * v, 0 * v)
    static.set_state(0.0, static.mixed(dynamic.displacement(y), dynamic.pressure(y)))
    second = np.zeros(static.space.size)
    static.residual(0.0, second)
    a, b = dynamic.displacement(first), static.displacement(second)
    assert np.abs(a - b).max() <= 1e-12 * np.abs(a).max()


def test_viscous_stress():
    """Cauchy stress 2 eta D for a shear flow of rate g."""
    term = Viscosity(10.0)
    system = System(Scene(block_body((1.0, 1.0, 1.0), (1, 1, 1)), (term,)), True)
    y = system.mixed(np.zeros_like(system.scene.body.points))
    L = np.zeros((3, 3))
    L[0, 2] = 4.0
    v = system.mixed(system.scene.body.points @ L.T)
    force = system.displacement(residual(system, y, v, 0 * y))
    stress = np.einsum("ki,kj->ij", force, system.scene.body.points)
    assert stress == pytest.approx(10.0 * (L + L.T), abs=1e-9)


def test_pressure_is_positive_in_compression():
    """A pressure pushes outwards: its virtual power of an expansion is negative internal power."""
    system = System(Scene(block_body((1.0, 1.0, 1.0), (1, 1, 1)), (ReportTissue(),)), True)
    y = system.mixed(np.zeros_like(system.scene.body.points), 1.0)
    force = system.displacement(residual(system, y, 0 * y, 0 * y))
    stress = np.einsum("ki,kj->ij", force, system.scene.body.points)
    assert stress == pytest.approx(-np.eye(3), abs=1e-12)


def test_volume_rows_are_the_volume_changes():
    """Rows of p give minus the volume change of each cell (91), here from the node positions."""
    system = system_of("report")
    y, v, a = random_states(system)
    change = system.volume_change(residual(system, y, v, a))
    from dolfin_tongue.record.observe import volume_changes

    body = system.scene.body
    expected = volume_changes(body, system.displacement(y))
    assert np.abs(expected).max() > 1e-3
    assert change == pytest.approx(expected, rel=1e-10, abs=1e-13)


def test_det_f_by_ufl_is_that_of_the_node_positions():
    from dolfin_tongue.body.shape import volume_ratios
    from dolfin_tongue.record.observe import local_volume_ratios

    system = system_of("report")
    y, v, _ = random_states(system)
    state = system.state_of(0.0, y, v)
    body = system.scene.body
    expected = volume_ratios(body.points, state.displacement, body.cells)
    ratios = local_volume_ratios(system, state)
    assert np.sort(ratios.ravel()) == pytest.approx(np.sort(expected.ravel()), rel=1e-10)


def test_inertia_is_the_consistent_mass():
    """M a for a constant acceleration sums up to the mass of the body (40)."""
    system = system_of("report")
    zero = system.mixed(np.zeros_like(system.scene.body.points))
    a = system.mixed(np.tile([0.0, 0.0, 2.0], (len(system.scene.body.points), 1)))
    force = system.displacement(residual(system, zero, zero, a)).sum(axis=0)
    assert force == pytest.approx([0, 0, 2 * system.scene.body.mass], abs=1e-12)


# -- what a scene leaves out ----------------------------------------------------------------------


def test_scene_without_muscles_and_rates_has_none_in_its_form():
    body = small_body()
    passive = System(Scene(body, (ReportTissue(),)), True)
    muscles = System(Scene(body, (ReportTissue(), TERMS["active"])), True)
    viscous = System(Scene(body, (ReportTissue(), Viscosity(1.0))), True)

    def held(system):
        return system.residual_form.coefficients()

    assert passive.rate not in held(passive)  # nothing depends on the velocity
    assert viscous.rate in held(viscous)
    assert muscles.rate in held(muscles)
    assert len(held(muscles)) - len(held(viscous)) == 2  # fibre directions and levels
    assert passive.rate not in passive.jacobian_form.coefficients()
    assert muscles.rate in muscles.jacobian_form.coefficients()


def test_static_scene_has_no_mass_and_no_rates():
    from dolfin_tongue.boundary import Attached

    body = small_body()
    terms = (ReportTissue(), Viscosity(1.0), Gravity())
    static = System(Scene(body, terms, (Attached("x0"),)), False)
    dynamic = System(Scene(body, terms, (Attached("x0"),)), True)
    assert static.rate is None and static.acceleration is None
    assert list(static.residual_form.coefficients()) == [static.state]
    assert not any(isinstance(t, Viscosity) for t in static.terms_in_form)
    assert len(dynamic.residual_form.coefficients()) == 4


def test_muscles_that_overlap_share_slots():
    """Eight muscles cost as many slots as the largest overlap in a cell, not eight."""
    from dolfin_tongue.geometry.preliminary import preliminary_tongue

    body = preliminary_tongue()
    slots = body.fibres.slots(body.fibres.names, len(body.cells))
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
        signatures.add(system.residual_form.signature())
    assert len(signatures) == 1


def test_ufl_and_numpy_agree_on_the_mobilisation():
    law = TERMS["active"].law
    for stretch in (0.1, 0.6, 1.0, 1.7, 5.0):
        assert law.length_factor(stretch) == pytest.approx(
            float(law.length_factor(ufl.as_ufl(stretch), float, ufl.exp))
        )
