"""What couples to the forms of a scene: sliding, contact, rigid bodies."""

from dolfin_tongue.coupling.base import Arguments, Coupling, Shifts
from dolfin_tongue.coupling.contact import ContactSurface
from dolfin_tongue.coupling.rigid import RigidBodies
from dolfin_tongue.coupling.sliding import SlidingNodes

__all__ = ["Arguments", "ContactSurface", "Coupling", "RigidBodies", "Shifts", "SlidingNodes"]
