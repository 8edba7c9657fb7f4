"""Rigid motions that nothing in a static scene resists: its equations would be singular.

To first order, at rest: the unknowns are translation and rotation of every connected piece of the
tissue and the coordinates of the rigid bodies. Supports give rows that are zero for a motion that
they allow. What may resist by its stiffness (springs, muscles, contact, curved surfaces, weights
that turn) gives rows too: whether it does, only the equations can tell. So what is found is loose
for certain.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.boundary.contact import Contact
from dolfin_tongue.rigid import plane
from dolfin_tongue.rigid.forces import AngularSpring, Line, PointForce, Spring, StateForce

if TYPE_CHECKING:  # a scene asks this module
    from dolfin_tongue.rigid.body import RigidBody
    from dolfin_tongue.scene.scene import Scene

#: Singular value below which a motion counts as not resisted; rows are of size 1.
FREE = 1e-7


def loose_parts(scene: Scene, pieces: IntArray) -> list[str]:
    """Names of what moves in rigid motions that nothing resists; empty if there are none.

    Parameters
    ----------
    scene : a static one.
    pieces : ndarray, shape (n,) -- connected piece of each node.
    """
    rows = _Rows(scene, pieces)
    _, size, motions = np.linalg.svd(rows.matrix)
    free = motions[int((size > FREE).sum()) :]
    moved = np.abs(free).max(axis=0, initial=0.0) > 1e-6
    tissue = moved[: rows.bodies].reshape(-1, 6).any(axis=1)
    names = ["the body"] if len(tissue) == 1 else [f"piece {i}" for i in range(len(tissue))]
    found = [name for name, loose in zip(names, tissue, strict=True) if loose]
    loose = moved[rows.bodies :].reshape(-1, 3).any(axis=1)
    return found + [b.name for b, loose in zip(scene.rigid_bodies, loose, strict=True) if loose]


class _Rows:
    """Rows over the unknowns, six for each piece (rotations times a length) and three per body."""

    def __init__(self, scene: Scene, pieces: IntArray):
        self.scene, self.pieces = scene, pieces
        points = scene.body.points
        self.middle, self.length = points.mean(axis=0), float(np.ptp(points, axis=0).max())
        self.bodies = 6 * (int(pieces.max()) + 1)
        self.size = self.bodies + 3 * len(scene.rigid_bodies)
        #: Turns the angle of a body into a length.
        self.unit = np.array([1.0, 1.0, 1.0 / self.length])
        self._rows: list[FloatArray] = [np.zeros((1, self.size))]
        self._add_supports()
        for number, body in enumerate(scene.rigid_bodies):
            self._add_forces(body, self.bodies + 3 * number)

    @property
    def matrix(self) -> FloatArray:
        """All rows."""
        return np.concatenate(self._rows)

    def tissue(self, nodes: IntArray) -> FloatArray:
        """Displacement of nodes by the motion of their pieces, shape (k, 3, unknowns)."""
        table = np.zeros((len(nodes), 3, self.size))
        arms = (self.scene.body.points[nodes] - self.middle) / self.length
        for row, (piece, arm) in enumerate(zip(self.pieces[nodes], arms, strict=True)):
            table[row, :, 6 * piece : 6 * piece + 3] = np.eye(3)
            table[row, :, 6 * piece + 3 : 6 * piece + 6] = np.cross(np.eye(3), arm).T
        return table

    def bone(self, name: str, place: FloatArray) -> FloatArray:
        """Displacement of a place by the motion of a rigid body, shape (3, unknowns)."""
        table = np.zeros((3, self.size))
        for number, body in enumerate(self.scene.rigid_bodies):
            if body.name == name:
                at = self.bodies + 3 * number
                jacobian = plane.jacobian(body.arms(place), np.zeros(3))[0]
                table[:, at : at + 3] = jacobian * self.unit
        return table

    def _add(self, rows: FloatArray) -> None:
        self._rows.append(rows.reshape(-1, self.size))

    def _add_supports(self) -> None:
        scene = self.scene
        body, weighs = scene.body, scene.gravity.any()
        for held in scene.held:
            self._add(self.tissue(held.nodes(body)))
        for sliding in scene.sliding:
            nodes = sliding.nodes(body)
            moves, places = self.tissue(nodes), body.points[nodes]
            normal = sliding.surface.gradient(places)
            normal /= np.linalg.norm(normal, axis=1, keepdims=True)
            self._add(np.einsum("ki,kiu->ku", normal, moves))
            self._add(self.length * sliding.surface.gap(places).curvature @ moves)
        for term in scene.terms:
            if isinstance(term, Contact):
                self._add(self.tissue(np.unique(body.surface(term.surface))))
        if weighs:  # a rotation about the vertical lifts nothing
            up = scene.gravity / np.linalg.norm(scene.gravity)
            for piece in range(self.bodies // 6):
                turns = np.zeros((3, self.size))
                turns[:, 6 * piece + 3 : 6 * piece + 6] = np.eye(3) - np.outer(up, up)
                self._add(turns)

    def _add_forces(self, body: RigidBody, at: int) -> None:
        nodes = body.nodes(self.scene.body)
        carried = [self.bone(body.name, place) for place in self.scene.body.points[nodes]]
        self._add(self.tissue(nodes) - np.reshape(carried, (-1, 3, self.size)))
        resisted = body.given.copy()
        resisted[2] |= bool(self.scene.gravity.any())
        for force in body.forces:
            resisted[2] |= isinstance(force, AngularSpring | PointForce)
            resisted |= isinstance(force, StateForce)
            if isinstance(force, Line) and not (isinstance(force, Spring) and not force.stiffness):
                far = self.bone(force.to, np.asarray(force.anchor, dtype=float))
                self._add(self.bone(body.name, np.asarray(force.point, dtype=float)) - far)
        self._add(np.eye(self.size)[at : at + 3][resisted])
