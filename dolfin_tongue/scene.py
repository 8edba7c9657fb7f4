"""A scene: a body and the terms picked for it. Frozen, checked, without any solver."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from dolfin_tongue.arrays import IntArray
from dolfin_tongue.body import Body
from dolfin_tongue.errors import BadScene, listing
from dolfin_tongue.term import EnergyTerm, Support, Term

#: Break points closer than this are one, s.
SAME_TIME = 1e-9


@dataclass(frozen=True)
class Scene:
    """A body with its physics.

    Parameters
    ----------
    body : mesh, regions, density, fibres.
    terms : the physics, each a frozen `Term`; only what is listed is computed.
    supports : kinematic conditions on nodes, e.g. `Attached("base")`.

    Raises
    ------
    UnknownName : a term or support names a muscle or region that the body does not have.
    BadScene : something that is no term, no term at all, or two supports on one node.
    """

    body: Body
    terms: tuple[Term, ...]
    supports: tuple[Support, ...] = ()

    def __post_init__(self) -> None:
        if not isinstance(self.body, Body):
            raise BadScene(f"a scene needs a Body, not {self.body!r}; published_tongue() reads one")
        for name in ("terms", "supports"):
            if not isinstance(getattr(self, name), tuple | list):
                raise BadScene(f"`{name}` must be a tuple, e.g. (ReportTissue(),)")
            object.__setattr__(self, name, tuple(getattr(self, name)))
        if not self.terms:
            raise BadScene("a scene needs at least one term, e.g. ReportTissue()")
        for term in self.terms:
            if not isinstance(term, Term):
                raise BadScene(f"{term!r} is not a term; supports go into `supports`")
            term.check(self.body)
        for support in self.supports:
            if not isinstance(support, Support):
                raise BadScene(f"{support!r} is not a support; terms go into `terms`")
        held = [support.nodes(self.body) for support in self.supports]
        nodes, count = np.unique(np.concatenate([*held, []]).astype(np.int64), return_counts=True)
        if (count > 1).any():
            raise BadScene(
                f"node(s) {nodes[count > 1].tolist()} belong to more than one support; give each "
                "node to one of them"
            )

    @property
    def held_nodes(self) -> IntArray:
        """Sorted numbers of the nodes with prescribed displacement."""
        held = [support.nodes(self.body) for support in self.supports]
        return np.unique(np.concatenate([*held, []]).astype(np.int64))

    @property
    def breakpoints(self) -> tuple[float, ...]:
        """Times (s) at which some term is not smooth, increasing; round-off makes no two of one."""
        times = sorted({t for term in self.terms for t in term.breakpoints})
        pairs = zip(times, [*times[1:], np.inf], strict=False)
        return tuple(time for time, following in pairs if following - time > SAME_TIME)

    @property
    def jumps(self) -> tuple[float, ...]:
        """Those of the break points at which some term jumps."""
        jumps = [t for term in self.terms for t in term.jumps]
        return tuple(t for t in self.breakpoints if any(abs(t - j) <= SAME_TIME for j in jumps))

    def check_volumes(self) -> None:
        """Raise BadScene for cells without a free node: their pressure would be undetermined."""
        free = ~np.isin(self.body.cells, self.held_nodes)
        stuck = np.flatnonzero(~free.any(axis=1))
        if stuck.size:
            raise BadScene(
                f"all nodes of cell(s) {listing(stuck)} are held, so that nothing "
                "determines their pressure; hold fewer nodes or leave these cells out of the body"
            )

    def check_static(self) -> None:
        """Raise BadScene if the supports leave rigid motions free (statics would be singular)."""
        if not any(isinstance(term, EnergyTerm) and term.elastic for term in self.terms):
            raise BadScene(
                "a static problem needs tissue that resists: add a passive law, e.g. ReportTissue()"
            )
        pieces, number = self._pieces()
        for piece in range(number):
            self._check_held(self.held_nodes[pieces[self.held_nodes] == piece], number)

    def _pieces(self) -> tuple[IntArray, int]:
        """Return the connected piece of each node, and how many pieces there are."""
        first = np.repeat(self.body.cells[:, :1], 8, axis=1).ravel()
        pairs = (np.ones(len(first)), (first, self.body.cells.ravel()))
        size = len(self.body.points)
        number, pieces = connected_components(coo_array(pairs, shape=(size, size)), directed=False)
        return pieces, number

    def _check_held(self, nodes: IntArray, pieces: int) -> None:
        held = self.body.points[nodes]
        if len(held) < 3 or np.linalg.matrix_rank(held - held.mean(axis=0), tol=1e-9) < 2:
            raise BadScene(
                f"a static problem needs attachments that hold "
                f"{'the body' if pieces == 1 else 'each of its pieces'}: {len(held)} node(s) are "
                "held, three that do not lie on one line are needed. Add Attached(region) to "
                f"`supports`; regions: {', '.join(sorted(self.body.node_sets)) or '(none)'}"
            )
