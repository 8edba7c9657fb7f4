"""A scene: a body and the terms picked for it. Frozen, checked, without any solver."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.base.errors import BadScene, UnknownName, listing
from dolfin_tongue.base.times import among, distinct
from dolfin_tongue.base.values import Parameter, parameters_of, with_parameters
from dolfin_tongue.body.body import Body
from dolfin_tongue.boundary.gravity import Gravity
from dolfin_tongue.boundary.sliding import Sliding
from dolfin_tongue.control import Timed
from dolfin_tongue.rigid.body import RigidBody
from dolfin_tongue.rigid.forces import SKULL, Line
from dolfin_tongue.terms.labels import labels_of, numbered
from dolfin_tongue.terms.support import Held, Support
from dolfin_tongue.terms.term import Term


@dataclass(frozen=True)
class Scene(Timed):
    """A body with its physics.

    Parameters
    ----------
    body : mesh, regions, density, fibres.
    terms : the physics, each a frozen `Term`; only what is listed is computed.
    supports : kinematic conditions on nodes: `Attached("base")`, `Sliding(Plane(), "bottom")`, a
        `RigidBody`, or a class of your own that derives from `Held`.

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
            if not isinstance(support, Held | Sliding | RigidBody):
                raise BadScene(
                    f"no solver knows what {type(support).__name__} does to its nodes; derive it "
                    "from Held (which prescribes displacements), Sliding or RigidBody"
                )
            support.check(self.body)
        self._check_shared()
        self._check_links()
        self._check_parameters()

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

    def _check_parameters(self) -> None:
        """Refuse parameters of one name and several values."""
        known: dict[str, float] = {}
        for parameter in self._all_parameters():
            if known.setdefault(parameter.name, parameter.value) != parameter.value:
                raise BadScene(
                    f"the parameter {parameter.name!r} is {known[parameter.name]:g} in one place "
                    f"and {parameter.value:g} in another; give two numbers two names"
                )

    # -- names -------------------------------------------------------------------------------------

    @property
    def labels(self) -> list[str]:
        """Names of the terms, in tables and memories."""
        return labels_of(self.terms)

    @property
    def parts(self) -> Mapping[str, Timed]:
        """All terms and supports by name."""
        supports = numbered([support.label for support in self.supports])
        return dict(zip(self.labels + supports, (*self.terms, *self.supports), strict=True))

    def _all_parameters(self) -> list[Parameter]:
        parts = (self.body.density, *self.terms)
        return [parameter for part in parts for parameter in parameters_of(part)]

    @property
    def parameters(self) -> dict[str, float]:
        """Named parameters of all terms and of the density, with their values."""
        return {parameter.name: parameter.value for parameter in self._all_parameters()}

    def with_parameters(self, **numbers: float) -> Scene:
        """Return the scene with other numbers for some named parameters; UnknownName lists them."""
        for name in numbers:
            if name not in self.parameters:
                raise UnknownName("parameter", name, self.parameters)
        density = with_parameters(self.body.density, numbers)
        body = self.body if density is self.body.density else replace(self.body, density=density)
        terms = tuple(with_parameters(term, numbers) for term in self.terms)
        return Scene(body, terms, self.supports)

    # -- supports ----------------------------------------------------------------------------------

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
    def moves_supports(self) -> bool:
        """Whether supports may do work: prescribed displacements or coordinates that change."""
        given = any(body.given.any() for body in self.rigid_bodies)
        return given or any(part.moves for part in self.held)

    # -- time --------------------------------------------------------------------------------------

    @property
    def breakpoints(self) -> tuple[float, ...]:
        """Times (s) at which some part is not smooth, increasing; round-off makes no two of one."""
        return distinct(super().breakpoints)

    @property
    def jumps(self) -> tuple[float, ...]:
        """Those of the break points at which some part jumps."""
        jumps = super().jumps
        return tuple(time for time in self.breakpoints if among(time, jumps))
