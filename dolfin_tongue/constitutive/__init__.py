"""Constitutive terms: passive, viscous and active stress."""

from dolfin_tongue.body.fibres import SPECIFIC_TENSION
from dolfin_tongue.constitutive.active import ActiveMuscles, ConstantFibreStress
from dolfin_tongue.constitutive.fibre_stress import FibreStress
from dolfin_tongue.constitutive.passive import FibreReinforcedTissue, MooneyRivlin, ReportTissue
from dolfin_tongue.constitutive.viscous import Viscosity
from dolfin_tongue.terms.mobilisation import StressMobilisation

__all__ = [
    "SPECIFIC_TENSION",
    "ActiveMuscles",
    "ConstantFibreStress",
    "FibreReinforcedTissue",
    "FibreStress",
    "MooneyRivlin",
    "ReportTissue",
    "StressMobilisation",
    "Viscosity",
]
