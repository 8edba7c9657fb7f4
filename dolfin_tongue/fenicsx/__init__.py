"""The FEniCSx solver: UFL forms of the terms, DOLFINx spaces, PETSc SNES and TS.

Reading order: `pairs`, `numbering` (our numbers of the unknowns), `domains` (DOLFINx meshes of
cells and faces), `fields` (coefficients), `block` (residual and tangent of a domain's terms) -
`coupling`, `contact`, `sliding`, `rigid` (what no form states) - `system` (the semi-discrete
equations, no dt) - `newton`, `statics`, `ts_stepper`, `generalised_alpha` - `audit`, `points`,
`observation` (what is asked about a state).
"""

from dolfin_tongue.fenicsx.generalised_alpha import GeneralisedAlpha
from dolfin_tongue.fenicsx.statics import Statics
from dolfin_tongue.fenicsx.system import System
from dolfin_tongue.fenicsx.tolerances import STATIC_TOLERANCES, Tolerances

__all__ = ["STATIC_TOLERANCES", "GeneralisedAlpha", "Statics", "System", "Tolerances"]
