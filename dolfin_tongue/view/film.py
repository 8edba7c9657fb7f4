"""Frames of one body from one camera: the deformed surface, velocity lines, the shape at rest."""

from __future__ import annotations

from collections.abc import Sequence
from types import TracebackType

import numpy as np
from PIL import Image, ImageDraw

from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.base.errors import listing
from dolfin_tongue.body.body import Body
from dolfin_tongue.body.state import State
from dolfin_tongue.view.camera import SIDE, Camera, View
from dolfin_tongue.view.canvas import Bar, length_bar, nice_below, silhouette
from dolfin_tongue.view.palette import EDGES, FAINT, INK, WHISKER, WHITE, Colour, Pixels
from dolfin_tongue.view.scene3d import OVERSAMPLING, Stage
from dolfin_tongue.view.skin import Skin
from dolfin_tongue.view.surroundings import Neighbourhood, Surroundings

#: Length of the velocity line of a fast node over the length of the body.
WHISKER_SHARE = 0.14


def check_states(body: Body, states: Sequence[State]) -> None:
    """Raise ValueError if there is nothing to draw, or a state that is not one of this body."""
    if not states:
        raise ValueError("there are no states to draw: pass at least one")
    shape = body.points.shape
    for number, state in enumerate(states):
        for name in ("displacement", "velocity"):
            values = getattr(state, name)
            if np.shape(values) != shape:
                raise ValueError(
                    f"state {number} (t = {state.time:.6g} s): {name} has the shape "
                    f"{np.shape(values)}, but {body.name} has points of shape {shape}"
                )
            bad = np.flatnonzero(~np.isfinite(values).all(axis=1))
            if bad.size:
                raise ValueError(
                    f"state {number} (t = {state.time:.6g} s): {name} is not finite at node(s) "
                    f"{listing(map(int, bad))}; draw the states before it"
                )


def whisker_time(body: Body, states: Sequence[State]) -> float:
    """Time by which velocities are multiplied to be drawn as lines, s; 0 if nothing moves."""
    # The fastest 5 % of the nodes of a frame may have longer lines.
    fast = max(np.quantile(np.linalg.norm(s.velocity, axis=1), 0.95) for s in states)
    return float(WHISKER_SHARE * np.ptp(body.points, axis=0).max() / fast) if fast > 1e-9 else 0.0


class Film:
    """Draws states of a body as small pictures of equal size and camera; a context manager.

    Parameters
    ----------
    body : the body.
    states : all that will be drawn: the camera has room for them.
    width : of the pictures, pixels.
    view : direction of sight.
    fixed : regions whose nodes are marked where they are seen.
    outline : whether the outline of the body at rest is drawn, faintly.
    whiskers : whether velocities of the nodes are drawn as lines.
    surroundings : walls and bones, if there are any.
    cuts : see `Skin`.
    edges : colour of the element edges, 0-255.
    """

    def __init__(
        self,
        body: Body,
        states: Sequence[State],
        width: int,
        *,
        view: View = SIDE,
        fixed: Sequence[str] = (),
        outline: bool = True,
        whiskers: bool = True,
        surroundings: Surroundings | None = None,
        cuts: int = 3,
        edges: Colour = EDGES,
    ):
        check_states(body, states)
        self.body = body
        self.fixed: IntArray = np.unique(np.concatenate([[], *map(body.nodes, fixed)]).astype(int))
        self.surface = Skin(body, cuts)
        self.stretch = whisker_time(body, states) if whiskers else 0.0
        clouds = [body.points] if outline else []
        for state in states:
            moved = body.points + state.displacement
            clouds += [moved, (moved + self.stretch * state.velocity)[self.surface.nodes]]
        self.near = surroundings.near(body, states) if surroundings else Neighbourhood()
        clouds += self.near.clouds(states)
        self.camera = Camera.fitting(clouds, OVERSAMPLING * width, view, margin=0.04)
        self.stage = Stage(
            body, self.camera, surface=self.surface, edge_colour=edges, sheets=self.near.sheets
        )
        self._outline: Image.Image | None = None
        if outline:
            mask = silhouette(self.stage.frame(body.points), OVERSAMPLING)
            self._outline = mask.point(lambda value: value * 3 // 5)

    def __enter__(self) -> Film:
        """Return the film itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Free the stage."""
        self.stage.__exit__(kind, error, traceback)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the pictures, pixels."""
        return self.camera.size[0] // OVERSAMPLING, self.camera.size[1] // OVERSAMPLING

    @property
    def bars(self) -> list[Bar]:
        """Scales of length and, if velocities are drawn, of velocity, in pixels of the pictures."""
        scale = self.camera.scale / OVERSAMPLING
        bars = [length_bar(scale, self.size[0])]
        if self.stretch:
            longest = WHISKER_SHARE * np.ptp(self.body.points, axis=0).max()
            speed = nice_below(longest / self.stretch)
            bars.append(Bar(f"{speed:g} m/s", speed * self.stretch * scale, WHISKER))
        return bars

    def draw(self, state: State, colours: Pixels | None = None) -> Image.Image:
        """Draw one state.

        Parameters
        ----------
        state : of the body.
        colours : ndarray, shape (points of the surface, 3) -- see `Skin.of_cells`.
        """
        points = self.body.points + state.displacement
        image = Image.fromarray(self.stage.frame(points, colours, self.near.shifts(state)))
        if self._outline is not None:
            image.paste(FAINT, mask=self._outline)
        image = self.near.draw(image, self.camera, state)
        draw = ImageDraw.Draw(image)
        seen = np.zeros(len(points), dtype=bool)
        nodes = self.surface.nodes
        seen[nodes] = self.stage.visible(points[nodes])
        self._mark(draw, points[self.fixed[seen[self.fixed]]])
        if self.stretch:
            self._whiskers(draw, points[seen], self.stretch * state.velocity[seen])
        return image.reduce(OVERSAMPLING)

    def _mark(self, draw: ImageDraw.ImageDraw, points: FloatArray) -> None:
        """Mark fixed nodes by squares."""
        half = max(2 * OVERSAMPLING, 0.0045 * self.camera.size[0])
        for x, y in self.camera.project(points):
            draw.rectangle((x - half, y - half, x + half, y + half), fill=INK, outline=WHITE)

    def _whiskers(self, draw: ImageDraw.ImageDraw, points: FloatArray, lines: FloatArray) -> None:
        """Draw lines (k, 3), m, from points of the same shape, if they are long enough to see."""
        starts, ends = self.camera.project(points), self.camera.project(points + lines)
        long = np.linalg.norm(ends - starts, axis=1) > 1.5 * OVERSAMPLING
        dot, width = 1.1 * OVERSAMPLING, max(2, self.camera.size[0] // 320)
        for (x, y), end in zip(starts[long], ends[long], strict=True):
            draw.line([(x, y), tuple(end)], WHISKER, width)
            draw.ellipse((x - dot, y - dot, x + dot, y + dot), WHISKER)
