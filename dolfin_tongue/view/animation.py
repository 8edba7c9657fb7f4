"""Moving pictures."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from dolfin_tongue.base.errors import OutOfRange
from dolfin_tongue.base.files import replacing
from dolfin_tongue.body.body import Body
from dolfin_tongue.body.state import State
from dolfin_tongue.view.canvas import draw_bars, font, milliseconds
from dolfin_tongue.view.film import Film
from dolfin_tongue.view.palette import FAINT, INK, WHISKER, WHITE, Colour
from dolfin_tongue.view.surroundings import Surroundings

#: Width of the animation, pixels.
WIDTH = 480
#: Colours of the palette, which all frames share, without those of walls and bones.
COLOURS = 56


def animation(
    body: Body,
    states: Sequence[State],
    path: Path | str,
    fps: float = 25,
    *,
    fixed: Sequence[str] = (),
    outline: bool = True,
    surroundings: Surroundings | None = None,
) -> Path:
    """Write a GIF of a movement, seen as in `contact_sheet`, which repeats for ever.

    Parameters
    ----------
    body : the body.
    states : one per frame, in order. If their times are 1/fps apart, it plays in real time.
    path : of the GIF.
    fps : frames per second, in (0, 50]. The format rounds a frame's duration to 10 ms.
    fixed : regions whose nodes are marked.
    outline : whether the outline of the body at rest is drawn, faintly.
    surroundings : walls and bones; see `Surroundings.of`.

    Returns
    -------
    Path
        `path`.

    Raises
    ------
    OutOfRange : fps outside (0, 50]; viewers slow down what is faster.
    ValueError : no states, states of another body or not finite.
    """
    if not 0 < fps <= 50:
        raise OutOfRange("fps", fps, "in (0, 50]", "1/s")
    with Film(body, states, WIDTH, fixed=fixed, outline=outline, surroundings=surroundings) as film:
        samples = [_picture(film, states[k]) for k in _samples(len(states))]
        palette = _palette(samples, film.near.inks)
        frames = (
            _picture(film, s).quantize(palette=palette, dither=Image.Dither.NONE) for s in states
        )
        _write(frames, Path(path), 1.0 / fps)
    return Path(path)


def _write(frames: Iterator[Image.Image], path: Path, duration: float) -> None:
    """Write frames as they come, each for a duration in s."""
    with replacing(path) as temporary:
        next(frames).save(
            temporary,
            format="GIF",
            save_all=True,
            append_images=frames,
            duration=round(100 * duration) * 10,
            loop=0,
            optimize=False,  # it would look for unused colours frame by frame
        )


def _samples(count: int) -> list[int]:
    """About six frames, first and last included, from which the palette is made."""
    return np.unique(np.linspace(0, count - 1, 6).round().astype(int)).tolist()


def _palette(pictures: Sequence[Image.Image], inks: Sequence[Colour]) -> Image.Image:
    """Palette for all frames: one of its own for each would make still parts flicker.

    `inks` are colours of lines that it has to have.
    """
    together = np.concatenate([np.asarray(picture) for picture in pictures])
    # Lines, and the greys of their soft edges, have too few pixels to get colours by themselves.
    kept = (WHITE, INK, FAINT, WHISKER, (196, 196, 202), (150, 150, 158), *inks)
    shades = Image.fromarray(together).quantize(COLOURS + len(inks) - len(kept)).getpalette() or []
    palette = Image.new("P", (1, 1))
    palette.putpalette([value for colour in kept for value in colour] + shades)
    return palette


def _picture(film: Film, state: State) -> Image.Image:
    """One frame with time and scales."""
    picture = film.draw(state)
    size = picture.width // 26
    # A margin above and below, so that the text does not touch the body.
    image = Image.new("RGB", (picture.width, picture.height + 4 * size), "white")
    image.paste(picture, (0, 2 * size))
    text = milliseconds(state.time)
    place = (image.width - size, size)
    ImageDraw.Draw(image).text(place, text, INK, font(size), anchor="rm")
    draw_bars(image, film.bars, (size, image.height - size), size)
    return image
