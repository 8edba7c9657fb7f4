"""What couples to the forms of a scene: sliding, contact, rigid bodies."""

from dolfin_tongue.fenicsx.couplings.base import Arguments, Coupling, Shifts
from dolfin_tongue.fenicsx.couplings.contact import ContactSurface
from dolfin_tongue.fenicsx.couplings.rigid import RigidBodies
from dolfin_tongue.fenicsx.couplings.sliding import SlidingNodes

__all__ = ["Arguments", "ContactSurface", "Coupling", "RigidBodies", "Shifts", "SlidingNodes"]
