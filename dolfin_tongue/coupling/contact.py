"""Contact in the mixed system: tractions at the quadrature points of a surface (58)-(60).

The traction of a law without rates, a barrier, is stated for the *end* of a step. Its energy is
convex, so that over a step the change of that energy is at most the work done against the traction:
a step that jumps into the barrier loses energy and never gains any, whatever its size. Stated at
the stage, an impact that dt does not resolve would throw the body back with energy of its own. The
price is order 1 in the traction while it changes; the report's own law (60) is inelastic too.
A rated law is stated at the stage, like all rates.
"""

from __future__ import annotations

import basix
import numpy as np
import scipy.sparse as sp

from dolfin_tongue.arrays import FloatArray
from dolfin_tongue.boundary.contact import Contact
from dolfin_tongue.coupling.base import Arguments, Coupling, Shifts, Sparse
from dolfin_tongue.mesh import MixedSpace
from dolfin_tongue.surfaces.base import Gap

#: Gap, in ranges of the barrier, to which a touching point may go in one step. At 1.25 no step of
#: 18 drops at 0.1 to 2 m/s raised the energy; at 1.5 and 2 some did, by 0.2 % of the first one.
LEAP = 1.25


class ContactSurface(Coupling):
    """One `Contact`.

    Attributes
    ----------
    points : reference positions of the quadrature points, shape (q, 3), m.
    weights : reference area of each, shape (q,), m2.
    """

    def __init__(self, term: Contact, space: MixedSpace, label: str):
        self.term, self.label = term, label
        values, dofs, self.points, self.weights = surface_points(space, term.surface)
        used, columns = np.unique(dofs[..., 0], return_inverse=True)
        order = np.argsort(space.all_displacement_dofs[:, 0])
        first = order[np.searchsorted(space.all_displacement_dofs[:, 0], used, sorter=order)]
        #: The displacement dofs of the surface, shape (k, 3).
        self.dofs = space.all_displacement_dofs[first]
        count = len(self.points)
        rows = np.repeat(np.arange(count), values.shape[-1])
        place = (rows, columns.reshape(dofs.shape[:2])[:, None].repeat(values.shape[1], 1).ravel())
        #: From nodal values to values at the points, shape (q, k).
        self.shapes = sp.coo_array((values.ravel(), place), shape=(count, len(used))).tocsr()
        self.transposed = self.shapes.T.tocsr()

    # -- state at the points -------------------------------------------------------------------

    def gap(self, time: float, y: FloatArray) -> Gap:
        """Gap of the points at a displacement."""
        x = self.points + self.shapes @ y[self.dofs] - self.term.shift(time)[0]
        return self.term.obstacle.gap(x)

    def _approach(self, time: float, rate: FloatArray) -> FloatArray:
        """Velocity of the points relative to the obstacle, shape (q, 3), m/s."""
        return self.shapes @ rate[self.dofs] - self.term.shift(time)[1]

    def traction(
        self, at: Arguments
    ) -> tuple[Gap, FloatArray, FloatArray, FloatArray | float, FloatArray]:
        """Gap, traction, Pa, its slopes by gap and rate, and the relative velocity."""
        law = self.term.law
        if not law.rated:
            gap = self.gap(at.time_end, at.end)
            return (gap, *law.traction(gap.distance, None), np.zeros((0, 3)))
        gap, velocity = self.gap(at.time, at.state), self._approach(at.time, at.rate)
        rate = (gap.normal * velocity).sum(axis=1)
        return (gap, *law.traction(gap.distance, rate), velocity)

    # -- residual and tangent ------------------------------------------------------------------

    def add_residual(self, at: Arguments, out: FloatArray) -> None:
        """-int t n.w dA in rows of u, N."""
        gap, traction, *_ = self.traction(at)
        if traction.any():
            push = (self.weights * traction)[:, None] * gap.normal
            out[self.dofs] -= self.transposed @ push

    def with_tangent(
        self, matrix: Sparse, at: Arguments, shifts: Shifts, rows: FloatArray
    ) -> Sparse:
        """Add the derivatives by the displacement of the stage or of the end, and by the rate."""
        gap, traction, by_gap, by_rate, velocity = self.traction(at)
        touching = np.flatnonzero(traction != 0)
        if not touching.size:
            return matrix
        n, H = gap.normal[touching], gap.curvature[touching]
        weight = -self.weights[touching][:, None, None]
        outer = n[:, :, None] * n[:, None, :]
        block = by_gap[touching][:, None, None] * outer + traction[touching][:, None, None] * H
        if self.term.law.rated:
            slope = np.asarray(by_rate)[touching][:, None, None]
            turning = np.einsum("qi,qjk,qk->qij", n, H, velocity[touching])
            block = block + slope * (turning + shifts.rate * outer)
        else:
            block = shifts.end * block
        return matrix + self._spread(touching, weight * block, matrix.shape[0])

    def _spread(self, touching: FloatArray, blocks: FloatArray, size: int) -> Sparse:
        """Sum over points of N_K N_L times a block, as a matrix of mixed arrays."""
        shapes = self.shapes[touching]
        total = sp.csr_array((size, size))
        for i in range(3):
            for j in range(3):
                part = (shapes.T @ (sp.diags_array(blocks[:, i, j]) @ shapes)).tocoo()
                place = (self.dofs[part.coords[0], i], self.dofs[part.coords[1], j])
                total = total + sp.coo_array((part.data, place), shape=(size, size)).tocsr()
        return total

    # -- what is watched -----------------------------------------------------------------------

    def refusal(self, time: float, y: FloatArray, before: FloatArray | None = None) -> str:
        """Name a point that has come through, or one that has left the barrier at one bound.

        The method of time stepping remembers the acceleration of a touching point for a step; a
        long step would turn it into a leap.
        """
        gap, law = self.gap(time, y).distance, self.term.law
        if not gap.min() > 0:
            return f"penetration of {-gap.min():.2g} m at {self.label}"
        if law.rated or before is None or not (gap > LEAP * law.range).any():
            return ""
        touching = self.gap(time, before).distance < law.range
        leaps = touching & (gap > LEAP * law.range)
        return f"a leap off the obstacle at {self.label}" if leaps.any() else ""

    def energies(self, at: Arguments) -> dict[str, float]:
        """Energy of a law that has one."""
        if self.term.law.rated:
            return {}
        energy = self.term.law.energy(self.gap(at.time, at.state).distance)
        return {self.label: float(self.weights @ energy)}

    def powers(self, at: Arguments) -> dict[str, float]:
        """Power of a rated law, and of an obstacle that moves."""
        if not self.term.law.rated and self.term.motion is None:
            return {}
        gap, traction, *_ = self.traction(at)
        push = (self.weights * traction)[:, None] * gap.normal
        if self.term.law.rated:
            return {self.label: float(np.sum(push * (self.shapes @ at.rate[self.dofs])))}
        return {f"{self.label}_motion": float(push.sum(axis=0) @ self.term.shift(at.time)[1])}

    def observed(self, at: Arguments) -> dict[str, float]:
        """Area in contact, resultant on the tissue, largest pressure, smallest gap."""
        gap, traction, *_ = self.traction(at)
        force = ((self.weights * traction)[:, None] * gap.normal).sum(axis=0)
        names = (f"{self.label}_force_{axis}_N" for axis in "xyz")
        return {
            f"{self.label}_area_m2": float(self.weights[gap.distance < self.term.law.range].sum()),
            **{name: float(value) for name, value in zip(names, force, strict=True)},
            f"{self.label}_pressure_Pa": float(traction.max()),
            f"{self.label}_gap_m": float(gap.distance.min()),
        }


