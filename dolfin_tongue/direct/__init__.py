"""The report's own method, written a second time: no UFL, no basix, no DOLFINx in here.

`TrBdf2(dt).solver(scene).march(end)` takes the same `Scene` as the FEniCSx solver and yields the
same `State` objects. Both solvers discretise the same equations (consistent mass, 2x2x2 points, one
volume constraint per cell), so that forces, constraints and tangents agree to round-off; they share
the dataclasses of the terms, of which only numbers are read here, and the table of cells.

Reading order: `volume` (96), (101) - `tensors`, `isochoric`, `passive`, `rates` (stress and moduli
at points) - `points` (element loops) - `parts`, `tissue`, `membranes` (47), `contacts` (58) -
`choice` (which term has which part) - `constraints` (49)-(53), `bodies` (61), (62), `numbering`,
`mass` (40), `model` (the semi-discrete equations, no dt) - `multipliers` (53)-(57) - `limits`,
`impacts` (what contact may do in a step), `runge_kutta4`, `adaptive` - `saddle`, `border`, `stage`,
`tr_bdf2` - `solver`, `balance`.

Conventions
-----------
n points, m cells of one kind with k nodes and q quadrature points; SI units.

- points, displacement U, velocity V, nodal forces: (n, 3).
- cells: (m, k); F, its rate and the first Piola-Kirchhoff stress P: (m, q, 3, 3), index i in space,
  J in the reference body; moduli dP_iJ/dF_kL: (m, q, 9, 9).
- element matrices: (m, 3k, 3k), ordered by component, then node.
- with rigid bodies, nodal arrays inside the solver have rows for them too, (N, 3): `bodies`; with
  sliding nodes, constraints and multipliers (c,) have theirs behind those of the cells.
- pressure: (m,), Pa, positive in compression: the multiplier of V' = Gamma (F + lambda dA/dU).
  P holds -p J F^-T, whose nodal force is +p dA/dU.

Choosing a method
-----------------
- `TrBdf2`: order 2 in displacement, velocity and pressure, any viscosity or stiffness; the one for
  production. `TrBdf2(corrections=1)` is its linearly implicit form.
- `Adaptive`: an explicit pair with tight error control, for references.
- `RungeKutta4`: the report's, fixed step, order 4, refused beyond its stability limit.
- With contact: `TrBdf2` (impacts inelastic); `RungeKutta4(cut=True)` or `Adaptive` resolve the
  elastic rebound, with steps of some microseconds.
"""

from dolfin_tongue.direct.adaptive import Adaptive
from dolfin_tongue.direct.balance import drift, momentum
from dolfin_tongue.direct.model import Model
from dolfin_tongue.direct.runge_kutta4 import RungeKutta4
from dolfin_tongue.direct.solver import DirectSolver
from dolfin_tongue.direct.tr_bdf2 import TrBdf2

__all__ = [
    "Adaptive",
    "DirectSolver",
    "Model",
    "RungeKutta4",
    "TrBdf2",
    "drift",
    "momentum",
]
