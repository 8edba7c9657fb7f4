"""Mandible and hyoid of an adult, for the frame that the report's and the published tongue share.

Masses and moments of inertia are of the size that models of jaw motion use (R. Laboissiere,
D. J. Ostry, A. G. Feldman, Biol. Cybern. 74 (1996) 373-384, less the tongue, which is tissue here).
Anchors and stiffnesses are guesses of the right size, to be replaced by a user who has better
ones. x from front to back, z up.
"""

from __future__ import annotations

from math import radians

from dolfin_tongue.base.errors import OutOfRange, is_number
from dolfin_tongue.control import Control, Motion, SmoothMove, Still
from dolfin_tongue.rigid import AngularSpring, LineMuscle, RigidBody, RigidForce, Spring

#: Centre of the condyles, about which the mandible turns, m.
CONDYLE = (0.140, 0.0, 0.140)

#: Mass, kg, and moment of inertia about the centre of mass, kg m2.
MANDIBLE_MASS, MANDIBLE_INERTIA = 0.4, 6e-4
HYOID_MASS, HYOID_INERTIA = 0.02, 4e-6

#: Opening by 10 degrees: the condyles glide forwards and down (m) while the mandible turns.
OPENING, GLIDE = radians(-10.0), (-0.006, -0.003)


def opening(start: float = 0.0, duration: float = 0.2, share: float = 1.0) -> dict[str, Motion]:
    """Prescribed opening of the mandible.

    Parameters
    ----------
    start, duration : s.
    share : of 10 degrees; negative closes.
    """
    if not is_number(share):
        raise OutOfRange("share", share, "a finite number")
    x, z = GLIDE
    return {
        "x": SmoothMove(share * x, start, duration),
        "z": SmoothMove(share * z, start, duration),
        "angle": SmoothMove(share * OPENING, start, duration),
    }


def mandible(
    *regions: str, motion: dict[str, Motion] | None = None, masseter: Control | None = None
) -> RigidBody:
    """Mandible that carries some regions of a tongue.

    Parameters
    ----------
    regions : of the tongue.
    motion : prescribed coordinates, e.g. `opening()`; by default it hangs on its hinge, held by a
        torsion spring and damper.
    masseter : activation of the closing muscles of both sides, 100 N in all.
    """
    forces: list[RigidForce] = [AngularSpring(20.0, 0.2)] if motion is None else []
    if masseter is not None:
        ends = ((0.120, 0.0, 0.085), (0.110, 0.0, 0.140))
        forces.append(LineMuscle(*ends, max_force=100.0, activation=masseter))
    return RigidBody(
        "mandible", regions, MANDIBLE_MASS, MANDIBLE_INERTIA, (0.085, 0.0, 0.075), tuple(forces),
        {"x": Still(), "z": Still()} if motion is None else motion, CONDYLE,
    )  # fmt: skip


def hyoid(*regions: str, geniohyoid: Control | None = None) -> RigidBody:
    """Hyoid bone that carries some regions of a tongue; it moves freely between its ligaments.

    Parameters
    ----------
    regions : of the tongue.
    geniohyoid : activation of the muscle to the mandible, 25 N; needs a mandible in the scene.
    """
    front, back = (0.112, 0.0, 0.058), (0.130, 0.0, 0.068)
    forces: list[RigidForce] = [
        Spring(back, (0.140, 0.0, 0.125), stiffness=300.0, damping=2.0),  # to the styloid process
        Spring(front, (0.118, 0.0, 0.005), stiffness=300.0, damping=2.0),  # to larynx and sternum
        Spring(back, (0.160, 0.0, 0.065), stiffness=150.0, damping=2.0),  # to the pharynx' wall
        AngularSpring(0.05, 1e-3),
    ]
    if geniohyoid is not None:
        chin = (0.076, 0.0, 0.062)
        muscle = LineMuscle(front, chin, to="mandible", max_force=25.0, activation=geniohyoid)
        forces.append(muscle)
    return RigidBody(
        "hyoid", regions, HYOID_MASS, HYOID_INERTIA, (0.121, 0.0, 0.063), tuple(forces)
    )
