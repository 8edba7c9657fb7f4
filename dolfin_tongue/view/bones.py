"""Rigid bodies as diagrams in the midsagittal plane, drawn over rendered frames.

A bone is the hull of the nodes attached to it and of its centre of mass, with an arm to the pivot;
springs are zigzags, line muscles red lines, darker the more they are active.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from PIL import Image, ImageDraw
from scipy.ndimage import maximum_filter
from scipy.spatial import ConvexHull, QhullError

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.body.body import Body
from dolfin_tongue.body.state import State
from dolfin_tongue.control import Instant
from dolfin_tongue.rigid import SKULL, LineMuscle, RigidBody, plane
from dolfin_tongue.rigid.forces import Line
from dolfin_tongue.view.camera import Camera
from dolfin_tongue.view.palette import BONE, BONE_EDGE, IDLE, MUSCLE, SPRING, WHITE, Colour

#: Opacity of a bone, 0-255.
OPACITY = 150


class Skeleton:
    """Rigid bodies of a scene, their springs and muscles.

    Parameters
    ----------
    body : the tissue.
    bones : in the order of `State.rigid`.
    """

    def __init__(self, body: Body, bones: Sequence[RigidBody]):
        self.bones = tuple(bones)
        self._nodes = [bone.nodes(body) for bone in bones]
        self._attached = [body.points[nodes] for nodes in self._nodes]
        self._middle = float(body.points[:, 1].min() + body.points[:, 1].max()) / 2
        self._hulls = [
            self._flat(hull(np.vstack([points, bone.centre])))
            for bone, points in zip(self.bones, self._attached, strict=True)
        ]

    def _flat(self, points: FloatArray) -> FloatArray:
        """Points moved sideways into the midsagittal plane."""
        points = np.array(points, dtype=float)
        points[..., 1] = self._middle
        return points

    def coordinates(self, state: State) -> FloatArray:
        """Coordinates (m, m, rad) of each bone, shape (b, 3).

        A state read from a file may not have them; then they follow from the attached nodes.
        """
        if len(state.rigid) == len(self.bones):
            return np.asarray(state.rigid)
        groups = zip(self.bones, self._nodes, self._attached, strict=True)
        return np.array(
            [
                best_fit(bone.arms(points), state.displacement[nodes])
                if len(nodes)
                else bone.prescribed(state.time)[0]
                for bone, nodes, points in groups
            ]
        )

    def moved(self, name: str, points: FloatArray, q: FloatArray) -> FloatArray:
        """Places of points (k, 3), m, of a bone, or of the skull, which stays."""
        points = np.atleast_2d(points)
        for number, bone in enumerate(self.bones):
            if bone.name == name:
                return points + plane.displacement(bone.arms(points), q[number])
        return points

    def lines(self, state: State) -> list[tuple[Line, Instant, FloatArray]]:
        """Springs and muscles, each at its own instant and with its ends, shape (2, 3), m."""
        q, now = self.coordinates(state), Instant(state.time, state.memory)
        found = []
        for bone in self.bones:
            for name, force in bone.named_forces:
                if isinstance(force, Line):
                    ends = [
                        self.moved(bone.name, np.asarray(force.point), q),
                        self.moved(force.to, np.asarray(force.anchor), q),
                    ]
                    found.append((force, now.of(bone.label).of(name), np.vstack(ends)))
        return found

    def outlines(self, state: State) -> list[tuple[RigidBody, FloatArray, FloatArray, FloatArray]]:
        """Bones with their hull (k, 3), centre of mass (3,) and reference point (3,), m."""
        q = self.coordinates(state)
        result = []
        for bone, outline in zip(self.bones, self._hulls, strict=True):
            marks = self._flat(np.array([bone.centre, bone.reference]))
            centre, pivot = self.moved(bone.name, marks, q)
            result.append((bone, self.moved(bone.name, outline, q), centre, pivot))
        return result

    def cloud(self, state: State) -> FloatArray:
        """Return all points that are drawn, shape (k, 3), m."""
        parts = [ends for _, _, ends in self.lines(state)]
        for _, outline, centre, pivot in self.outlines(state):
            parts += [outline, centre[None], pivot[None]]
        return np.concatenate(parts)

    def draw(self, image: Image.Image, camera: Camera, state: State) -> Image.Image:
        """Draw the bones over a frame; return the picture."""
        pen = camera.size[0] / 520
        for _, outline, centre, pivot in self.outlines(state):
            path = camera.project(outline)
            arm = camera.project(np.stack([centre, pivot]))
            image = _bone(image, path, arm, pen)
        draw = ImageDraw.Draw(image)
        for force, now, ends in self.lines(state):
            _line(draw, force, camera.project(ends), _colour_of(force, now), pen)
        for bone, _, centre, pivot in self.outlines(state):
            places = camera.project(np.stack([centre, pivot]))
            if bone.pivot is not None:
                _hinge(draw, places[1], pen)
            _mass(draw, places[0], pen)
        return image


def best_fit(arms: FloatArray, displacement: FloatArray) -> FloatArray:
    """Coordinates (x, z, angle) of the motion nearest to the displacements (k, 3), m."""
    moved = arms + displacement
    (ax, _, az), (px, _, pz) = (arms - arms.mean(axis=0)).T, (moved - moved.mean(axis=0)).T
    angle = np.arctan2(px @ az - pz @ ax, px @ ax + pz @ az)
    way = moved.mean(axis=0) - plane.turned(arms.mean(axis=0)[None], angle)[0]
    return np.array([way[0], way[2], angle])


def hull(points: FloatArray) -> FloatArray:
    """Corners of the convex hull of points (k, 3) in the plane of x and z, in order round it."""
    try:
        return points[ConvexHull(points[:, ::2]).vertices]
    except QhullError:  # points on a line: its ends
        arm = points[:, ::2] - points[0, ::2]
        along = arm @ arm[np.argmax((arm**2).sum(axis=1))]
        return points[[along.argmin(), along.argmax()]]


def _bone(image: Image.Image, outline: FloatArray, arm: FloatArray, pen: float) -> Image.Image:
    """Lay a translucent shape with a dark edge over a picture, rounded by a few pixels."""
    inside = Image.new("L", image.size)
    draw = ImageDraw.Draw(inside)
    corners = [tuple(corner) for corner in outline]
    if len(corners) > 2:
        draw.polygon(corners, fill=255)
    _stroke(draw, [*corners, corners[0]], 255, 14 * pen)
    _stroke(draw, [tuple(end) for end in arm], 255, 7 * pen)
    rim = round(1.4 * pen)
    left, upper, right, lower = inside.getbbox() or (0, 0, 0, 0)
    box = (max(left - rim, 0), max(upper - rim, 0), right + rim, lower + rim)
    solid = np.asarray(inside.crop(box))
    edge = maximum_filter(solid, 2 * rim + 1) - solid  # Pillow's own filter is 20 times slower
    image.paste(BONE, box, Image.fromarray((solid // 255) * np.uint8(OPACITY)))
    image.paste(BONE_EDGE, box, Image.fromarray(edge))
    return image


def _stroke(
    draw: ImageDraw.ImageDraw, points: Sequence[tuple], fill: int | tuple, width: float
) -> None:
    """Draw a line with round corners and ends."""
    draw.line(points, fill, max(1, round(width)))
    if width > 3:
        for x, y in points:
            half = width / 2
            draw.ellipse((x - half, y - half, x + half, y + half), fill)


def _colour_of(force: Line, now: Instant) -> tuple[Colour, float]:
    """Colour of a spring or muscle, and its width over that of a pen."""
    if not isinstance(force, LineMuscle):
        return SPRING, 2.0
    share = force.level(now) ** 0.5
    red, green, blue = (round(a + share * (b - a)) for a, b in zip(IDLE, MUSCLE, strict=True))
    return (red, green, blue), 3.0 + 2.0 * share


def _line(
    draw: ImageDraw.ImageDraw,
    force: Line,
    ends: FloatArray,
    look: tuple[Colour, float],
    pen: float,
) -> None:
    """Draw a spring or muscle with its ends (2, 2), pixels; the far end on the skull is square."""
    colour, width = look[0], look[1] * pen
    path = ends if isinstance(force, LineMuscle) else zigzag(ends, 4.5 * pen, 5.0 * pen)
    corners = [tuple(corner) for corner in path]
    _stroke(draw, corners, WHITE, width + 2 * pen)
    _stroke(draw, corners, colour, width)
    for (x, y), square in zip(
        corners[:: len(corners) - 1], (False, force.to == SKULL), strict=True
    ):
        half = max(2.5 * pen, 0.7 * width)
        shape = draw.rectangle if square else draw.ellipse
        shape((x - half, y - half, x + half, y + half), colour, WHITE)


def zigzag(ends: FloatArray, height: float, pitch: float) -> FloatArray:
    """Return the path of a spring between two ends (2, 2): straight, then to and fro."""
    way = ends[1] - ends[0]
    length = max(float(np.linalg.norm(way)), 1e-9)
    turns = int(np.clip(0.6 * length / pitch, 2, 24))
    share = np.concatenate([[0.0, 0.2], 0.2 + 0.6 * (np.arange(turns) + 0.5) / turns, [0.8, 1.0]])
    aside = np.zeros(len(share))
    aside[2:-2] = height * np.where(np.arange(turns) % 2, -1.0, 1.0)
    across = np.array([-way[1], way[0]]) / length
    return ends[0] + share[:, None] * way + aside[:, None] * across


def _hinge(draw: ImageDraw.ImageDraw, place: FloatArray, pen: float) -> None:
    """Draw a joint: a ring with a dot."""
    (x, y), outer, dot = place, 6.5 * pen, 2.2 * pen
    box = (x - outer, y - outer, x + outer, y + outer)
    draw.ellipse(box, WHITE, BONE_EDGE, max(1, round(1.8 * pen)))
    draw.ellipse((x - dot, y - dot, x + dot, y + dot), BONE_EDGE)


def _mass(draw: ImageDraw.ImageDraw, place: FloatArray, pen: float) -> None:
    """Draw a centre of mass: a disc with quarters of two colours."""
    (x, y), half = place, 5.5 * pen
    box = (x - half, y - half, x + half, y + half)
    draw.ellipse(box, WHITE, BONE_EDGE, max(1, round(pen)))
    for start in (0, 180):
        draw.pieslice(box, start, start + 90, BONE_EDGE)
