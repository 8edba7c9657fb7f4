"""Extreme scenes: small blocks, badly shaped and driven ones, and the tongues."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dolfin_tongue.anatomy.scenes import REPORT_ATTACHMENTS, TISSUE_VISCOSITY
from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.body.body import Body
from dolfin_tongue.boundary import Attached, Gravity, SurfaceTension
from dolfin_tongue.constitutive import (
    ActiveMuscles,
    ConstantFibreStress,
    MooneyRivlin,
    ReportTissue,
    Viscosity,
)
from dolfin_tongue.control import Control, Ramp, SmoothRamp
from dolfin_tongue.geometry.simple import block_body, surface_nodes
from dolfin_tongue.scene.scene import Scene
from dolfin_tongue.terms.support import Held

#: The dynamic block of the comparison with FEBio: size, m, and first modulus, Pa.
FEBIO_SIZE = (0.02, 0.01, 0.01)
FEBIO_C1 = 1037.0


@dataclass(frozen=True)
class Driven(Held):
    """The nodes of a region move along x in proportion to a time ramp.

    Parameters
    ----------
    region : of the body.
    distance : moved at the end of the ramp, m.
    duration : of the ramp from t = 0, s.
    """

    region: str
    distance: float
    duration: float

    def nodes(self, body: Body) -> IntArray:
        """Nodes of the region."""
        return body.nodes(self.region)

    def displacement(self, points: FloatArray, time: float) -> FloatArray:
        """Share of the distance along x, m."""
        share = min(1.0, max(0.0, time / self.duration))
        return np.tile([share * self.distance, 0.0, 0.0], (len(points), 1))


def muscle_block(factor: float = 1.0, viscosity: float = 10.0, body: Body | None = None) -> Scene:
    """Block of 12 cells with one muscle under gravity: the scene of the map.

    Parameters
    ----------
    factor : of the passive modulus of the report.
    viscosity : Pa s.
    body : another block with a muscle ``pull``.
    """
    body = body or block_body((0.03, 0.02, 0.02), (3, 2, 2), muscles={"pull": (1.0, 0.0, 0.3)})
    pull = ActiveMuscles({"pull": Ramp(0.5, 0.0, 0.02)}, 20e3)
    terms = (ReportTissue(500.0 * factor), Viscosity(viscosity), pull, Gravity())
    return Scene(body, terms, (Attached("x0"),))


def bad_block(quality: float = 0.05) -> Body:
    """Block whose worst cells have the given scaled Jacobian: all inner nodes are moved alike."""
    body = block_body((0.04, 0.03, 0.03), (4, 3, 3), muscles={"pull": (1.0, 0.0, 0.3)})
    inside = np.setdiff1d(np.arange(len(body.points)), surface_nodes(body))
    low, high = 0.0, 0.0099
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if _quality(body, inside, middle) > quality else (low, middle)
    points = body.points.copy()
    points[inside] += low
    return replace(body, points=points)


def _quality(body: Body, inside: IntArray, distance: float) -> float:
    """Smallest scaled Jacobian after moving nodes; -1 for a body that is refused."""
    points = body.points.copy()
    points[inside] += distance
    try:
        return float(replace(body, points=points).scaled_jacobians.min())
    except ValueError:
        return -1.0


def film_on_a_corner(sigma: float, quality: float = 0.05, viscosity: float = 1.0) -> Scene:
    """Free block of liquid under surface tension, one of whose corner cells is nearly inverted.

    Parameters
    ----------
    sigma : N/m.
    quality : scaled Jacobian of the worst cell: the corner node is pushed into its cell.
    viscosity : Pa s.
    """
    body = block_body((0.02, 0.02, 0.02), (2, 2, 2), density=1000.0)
    corner = np.array([len(body.points) - 1])
    low, high = 0.0, -0.0099
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if _quality(body, corner, middle) > quality else (low, middle)
    points = body.points.copy()
    points[corner] += low
    return Scene(replace(body, points=points), (Viscosity(viscosity), SurfaceTension(sigma)))


def driven_block(distance: float, duration: float = 0.1) -> Scene:
    """Block of 3 cm whose far face is driven along x by a distance (m)."""
    body = block_body((0.03, 0.02, 0.02), (3, 2, 2))
    supports = (Attached("x0"), Driven("x1", distance, duration))
    return Scene(body, (ReportTissue(), Viscosity(10.0)), supports)


def flung_block(acceleration: float) -> Scene:
    """Block that hangs in a field of an acceleration (m/s2) along x."""
    body = block_body((0.03, 0.02, 0.02), (3, 2, 2))
    terms = (ReportTissue(), Viscosity(10.0), Gravity((acceleration, 0.0, 0.0)))
    return Scene(body, terms, (Attached("x0"),))


def tongue(
    body: Body,
    control: Control | None = None,
    *,
    factor: float = 1.0,
    viscosity: float = TISSUE_VISCOSITY,
    gravity: float = 9.81,
) -> Scene:
    """Return the report's tongue with all muscles alike; None for no muscles.

    Parameters
    ----------
    body : `preliminary_tongue()`.
    control : activation of all muscles; default none of them.
    factor : of the passive modulus.
    viscosity : Pa s.
    gravity : m/s2, downwards; 0 for none.
    """
    terms = [ReportTissue(500.0 * factor), Viscosity(viscosity)]
    if gravity:
        terms.append(Gravity((0.0, 0.0, -gravity)))
    if control is not None:
        terms.append(ActiveMuscles(dict.fromkeys(body.fibres.names, control)))
    return Scene(body, tuple(terms), (Attached(*REPORT_ATTACHMENTS),))


def half_active() -> Control:
    """All muscles to 50 % within 100 ms, from t = 0.1 s: the demo, sooner."""
    return SmoothRamp(0.5, 0.1, 0.1)


def febio_dynamic(cells: tuple[int, int, int], active: bool) -> Scene:
    """Build the undamped block of case C: gravity along -x, with or without 20 kPa along z."""
    body = block_body(FEBIO_SIZE, cells, muscles={"across": (0.0, 0.0, 1.0)})
    terms = [MooneyRivlin(FEBIO_C1, 0.0), Gravity((-9.81, 0.0, 0.0))]
    if active:
        terms.append(ConstantFibreStress({"across": Ramp(1.0, 0.0, 0.05)}, 20e3))
    return Scene(body, tuple(terms), (Attached("x0"),))


def febio_static(material: str, angle: float) -> Scene:
    """Build the static block of case A: 10 kPa along fibres at an angle (degrees) to x.

    Parameters
    ----------
    material : ``MR`` (c1 = 5, c2 = 1 kPa) or ``FUNGISO`` (C = 2 kPa, all b = 4): C/2 (exp(b E:E) -
        1) with E:E = J1^2 + 2 J2 is (67) with a0 = C/2, a1 = b, a2 = 2 b.
    angle : of the fibres in the x-y plane.
    """
    direction = (np.cos(np.radians(angle)), np.sin(np.radians(angle)), 0.0)
    body = block_body((10e-3, 4e-3, 4e-3), (10, 4, 4), muscles={"along": direction})
    tissue = {"MR": MooneyRivlin(5e3, 0.0, 1e3), "FUNGISO": ReportTissue(1e3, 4.0, 8.0)}[material]
    pull = ConstantFibreStress({"along": Ramp(1.0, 0.0, 1.0)}, 10e3)
    return Scene(body, (tissue, pull), (Attached("x0"),))
