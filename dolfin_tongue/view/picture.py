"""One large picture of a deformed body, in the colour of a tongue or of a field."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from dolfin_tongue.base.errors import UnknownName
from dolfin_tongue.body.body import Body
from dolfin_tongue.body.state import State
from dolfin_tongue.view.camera import OBLIQUE, Camera, View
from dolfin_tongue.view.canvas import draw_bars, font, length_bar, save_image, silhouette
from dolfin_tongue.view.fibres import fibre_segments, muscle_colour, see_through
from dolfin_tongue.view.fields import largest_stretch
from dolfin_tongue.view.film import check_states
from dolfin_tongue.view.palette import EDGES, FIELD_EDGES, INK, Pixels
from dolfin_tongue.view.scene3d import OVERSAMPLING, Stage
from dolfin_tongue.view.surroundings import Neighbourhood, Surroundings


@dataclass(frozen=True)
class Scale:
    """How a field becomes colours.

    Parameters
    ----------
    label : name and unit, for the colour bar.
    values : of a body and a state, shape (m,) per cell or (n,) per node.
    colours : a colour map of matplotlib.
    start : value where the map starts, or its middle if it is `diverging`.
    diverging : whether values are above and below `start`.
    """

    label: str
    values: Callable[[Body, State], np.ndarray]
    colours: str
    start: float = 0.0
    diverging: bool = False

    def limits(self, values: np.ndarray) -> tuple[float, float]:
        """Lowest and highest value that has a colour of its own; 1 % of the values are beyond."""
        reach = max(float(np.quantile(np.abs(values - self.start), 0.99)), 1e-12)
        return self.start - reach * self.diverging, self.start + reach

    def paint(self, values: np.ndarray, limits: tuple[float, float]) -> Pixels:
        """Give values (k,) their colours, shape (k, 3)."""
        import matplotlib

        share = (values - limits[0]) / (limits[1] - limits[0])
        return matplotlib.colormaps[self.colours](np.clip(share, 0, 1), bytes=True)[:, :3]


#: Fields that `shape_picture` knows, besides ``"tissue"``.
SCALES = {
    "pressure": Scale(
        "pressure, kPa", lambda _, state: state.pressure / 1e3, "RdBu_r", diverging=True
    ),
    "stretch": Scale(
        "largest principal stretch",
        lambda body, state: largest_stretch(body, state.displacement),
        "YlOrBr",
        start=1.0,
    ),
    "displacement": Scale(
        "displacement, mm",
        lambda _, state: 1e3 * np.linalg.norm(state.displacement, axis=1),
        "YlOrRd",
    ),
    "speed": Scale("speed, m/s", lambda _, state: np.linalg.norm(state.velocity, axis=1), "YlGnBu"),
}


def shape_picture(
    body: Body,
    state: State,
    path: Path | str,
    colour: str = "tissue",
    *,
    muscles: Sequence[str] = (),
    view: View = OBLIQUE,
    width: int = 1200,
    surroundings: Surroundings | None = None,
) -> Path:
    """Draw one deformed shape, large.

    Parameters
    ----------
    body : the body.
    state : of the body.
    path : of the image; its suffix tells the format.
    colour : ``"tissue"``, or a field: ``"pressure"`` and ``"stretch"`` (largest principal stretch),
        constant in each cell as they are computed; ``"displacement"``, ``"speed"``.
    muscles : their fibres are drawn, deformed, in a body that one can look through.
    view : direction of sight; the tip of the tongue is to the left.
    width : pixels.
    surroundings : walls and bones; see `Surroundings.of`.

    Returns
    -------
    Path
        `path`.

    Raises
    ------
    UnknownName : a colour or muscle that there is not.
    ValueError : a state of another body or not finite.
    """
    check_states(body, [state])
    if colour != "tissue" and colour not in SCALES:
        raise UnknownName("colour", colour, ["tissue", *SCALES])
    points = body.points + state.displacement
    near = surroundings.near(body, [state]) if surroundings else Neighbourhood()
    camera = Camera.fitting([points, *near.clouds([state])], OVERSAMPLING * width, view)
    bundles = [
        (
            fibre_segments(body, body.fibres[name], state.displacement),
            muscle_colour(body.fibres.names.index(name), len(body.fibres.names)),
        )
        for name in muscles
    ]
    edges = EDGES if colour == "tissue" else FIELD_EDGES
    with Stage(body, camera, edge_colour=edges, edge_width=2.6, sheets=near.sheets) as stage:
        colours = None if colour == "tissue" else _colours(stage, SCALES[colour], state)
        frame = stage.frame(points, colours, near.shifts(state))
        image = near.draw(Image.fromarray(frame), camera, state).reduce(OVERSAMPLING)
        if bundles:
            alone = stage.frame(points) if near.sheets else frame
            rods = stage.rods(bundles, 4.5 / camera.scale)
            image = see_through(frame, rods, 0.55, silhouette(alone, OVERSAMPLING))
    foot = width // 14
    whole = Image.new("RGB", (image.width, image.height + foot), "white")
    whole.paste(image)
    _draw_legend(whole, body, state, colour, camera, foot)
    return save_image(whole, path)


def _colours(stage: Stage, scale: Scale, state: State) -> Pixels:
    """Colours of a field at the points of the surface."""
    values = scale.values(stage.body, state)
    per_cell = len(values) == stage.body.cell_count
    spread = stage.surface.of_cells if per_cell else stage.surface.of_nodes
    return scale.paint(spread(values[:, None])[:, 0], scale.limits(values))


def _draw_legend(
    image: Image.Image, body: Body, state: State, colour: str, camera: Camera, foot: int
) -> None:
    """Draw the scale bar and the colour bar into the foot of a picture."""
    size, level = foot // 4, image.height - foot // 2
    bar = length_bar(camera.scale / OVERSAMPLING, image.width)
    draw_bars(image, [bar], (2 * size, level), size)
    if colour == "tissue":
        return
    scale = SCALES[colour]
    limits = scale.limits(scale.values(body, state))
    place = (image.width - 2 * size, level)
    draw_colour_bar(image, scale, limits, place, size, image.width // 4)


def draw_colour_bar(
    image: Image.Image,
    scale: Scale,
    limits: tuple[float, float],
    place: tuple[int, int],
    size: int,
    length: int,
) -> None:
    """Draw what the colours of a field mean.

    Parameters
    ----------
    image : is drawn on.
    scale : of the field.
    limits : lowest and highest value.
    place : right end and height of the middle, pixels.
    size : height of the text, pixels.
    length : of the bar without its text, pixels.
    """
    strip = scale.paint(np.linspace(*limits, length), limits)
    draw, (right, level) = ImageDraw.Draw(image), place
    low, high = (f"{limit:.3g}" for limit in limits)
    draw.text((right, level), high, INK, font(size), anchor="rm")
    right -= round(draw.textlength(high, font(size)) + size / 2)
    image.paste(Image.fromarray(np.tile(strip, (size, 1, 1))), (right - length, level - size // 2))
    text = f"{scale.label}   {low}"
    draw.text((right - length - size / 2, level), text, INK, font(size), anchor="rm")
