"""Coefficients and measures that terms borrow from the FEniCSx side (see `term.Fields`)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import ufl
from dolfinx import fem

from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.fenicsx.mesh import MixedSpace, cell_function, set_cell_values


class CellFields:
    """What terms borrow (see `term.Fields`): cell-wise coefficients, and measures of surfaces.

    Coefficients that vary follow the time.
    """

    def __init__(self, space: MixedSpace):
        self.body = space.body
        self._space = space
        # One list for all measures: a form takes its facets from a single place.
        self._facets: list[tuple[int, IntArray]] = []
        self._surfaces: dict[str, ufl.Measure] = {}
        self._varying: list[tuple[fem.Function, Callable[[float], FloatArray]]] = []
        self._time = np.nan

    def on_cells(self, values: FloatArray) -> fem.Function:
        """Coefficient with constant values of shape (m,) or (m, k), in the body's order."""
        components = values.shape[1] if values.ndim > 1 else 1
        function = cell_function(self._space.mesh, components)
        set_cell_values(function, values, self._space.parents)
        return function

    def varying_on_cells(self, values: Callable[[float], FloatArray]) -> fem.Function:
        """Coefficient whose values are evaluated at each new time."""
        function = self.on_cells(values(0.0))
        self._varying.append((function, values))
        self._time = np.nan
        return function

    def surface(self, name: str) -> ufl.Measure:
        """Measure of a named surface; its facets are looked for when it is first asked for."""
        if name not in self._surfaces:
            number = len(self._facets) + 1
            facets = self._space.facets(self.body.surface(name))
            self._facets.append((number, facets.astype(np.int32).ravel()))
            self._surfaces[name] = ufl.Measure(
                "ds", self._space.mesh, subdomain_id=number, subdomain_data=self._facets,
                metadata={"quadrature_degree": self._space.pair.quadrature_degree},
            )  # fmt: skip
        return self._surfaces[name]

    def set_time(self, time: float) -> None:
        """Evaluate the varying coefficients at a time, s."""
        if time != self._time:
            for function, values in self._varying:
                set_cell_values(function, values(time), self._space.parents)
            self._time = time
