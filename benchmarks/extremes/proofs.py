"""Scenes of boundaries whose motion is known: a block in a bowl, a bone on a hinge with a block."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from math import asin, cos, radians, sin, sqrt

import numpy as np
from scipy.special import ellipk

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.body.state import State
from dolfin_tongue.boundary import Gravity, Sliding, moved_onto
from dolfin_tongue.constitutive import MooneyRivlin, Viscosity
from dolfin_tongue.control import Still
from dolfin_tongue.direct import Model
from dolfin_tongue.geometry.simple import block_body
from dolfin_tongue.rigid import RigidBody
from dolfin_tongue.scene.scene import Scene
from dolfin_tongue.surfaces import Sphere

BOWL = Sphere((0.0, 0.0, 0.1), 0.1, inside=True)
AMPLITUDE = radians(25.0)

#: So stiff that the block turns as a whole: gravity strains it by rho g h / (6 c10) = 3e-5.
STIFF = MooneyRivlin(c10=1e6, c20=0.0)


def block_in_bowl() -> Scene:
    """Block of 2 cm at the bottom of a bowl; gravity leans, so that it swings about the lean."""
    body = block_body((0.02, 0.02, 0.02), (2, 2, 2))
    body = moved_onto(replace(body, points=body.points - [0.01, 0.01, 0.0]), BOWL, "z0")
    lean = (9.81 * sin(AMPLITUDE), 0.0, -9.81 * cos(AMPLITUDE))
    return Scene(body, (STIFF, Gravity(lean)), (Sliding(BOWL, "z0"),))


def nodal_masses(scene: Scene) -> FloatArray:
    """Lumped masses of the nodes, shape (n,), kg."""
    mass = Model(Scene(scene.body, (MooneyRivlin(),))).mass
    return np.asarray(mass.sum(axis=1)).ravel()


def exact_period(scene: Scene) -> float:
    """Period of a physical pendulum about the bowl's centre, 4 sqrt(I/(m g L)) K(sin^2(A/2)), s."""
    mass = Model(Scene(scene.body, (MooneyRivlin(),))).mass
    arm = scene.body.points - np.asarray(BOWL.centre)
    inertia = sum(float(arm[:, i] @ (mass @ arm[:, i])) for i in (0, 2))
    first = -float(np.sum(mass @ arm[:, 2]))
    return 4 * sqrt(inertia / (9.81 * first)) * float(ellipk(sin(AMPLITUDE / 2) ** 2))


def swing_angles(scene: Scene, states: Iterable[State]) -> FloatArray:
    """Time, s, and angle of the centre of mass about the bowl's centre, rad; shape (states, 2)."""
    weights = nodal_masses(scene)
    weights /= weights.sum()
    rows = []
    for state in states:
        middle = weights @ (scene.body.points + state.displacement) - np.asarray(BOWL.centre)
        rows.append((state.time, asin(middle[0] / np.linalg.norm(middle))))
    return np.array(rows)


def period_of(swing: FloatArray) -> float:
    """Twice the time between the passages of the lean, interpolated linearly, s."""
    times, angles = swing[:, 0], swing[:, 1] - AMPLITUDE
    zeros = np.flatnonzero(np.diff(np.sign(angles)) != 0)
    first, second = (
        times[i] - angles[i] * (times[i + 1] - times[i]) / (angles[i + 1] - angles[i])
        for i in zeros[:2]
    )
    return float(2 * (second - first))


def hinged_bone() -> Scene:
    """Let a bone of 50 g on a hinge, which carries a soft block of 12 g, fall."""
    body = block_body((0.03, 0.02, 0.02), (3, 2, 2))
    bone = RigidBody(
        "bone", ("x0",), 0.05, 1e-5, (-0.005, 0.01, 0.03),
        motion={"x": Still(), "z": Still()}, pivot=(-0.01, 0.01, 0.06),
    )  # fmt: skip
    return Scene(body, (MooneyRivlin(3e3, 0.0), Viscosity(20.0), Gravity()), (bone,))
