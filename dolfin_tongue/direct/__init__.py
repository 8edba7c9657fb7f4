"""The report's own method, written a second time: no UFL, no basix, no DOLFINx in here.

`Direct(scene, method).march(end)` takes the same `Scene` as `solve.dynamics.Dynamics` and yields
the same `State` objects. Both solvers discretise the same equations (consistent mass, 2x2x2 points,
one volume constraint per cell), so that forces, constraints and tangents agree to round-off; they
share the dataclasses of the terms, of which only numbers are read here.

Reading order: `elements` (shape functions, kappa) - `mesh` - `volume` (96), (101) - `tensors`,
`isochoric`, `passive`, `rates` (stress and moduli at points) - `points` (element loops) - `faces`,
`membranes` (47), `contacts` (58) - `forces` (which term has which law) - `problem`, `model` (the
semi-discrete equations, no dt), with `slides` (49)-(52) and `bodies` (61), (62) - `multipliers`
(53)-(57) - `limits`, `impacts` (what contact may do in a step), `integrate` (explicit methods) -
`saddle`, `border`, `implicit` - `balance`, `trouble`.

Conventions
-----------
n points, m cells of one kind with k nodes and q quadrature points; SI units.

- points, displacement U, velocity V, nodal forces: (n, 3).
- cells: (m, k); F, its rate and the first Piola-Kirchhoff stress P: (m, q, 3, 3), index i in space,
  J in the reference body; moduli dP_iJ/dF_kL: (m, q, 9, 9).
- element matrices: (m, 3k, 3k), ordered by component, then node.
- with rigid bodies, nodal arrays inside the solver have rows for them too, (N, 3): `bodies`; with
  sliding nodes, constraints and multipliers (c,) have theirs behind those of the cells: `slides`.
- pressure: (m,), Pa, positive in compression: the multiplier of V' = Gamma (F + lambda dA/dU).
  P holds -p J F^-T, whose nodal force is +p dA/dU.

Choosing a method
-----------------
- `Implicit`: TR-BDF2, order 2 in displacement, velocity and pressure, any viscosity or stiffness;
  the one for production. `Implicit(corrections=1)` is its linearly implicit form.
- `Adaptive`: an explicit pair with tight error control, for references.
- `RungeKutta4`: the report's, fixed step, order 4, refused beyond its stability limit.
- With contact: `Implicit` (impacts inelastic); `RungeKutta4(cut=True)` or `Adaptive` resolve the
  elastic rebound, with steps of some microseconds.
"""

from dolfin_tongue.direct.balance import drift, momentum
from dolfin_tongue.direct.elements import KINDS
from dolfin_tongue.direct.integrate import Adaptive, Direct, RungeKutta4
from dolfin_tongue.direct.mesh import Mesh
from dolfin_tongue.direct.model import Model
from dolfin_tongue.direct.problem import Problem, problem_of
from dolfin_tongue.direct.tr_bdf2 import Implicit

__all__ = [
    "KINDS",
    "Adaptive",
    "Direct",
    "Implicit",
    "Mesh",
    "Model",
    "Problem",
    "RungeKutta4",
    "drift",
    "momentum",
    "problem_of",
]
