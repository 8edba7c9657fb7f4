"""Where the tissue touches something, and how hard, seen from above without the palate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.body.body import Body
from dolfin_tongue.body.state import State
from dolfin_tongue.view.camera import ABOVE, View
from dolfin_tongue.view.canvas import milliseconds, save_image, sheet_of
from dolfin_tongue.view.film import Film
from dolfin_tongue.view.palette import FIELD_EDGES, Pixels
from dolfin_tongue.view.picture import Scale, draw_colour_bar
from dolfin_tongue.view.sheet import TILE_WIDTH

#: Tissue that touches nothing: paler than elsewhere, so that colours stand out.
PALE = (240, 190, 182)

#: Share of the highest pressure below which colours fade into that of the tissue.
FADE = 0.04


@dataclass(frozen=True)
class PressureScale(Scale):
    """Colours of a pressure of contact: those of tissue where there is none."""

    def paint(self, values: np.ndarray, limits: tuple[float, float]) -> Pixels:
        """Give values (k,) their colours, shape (k, 3)."""
        import matplotlib

        share = np.clip((values - limits[0]) / (limits[1] - limits[0]), 0, 1)
        colours = 255 * matplotlib.colormaps[self.colours](0.2 + 0.8 * share)[:, :3]
        weight = np.clip(share / FADE, 0, 1)[:, None]
        return np.round(weight * colours + (1 - weight) * PALE).astype(np.uint8)


def contact_picture(
    body: Body,
    states: Sequence[State],
    pressures: Sequence[FloatArray],
    path: Path | str,
    *,
    columns: int = 4,
    title: str = "",
    captions: Sequence[str] | None = None,
    view: View = ABOVE,
    highest: float | None = None,
) -> Path:
    """Draw the pressure of contact on the tissue in several states, with one scale for all.

    The tongue is seen from above, its tip to the left, without what it touches. Pressures are
    interpolated between the nodes.

    Parameters
    ----------
    body : the body.
    states : the frames, in order.
    pressures : one for each state, ndarray of shape (n,), Pa; zero or NaN at nodes that touch
        nothing.
    path : of the image; its suffix tells the format.
    columns : frames in a row, >= 1.
    title : above all frames.
    captions : one for each state, instead of its time and its highest pressure.
    view : direction of sight.
    highest : pressure at the end of the scale, Pa, > 0; default the highest that is found.

    Returns
    -------
    Path
        `path`.

    Raises
    ------
    ValueError : no states, states of another body or not finite, pressures or captions that do not
        fit, columns < 1, highest <= 0.
    """
    if columns < 1:
        raise ValueError(f"columns = {columns}: a picture needs at least one")
    if highest is not None and not highest > 0:
        raise ValueError(f"highest = {highest}: it must be a pressure > 0, Pa")
    maps = _checked(body, states, pressures)
    if captions is not None and len(captions) != len(states):
        raise ValueError(f"{len(captions)} captions for {len(states)} states: give one for each")
    limit = highest or scale_end(maps)
    unit, factor = ("kPa", 1e-3) if limit >= 1e3 else ("Pa", 1.0)
    scale = PressureScale(f"pressure of contact, {unit}", lambda *_: np.zeros(0), "YlGnBu")
    limits = 0.0, factor * limit
    tiles = []
    with Film(
        body, states, TILE_WIDTH, view=view, outline=False, whiskers=False, cuts=8,
        edges=FIELD_EDGES,
    ) as film:  # fmt: skip
        for state, values in zip(states, maps, strict=True):
            at_points = film.surface.of_nodes(factor * values[:, None])[:, 0]
            tiles.append(film.draw(state, scale.paint(at_points, limits)))
        bars = film.bars
    texts = captions or [_caption(s, v) for s, v in zip(states, maps, strict=True)]
    sheet = sheet_of(tiles, texts, columns, title, bars, least=2 * TILE_WIDTH)
    size = TILE_WIDTH // 20
    place = (sheet.width - 2 * size, round(sheet.height - 1.4 * size))
    draw_colour_bar(sheet, scale, limits, place, size, TILE_WIDTH // 2)
    return save_image(sheet, path)


def scale_end(maps: Sequence[FloatArray]) -> float:
    """Pressure at the end of a scale for these maps, Pa; 1 kPa where nothing is touched."""
    highest = float(max(values.max() for values in maps))
    return highest if highest > 0 else 1e3


def _caption(state: State, pressure: FloatArray) -> str:
    """Time and highest pressure in words."""
    highest = pressure.max()
    if not highest > 0:
        return f"{milliseconds(state.time)}: no contact"
    text = f"{1e-3 * highest:.3g} kPa" if highest >= 1e3 else f"{highest:.3g} Pa"
    return f"{milliseconds(state.time)}: up to {text}"


def _checked(
    body: Body, states: Sequence[State], pressures: Sequence[FloatArray]
) -> list[FloatArray]:
    """Pressures without NaN; ValueError if they do not fit."""
    if len(pressures) != len(states):
        raise ValueError(f"{len(pressures)} pressure maps for {len(states)} states: one for each")
    maps = [np.asarray(values, dtype=float) for values in pressures]
    for number, values in enumerate(maps):
        if values.shape != (len(body.points),):
            raise ValueError(
                f"pressure map {number} has the shape {values.shape}, but {body.name} has "
                f"{len(body.points)} nodes: it must be ({len(body.points)},), Pa"
            )
    return [np.nan_to_num(values, nan=0.0, posinf=0.0, neginf=0.0) for values in maps]
