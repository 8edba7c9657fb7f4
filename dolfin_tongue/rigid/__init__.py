"""Rigid bodies in the midsagittal plane: mandible and hyoid (61), (62)."""

from dolfin_tongue.rigid.body import COORDINATES, SKULL, RigidBody
from dolfin_tongue.rigid.forces import (
    AngularSpring,
    LineMuscle,
    Moment,
    OwnForce,
    PointForce,
    RigidForce,
    Spring,
    StateForce,
)

__all__ = [
    "COORDINATES",
    "SKULL",
    "AngularSpring",
    "LineMuscle",
    "Moment",
    "OwnForce",
    "PointForce",
    "RigidBody",
    "RigidForce",
    "Spring",
    "StateForce",
]
