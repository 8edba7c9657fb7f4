"""One of every term on a small body, random states of it, and its residual."""

from __future__ import annotations

import numpy as np

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.body.body import Body
from dolfin_tongue.boundary import Gravity, Skin, SurfaceTension
from dolfin_tongue.constitutive import (
    ActiveMuscles,
    ConstantFibreStress,
    FibreReinforcedTissue,
    MooneyRivlin,
    ReportTissue,
    Viscosity,
)
from dolfin_tongue.control import Constant, Instant
from dolfin_tongue.fenicsx import System
from dolfin_tongue.fenicsx.arguments import Arguments
from dolfin_tongue.geometry.simple import block_body, distort
from dolfin_tongue.scene.scene import Scene

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


def small_body() -> Body:
    body = block_body((0.03, 0.02, 0.02), (2, 2, 1), muscles=MUSCLES)
    return distort(body, 0.15, seed=3)


def system_of(name: str, dynamic: bool = True) -> System:
    return System(Scene(small_body(), (TERMS[name],)), dynamic)


def random_states(
    system: System, seed: int = 1, amplitude: float = 0.1
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Displacement, velocity, acceleration of random size on a cell's scale, and pressures."""
    rng = np.random.default_rng(seed)
    body = system.scene.body
    edge = 0.01
    pressure = 500 * rng.standard_normal(body.cell_count)
    y = system.vector(amplitude * edge * rng.standard_normal(body.points.shape), pressure)
    v = system.vector(3 * amplitude * edge * rng.standard_normal(body.points.shape))
    a = system.vector(rng.standard_normal(body.points.shape))
    return y, v, a


def arguments(
    y: FloatArray,
    v: FloatArray | None = None,
    a: FloatArray | None = None,
    end: FloatArray | None = None,
) -> Arguments:
    """Arguments at t = 0: at rest, and with the state itself as the end of the step, if not given."""
    v, a = (np.zeros_like(y) if x is None else x for x in (v, a))
    return Arguments(Instant(0.0), 0.0, y, v, a, y if end is None else end)


def residual(
    system: System, y: FloatArray, v: FloatArray | None = None, a: FloatArray | None = None
) -> FloatArray:
    out = np.zeros(system.size)
    system.residual(arguments(y, v, a), out)
    return out
