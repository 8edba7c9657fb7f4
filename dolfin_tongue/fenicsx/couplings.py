"""Which parts a scene has besides its forms."""

from __future__ import annotations

from dolfin_tongue.base.errors import BadScene
from dolfin_tongue.boundary.contact import Contact
from dolfin_tongue.fenicsx.contact import ContactSurface
from dolfin_tongue.fenicsx.coupling import Coupling
from dolfin_tongue.fenicsx.numbering import Numbering
from dolfin_tongue.fenicsx.rigid import RigidBodies
from dolfin_tongue.fenicsx.sliding import SlidingNodes
from dolfin_tongue.scene.scene import Scene
from dolfin_tongue.terms.labels import labels_of
from dolfin_tongue.terms.term import FormTerm


def couplings_of(scene: Scene, numbering: Numbering) -> list[Coupling]:
    """Contacts, sliding nodes, then rigid bodies, their unknowns numbered behind the others.

    Raises
    ------
    BadScene : a term that is neither stated by a form nor known here.
    """
    contacts = [term for term in scene.terms if isinstance(term, Contact)]
    for term in scene.terms:
        if not isinstance(term, FormTerm | Contact):
            raise BadScene(
                f"the FEniCSx solver has no form for the term {type(term).__name__}; derive it "
                "from StressTerm, EnergyTerm, SurfaceTerm or FormTerm"
            )
    named = zip(contacts, labels_of(contacts), strict=True)
    couplings: list[Coupling] = [ContactSurface(term, numbering, name) for term, name in named]
    size = numbering.size
    for support in scene.sliding:
        couplings.append(SlidingNodes(support, numbering, size))
        size += couplings[-1].count
    if scene.rigid_bodies:
        couplings.append(RigidBodies(scene, numbering, size))
    return couplings
