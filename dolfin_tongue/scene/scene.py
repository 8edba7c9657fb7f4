"""A scene: a body and the terms picked for it. Frozen, checked, without any solver."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.base.errors import BadScene, UnknownName, listing
from dolfin_tongue.body.body import Body
from dolfin_tongue.boundary.gravity import Gravity
from dolfin_tongue.boundary.sliding import Sliding
from dolfin_tongue.rigid.body import RigidBody
from dolfin_tongue.rigid.forces import SKULL, Line
from dolfin_tongue.scene.well_posed import loose_parts
from dolfin_tongue.terms.term import EnergyTerm, Held, Support, Term

#: Break points closer than this are one, s.
SAME_TIME = 1e-9


@dataclass(frozen=True)
class Scene:
    """A body with its physics.

    Parameters
    ----------
    body : mesh, regions, density, fibres.
    terms : the physics, each a frozen `Term`; only what is listed is computed.
    supports : kinematic conditions on nodes: `Attached("base")`, `Sliding(Plane(), "bottom")`, a
        `RigidBody`.

    Raises
    ------
    UnknownName : a term or support names a muscle or region that the body does not have.
    BadScene : something that is no term, no term at all, two supports on one node, or a link to a
        rigid body that is not there.
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
            support.check(self.body)
        self._check_shared()
        self._check_links()

    def _check_shared(self) -> None:
        """Refuse nodes of two supports, by the names of both."""
        owner: dict[int, Support] = {}
        shared: dict[tuple[str, str], list[int]] = {}
        for support in self.supports:
            for node in map(int, support.nodes(self.body)):
                if node in owner:
                    shared.setdefault((owner[node].label, support.label), []).append(node)
                owner[node] = support
        for (first, second), nodes in shared.items():
            raise BadScene(
                f"node(s) {listing(nodes)} belong to both {first} and {second}; give each node to "
                "one support"
            )

    def _check_links(self) -> None:
        """Refuse rigid bodies of one name, and lines to bodies that are not there."""
        names = [body.name for body in self.rigid_bodies]
        if len(set(names)) < len(names):
            raise BadScene(f"rigid bodies need different names, not {', '.join(names)}")
        for body in self.rigid_bodies:
            for force in body.forces:
                if isinstance(force, Line) and force.to not in (SKULL, *names):
                    raise UnknownName("rigid body", force.to, (*names, SKULL))
                if isinstance(force, Line) and force.to == body.name:
                    raise BadScene(f"{body.name}: a {type(force).__name__} leads to itself")

    @property
    def rigid_bodies(self) -> tuple[RigidBody, ...]:
        """Those of the supports, in their order."""
        return tuple(part for part in self.supports if isinstance(part, RigidBody))

    @property
    def sliding(self) -> tuple[Sliding, ...]:
        """Those of the supports, in their order."""
        return tuple(part for part in self.supports if isinstance(part, Sliding))

    @property
    def held(self) -> tuple[Held, ...]:
        """Supports that prescribe displacements, in their order."""
        return tuple(part for part in self.supports if isinstance(part, Held))

    @property
    def gravity(self) -> FloatArray:
        """Acceleration by all `Gravity` terms, shape (3,), m/s2; rigid bodies feel it too."""
        parts = [np.asarray(t.acceleration) for t in self.terms if isinstance(t, Gravity)]
        return np.sum([np.zeros(3), *parts], axis=0)

    @property
    def held_nodes(self) -> IntArray:
        """Sorted numbers of the nodes that move with a support or rigid body."""
        held = [part.nodes(self.body) for part in (*self.held, *self.rigid_bodies)]
        return np.unique(np.concatenate([*held, []]).astype(np.int64))

    @property
    def breakpoints(self) -> tuple[float, ...]:
        """Times (s) at which some part is not smooth, increasing; round-off makes no two of one."""
        every = [part.breakpoints for part in self.terms]
        every += [part.breakpoints for part in self.supports]
        times = sorted({t for part in every for t in part})
        pairs = zip(times, [*times[1:], np.inf], strict=False)
        return tuple(time for time, following in pairs if following - time > SAME_TIME)

    @property
    def jumps(self) -> tuple[float, ...]:
        """Those of the break points at which some term jumps."""
        every = [part.jumps for part in self.terms] + [part.jumps for part in self.supports]
        jumps = [t for part in every for t in part]
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
        loose = [part.nodes(self.body) for part in (*self.sliding, *self._free_bodies)]
        for piece in range(number):
            if any((pieces[nodes] == piece).any() for nodes in loose):
                continue  # see loose_parts
            self._check_held(self.held_nodes[pieces[self.held_nodes] == piece], number)
        if loose and (found := loose_parts(self, pieces)):
            raise BadScene(
                f"a static problem needs supports that hold everything: nothing resists a rigid "
                f"motion of {' with '.join(found)}. Add Attached(region), a spring to the skull, "
                "or Still() as the motion of a coordinate; or run the scene in time"
            )

    @property
    def _free_bodies(self) -> tuple[RigidBody, ...]:
        return tuple(body for body in self.rigid_bodies if not body.given.all())

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