def surface_points(
    space: MixedSpace, surface: str
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Quadrature points on a surface of the reference body.

    Returns
    -------
    values : ndarray, shape (f, q, k) -- shape functions of the displacement at the points.
    dofs : ndarray, shape (f, k, 3) -- their dofs.
    points : ndarray, shape (f q, 3), m.
    weights : ndarray, shape (f q,), m2.
    """
    cell = basix.CellType[space.pair.shape]
    facets = space.facets(space.body.surface(surface))
    facet_type = basix.cell.subentity_types(cell)[2][0]
    rule, rule_weights = map(
        np.asarray, basix.make_quadrature(facet_type, space.pair.quadrature_degree)
    )
    corners, topology = np.asarray(basix.geometry(cell)), basix.topology(cell)[2]
    element = space.displacement_element
    linear = basix.create_element(basix.ElementFamily.P, cell, 1)
    values, dofs, points, weights = [], [], [], []
    for local, vertices in enumerate(topology):
        cells = facets[facets[:, 1] == local, 0]
        if not len(cells):
            continue
        origin = corners[vertices[0]]
        axes = corners[vertices[1:3]] - origin
        master = origin + rule @ axes
        closure = element.entity_closure_dofs[2][local]
        table = np.asarray(element.tabulate(0, master))[0, :, :, 0]
        flat = np.asarray(linear.tabulate(1, master))[:, :, :, 0]
        x = space.mesh.geometry.x[space.mesh.geometry.dofmap[cells]]
        tangents = np.einsum("ai,iqk,fkc->fqac", axes, flat[1:], x)
        area = np.linalg.norm(np.cross(tangents[:, :, 0], tangents[:, :, 1]), axis=-1)
        values.append(np.broadcast_to(table[:, closure], (len(cells), len(rule), len(closure))))
        dofs.append(space.cell_displacement_dofs(cells)[:, closure])
        points.append(np.einsum("qk,fkc->fqc", flat[0], x).reshape(-1, 3))
        weights.append((area * rule_weights).ravel())
    return (
        np.concatenate(values), np.concatenate(dofs), np.concatenate(points),
        np.concatenate(weights),
    )  # fmt: skip
