"""Constitutive terms: passive, viscous and active stress, incompressibility."""

from dolfin_tongue.constitutive.active import (
    SPECIFIC_TENSION,
    ActiveMuscles,
    ConstantFibreStress,
    StressMobilisation,
)
from dolfin_tongue.constitutive.passive import FibreReinforcedTissue, MooneyRivlin, ReportTissue
from dolfin_tongue.constitutive.viscous import Viscosity

__all__ = [
    "SPECIFIC_TENSION",
    "ActiveMuscles",
    "ConstantFibreStress",
    "FibreReinforcedTissue",
    "MooneyRivlin",
    "ReportTissue",
    "StressMobilisation",
    "Viscosity",
]
