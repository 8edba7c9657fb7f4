"""What the direct solver is asked: elements, terms, supports; from a scene or by hand."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.body.fibres import Fibres
from dolfin_tongue.boundary.attached import Attached
from dolfin_tongue.direct.mesh import Mesh, mesh_of
from dolfin_tongue.rigid.body import RigidBody
from dolfin_tongue.scene.scene import Scene
from dolfin_tongue.surfaces.base import Surface
from dolfin_tongue.terms.term import Term

#: Supports that stand still at zero displacement: their motion need not be asked for.
STANDING = (Attached,)


@dataclass(frozen=True, eq=False)
class Problem:
    """What the direct solver is asked to solve; `problem_of` makes it from a scene.

    Parameters
    ----------
    mesh : elements of any kinds.
    terms : the physics.
    density : kg/m3.
    fibres : muscles, with cells numbered as in the mesh.
    held : nodes with prescribed displacement, increasing.
    support : time, s -> displacement of the held nodes, shape (len(held), 3), m; None: they stand
        still.
    breakpoints, jumps : times at which the motion is not smooth, or jumps, s.
    surfaces : named surfaces, as corners of faces of shape (k, 4); -1 in those of triangles.
    sliding : surfaces with the numbers of the nodes that slide on them.
    rigid_bodies : rigid bodies with the numbers of the nodes attached to them.
    gravity : on rigid bodies (that on tissue is a term), m/s2, shape (3,).
    """

    mesh: Mesh
    terms: tuple[Term, ...]
    density: float
    fibres: Fibres = field(default_factory=Fibres)
    held: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    support: Callable[[float], FloatArray] | None = None
    breakpoints: tuple[float, ...] = ()
    jumps: tuple[float, ...] = ()
    surfaces: Mapping[str, IntArray] = field(default_factory=dict)
    sliding: tuple[tuple[Surface, IntArray], ...] = ()
    rigid_bodies: tuple[tuple[RigidBody, IntArray], ...] = ()
    gravity: FloatArray = field(default_factory=lambda: np.zeros(3))


def problem_of(scene: Scene) -> Problem:
    """Problem of a scene: the same body, terms and supports."""
    scene.check_volumes()
    body = scene.body
    held = np.unique(np.concatenate([*(part.nodes(body) for part in scene.held), []]))
    held = held.astype(np.int64)
    parts = [(part, part.nodes(body)) for part in scene.held if type(part) not in STANDING]

    def support(time: float) -> FloatArray:
        value = np.zeros(body.points.shape)
        for part, nodes in parts:
            value[nodes] = part.displacement(body.points[nodes], time)
        return value[held]

    return Problem(
        mesh_of(body), scene.terms, body.density, body.fibres, held,
        support if parts else None, scene.breakpoints, scene.jumps, body.surfaces,
        tuple((part.surface, part.nodes(body)) for part in scene.sliding),
        tuple((part, part.nodes(body)) for part in scene.rigid_bodies), scene.gravity,
    )  # fmt: skip
