"""A jaw with a block on it, which the tests of rigid bodies in the direct solver share."""

from __future__ import annotations

from dolfin_tongue.boundary import Gravity
from dolfin_tongue.constitutive import ReportTissue, Viscosity
from dolfin_tongue.control.motion import SmoothMove, Still
from dolfin_tongue.geometry.simple import block_body
from dolfin_tongue.rigid import RigidBody
from dolfin_tongue.scene.scene import Scene

HINGE = {"x": Still(), "z": Still()}
OPENING = {**HINGE, "angle": SmoothMove(-0.1745)}
PIVOT = (-0.03, 0.005, 0.01)
CENTRE = (-0.01, 0.005, 0.005)
TISSUE = (ReportTissue(), Viscosity(5.0))


def jaw(mass: float = 0.02, regions=("x0",), **options) -> RigidBody:
    """Body in front of the block, with a pivot apart from its centre of mass."""
    return RigidBody("jaw", regions, mass, 2.5e-4 * mass, CENTRE, pivot=PIVOT, **options)


def scene_of(*supports, terms=None) -> Scene:
    """Block of three cells, 3 cm long, with an oblique muscle."""
    body = block_body((0.03, 0.01, 0.01), (3, 1, 1), muscles={"pull": (1.0, 0.4, 0.2)})
    return Scene(body, terms or (*TISSUE, Gravity()), supports)
