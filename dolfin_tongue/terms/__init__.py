"""What a term and a support are, and what they are given: for laws of your own."""

from dolfin_tongue.terms.mobilisation import StressMobilisation
from dolfin_tongue.terms.support import Held, Support
from dolfin_tongue.terms.term import EnergyTerm, FormTerm, StressTerm, SurfaceTerm, Term

__all__ = [
    "EnergyTerm",
    "FormTerm",
    "Held",
    "StressMobilisation",
    "StressTerm",
    "Support",
    "SurfaceTerm",
    "Term",
]
