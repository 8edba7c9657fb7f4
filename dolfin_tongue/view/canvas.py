"""What is drawn over and around rendered frames: text, scale bars, sheets of tiles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFilter, ImageFont

from dolfin_tongue.base.files import replacing
from dolfin_tongue.view.palette import INK, WHITE, Pixels

#: What the short names of muscles in published models stand for.
ABBREVIATIONS = {
    "GGA": "genioglossus anterior",
    "GGM": "genioglossus medius",
    "GGP": "genioglossus posterior",
    "GH": "geniohyoid",
    "HG": "hyoglossus",
    "IL": "inferior longitudinal",
    "MH": "mylohyoid",
    "SL": "superior longitudinal",
    "STY": "styloglossus",
    "TRANS": "transversus",
    "VERT": "verticalis",
}


def save_image(image: Image.Image, path: Path | str) -> Path:
    """Write an image, whole or not at all; return its path."""
    path = Path(path)
    with replacing(path) as temporary:
        image.save(temporary)
    return path


@cache
def font(size: int, bold: bool = False) -> ImageFont.FreeTypeFont:
    """Load DejaVu Sans, which comes with matplotlib; size in pixels."""
    from matplotlib import font_manager

    properties = font_manager.FontProperties(
        family="DejaVu Sans", weight="bold" if bold else "normal"
    )
    return ImageFont.truetype(font_manager.findfont(properties), size)


def spoken(name: str) -> str:
    """Name for a person: genioglossus_posterior, or GGP_L, becomes genioglossus posterior (L)."""
    stem, _, side = name.partition("_")
    if stem in ABBREVIATIONS:
        return ABBREVIATIONS[stem] + (f" ({side})" if side else "")
    return name.replace("_", " ")


def milliseconds(time: float) -> str:
    """Time in s as text, e.g. ``"40 ms"``."""
    return f"{1e3 * time:.5g} ms"


def nice_below(value: float) -> float:
    """Largest of 1, 2, 5 times a power of ten that is not above `value` > 0."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(step * power for step in (1, 2, 5) if step * power <= value * (1 + 1e-9)))


def silhouette(frame: Pixels, width: int) -> Image.Image:
    """Outline of what is not white in a frame, as a mask of that many pixels' width."""
    body = Image.fromarray(np.where((frame < 250).any(axis=2), 255, 0).astype(np.uint8))
    inner = body.filter(ImageFilter.MinFilter(2 * width + 1))
    return Image.fromarray(np.asarray(body) - np.asarray(inner))


@dataclass(frozen=True)
class Bar:
    """A line of known length for a legend.

    Parameters
    ----------
    label : e.g. ``"10 mm"``.
    length : pixels.
    colour : 0-255.
    """

    label: str
    length: float
    colour: tuple[int, int, int] = INK


def length_bar(scale: float, width: int) -> Bar:
    """Build a scale bar of a round length, at most a fifth of the picture.

    Parameters
    ----------
    scale : pixels per metre.
    width : of the picture, pixels.
    """
    length = nice_below(width / scale / 5)
    return Bar(f"{1e3 * length:g} mm", length * scale)


def draw_bars(
    image: Image.Image, bars: Sequence[Bar], corner: tuple[float, float], size: int
) -> None:
    """Draw bars with their labels side by side.

    Parameters
    ----------
    image : is drawn on.
    bars : from left to right.
    corner : left end of the first bar and height of all, pixels.
    size : height of the text, pixels.
    """
    draw = ImageDraw.Draw(image)
    left, level = corner
    for bar in bars:
        draw.line([(left, level), (left + bar.length, level)], bar.colour, max(2, size // 7))
        if bar.colour == INK:  # a length has ends, a velocity has none
            for end in (left, left + bar.length):
                draw.line([(end, level - size / 4), (end, level + size / 4)], INK, 1)
        left += bar.length + 0.6 * size
        draw.text((left, level), bar.label, bar.colour, font(size), anchor="lm")
        left += draw.textlength(bar.label, font(size)) + 2 * size


def sheet_of(
    tiles: Sequence[Image.Image],
    captions: Sequence[str],
    columns: int,
    title: str = "",
    bars: Sequence[Bar] = (),
    least: int = 0,
) -> Image.Image:
    """Arrange tiles of equal size in rows, with captions under them.

    Parameters
    ----------
    tiles, captions : of equal number, at least one.
    columns : tiles in a row; fewer if there are fewer.
    title : above all; none if empty.
    bars : scales for the foot of the sheet.
    least : width of the sheet, pixels.
    """
    width, height = tiles[0].size
    columns = min(columns, len(tiles))
    rows = -(-len(tiles) // columns)
    size = min(max(13, width // 20), 24)
    gap, foot = size, round(1.9 * size)
    top = gap + (round(2.4 * size) if title else 0)
    sheet = Image.new(
        "RGB",
        (
            max(columns * (width + gap) + gap, least),
            top + rows * (height + foot) + (round(2.4 * size) if bars else gap // 2),
        ),
        WHITE,
    )
    draw = ImageDraw.Draw(sheet)
    if title:
        draw.text((2 * gap, gap), title, INK, font(round(1.35 * size), bold=True))
    for number, (tile, caption) in enumerate(zip(tiles, captions, strict=True)):
        row, column = divmod(number, columns)
        left, upper = gap + column * (width + gap), top + row * (height + foot)
        sheet.paste(tile, (left, upper))
        place = (left + width / 2, upper + height + foot / 3)
        draw.text(place, caption, INK, font(size), anchor="mm")
    draw_bars(sheet, bars, (2 * gap, sheet.height - 1.4 * size), size)
    return sheet
