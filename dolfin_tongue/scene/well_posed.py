"""What a solver must find in a scene: pressures that are determined, motions that are resisted.

Rigid motions that nothing in a static scene resists make its equations singular. To first order, at
rest: the unknowns are translation and rotation of every connected piece of the tissue and the
coordinates of the rigid bodies. Supports give rows that are zero for a motion that they allow. What
may resist by its stiffness (springs, muscles, contact, curved surfaces, weights that turn) gives
rows too: whether it does, only the equations can tell. So what is found is loose for certain.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.base.errors import BadScene, listing
from dolfin_tongue.body.body import Body
from dolfin_tongue.body.faces import corners_of
from dolfin_tongue.boundary.contact import Contact
from dolfin_tongue.rigid import RigidBody, plane
from dolfin_tongue.rigid.forces import Line
from dolfin_tongue.scene.scene import Scene
from dolfin_tongue.terms.term import EnergyTerm

#: Singular value below which a motion counts as not resisted; rows are of size 1.
FREE = 1e-7


def check_pressures(scene: Scene) -> None:
    """Raise BadScene for cells without a free node: their pressure would be undetermined."""
    held = scene.held_nodes
    stuck = [
        np.flatnonzero(np.isin(block.cells, held).all(axis=1)) + block.numbers.start
        for block in scene.body.blocks
    ]
    found = np.concatenate(stuck)
    if found.size:
        raise BadScene(
            f"all nodes of cell(s) {listing(found)} are held, so that nothing "
            "determines their pressure; hold fewer nodes or leave these cells out of the body"
        )


def check_static(scene: Scene) -> None:
    """Raise BadScene if the supports leave rigid motions free (statics would be singular)."""
    if not any(isinstance(term, EnergyTerm) and term.elastic for term in scene.terms):
        raise BadScene(
            "a static problem needs tissue that resists: add a passive law, e.g. ReportTissue()"
        )
    pieces, number = pieces_of(scene.body)
    free = [body for body in scene.rigid_bodies if not body.given.all()]
    loose = [part.nodes(scene.body) for part in (*scene.sliding, *free)]
    held = scene.held_nodes
    for piece in range(number):
        if any((pieces[nodes] == piece).any() for nodes in loose):
            continue  # see loose_parts
        _check_held(scene.body, held[pieces[held] == piece], number)
    if loose and (found := loose_parts(scene, pieces)):
        raise BadScene(
            f"a static problem needs supports that hold everything: nothing resists a rigid "
            f"motion of {' with '.join(found)}. Add Attached(region), a spring to the skull, "
            "or Still() as the motion of a coordinate; or run the scene in time"
        )


def pieces_of(body: Body) -> tuple[IntArray, int]:
    """Return the connected piece of each node, shape (n,), and how many pieces there are."""
    first = [np.repeat(b.cells[:, 0], b.cells.shape[1]) for b in body.blocks]
    rows = np.concatenate(first)
    columns = np.concatenate([block.cells.ravel() for block in body.blocks])
    size = len(body.points)
    links = coo_array((np.ones(len(rows)), (rows, columns)), shape=(size, size))
    number, pieces = connected_components(links, directed=False)
    return pieces, number


def _check_held(body: Body, nodes: IntArray, pieces: int) -> None:
    held = body.points[nodes]
    if len(held) < 3 or np.linalg.matrix_rank(held - held.mean(axis=0), tol=1e-9) < 2:
        raise BadScene(
            f"a static problem needs attachments that hold "
            f"{'the body' if pieces == 1 else 'each of its pieces'}: {len(held)} node(s) are "
            "held, three that do not lie on one line are needed. Add Attached(region) to "
            f"`supports`; regions: {', '.join(sorted(body.node_sets)) or '(none)'}"
        )


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
                self._add(self.tissue(np.unique(corners_of(body.surface(term.surface)))))
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
            resisted |= force.resists
            if isinstance(force, Line) and force.stiff:
                far = self.bone(force.to, np.asarray(force.anchor, dtype=float))
                self._add(self.bone(body.name, np.asarray(force.point, dtype=float)) - far)
        self._add(np.eye(self.size)[at : at + 3][resisted])
