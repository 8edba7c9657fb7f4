"""Extreme scenes of boundaries: impact, squeezing, light and heavy bones, films, sliding."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from dolfin_tongue.anatomy.bones import hyoid, mandible, opening
from dolfin_tongue.anatomy.scenes import report_mouth, report_tongue
from dolfin_tongue.body.state import State
from dolfin_tongue.boundary import Attached, Barrier, Contact, Gravity, Sliding, moved_onto
from dolfin_tongue.constitutive import ReportTissue, Viscosity
from dolfin_tongue.control import SmoothMove, SmoothRamp, Still
from dolfin_tongue.geometry.palate import report_palate
from dolfin_tongue.geometry.simple import block_body
from dolfin_tongue.scene.scene import Scene
from dolfin_tongue.surfaces import Plane, Sphere


def dropped_block(speed: float, tilt: float) -> tuple[Scene, State]:
    """Block of 20 x 20 x 10 mm 1 mm above a plane, and its state as it comes down.

    Parameters
    ----------
    speed : downwards, m/s.
    tilt : degrees about two axes, so that it lands on a corner; 0: on its face.
    """
    body = block_body((0.02, 0.02, 0.01), (4, 4, 2))
    turn = Rotation.from_euler("xyz", [tilt, 1.3 * tilt, 0.0], degrees=True).as_matrix()
    points = (body.points - body.points.mean(axis=0)) @ turn.T
    body = replace(body, points=points - [0.0, 0.0, points[:, 2].min() - 1e-3])
    scene = Scene(body, (ReportTissue(), Viscosity(20.0), Gravity(), Contact(Plane())))
    velocity = np.tile([0.0, 0.0, -speed], (len(points), 1))
    return scene, State(0.0, np.zeros_like(points), velocity, np.zeros(len(body.cells)))


def closing_palate(distance: float, duration: float) -> Scene:
    """Let the palate come down on the resting tongue by a distance (m) within a duration (s)."""
    scene = report_tongue({})
    motion = (Still(), Still(), SmoothMove(-distance, 0.0, duration))
    contact = Contact(report_palate(), "upper", Barrier(), motion)
    return replace(scene, terms=(*scene.terms, contact))


def squeezed_tongue(share: float, duration: float) -> Scene:
    """Close the mandible by a share of 10 degrees; it presses an active tongue to the palate."""
    lift = {"genioglossus_posterior": SmoothRamp(1.0, 0.0, 0.1)}
    return report_mouth(lift, motion=opening(0.05, duration, -share))


def weighed_mandible(mass: float) -> Scene:
    """Hang a free mandible of a mass (kg), pulled up by its masseter, on the tongue."""
    scene = report_tongue({"genioglossus_posterior": SmoothRamp(0.5, 0.0, 0.1)})
    bone = mandible("genioglossus_origin", masseter=SmoothRamp(0.1, 0.05, 0.1))
    bone = replace(bone, mass=mass, inertia=bone.inertia * mass / bone.mass)
    fixed = Attached("styloglossus_insertion")
    return Scene(scene.body, scene.terms, (fixed, bone, hyoid("base")))


def sliding_block(radius: float, gravity: float) -> Scene:
    """Block of 2 cm in a bowl, flung sideways by a gravity that leans by 60 degrees.

    Parameters
    ----------
    radius : of the bowl, m.
    gravity : m/s2.
    """
    body = block_body((0.02, 0.02, 0.02), (2, 2, 2))
    bowl = Sphere((0.0, 0.0, radius), radius, inside=True)
    body = moved_onto(replace(body, points=body.points - [0.01, 0.01, 0.0]), bowl, "z0")
    lean = gravity * np.array([np.sin(np.pi / 3), 0.0, -np.cos(np.pi / 3)])
    terms = (ReportTissue(), Viscosity(20.0), Gravity(tuple(lean)))
    return Scene(body, terms, (Sliding(bowl, "z0"),))
