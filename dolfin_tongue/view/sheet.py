"""Sheets of pictures: frames of a movement, final shapes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from dolfin_tongue.body.body import Body
from dolfin_tongue.body.state import State
from dolfin_tongue.view.canvas import milliseconds, save_image, sheet_of, spoken
from dolfin_tongue.view.film import Film
from dolfin_tongue.view.surroundings import Surroundings

#: Width of one picture in a sheet, pixels.
TILE_WIDTH = 320


def contact_sheet(
    body: Body,
    states: Sequence[State],
    path: Path | str,
    *,
    columns: int = 5,
    title: str = "",
    captions: Sequence[str] | None = None,
    fixed: Sequence[str] = (),
    outline: bool = True,
    surroundings: Surroundings | None = None,
) -> Path:
    """Draw frames of a movement in the manner of the report's figures 27-31.

    The tongue is seen nearly from the side, its tip to the left; velocities of the nodes are short
    lines, the time stands under each frame. All frames have the same camera and scales.

    Parameters
    ----------
    body : the body.
    states : the frames, in order.
    path : of the image; its suffix tells the format.
    columns : frames in a row, >= 1.
    title : above all frames.
    captions : one for each state, instead of its time.
    fixed : regions whose nodes are marked.
    outline : whether the outline of the body at rest is drawn, faintly.
    surroundings : walls and bones; see `Surroundings.of`.

    Returns
    -------
    Path
        `path`.

    Raises
    ------
    ValueError : no states, states of another body or not finite, captions of another number,
        columns < 1.
    """
    if columns < 1:
        raise ValueError(f"columns = {columns}: a sheet needs at least one")
    if captions is not None and len(captions) != len(states):
        raise ValueError(f"{len(captions)} captions for {len(states)} states: give one for each")
    with Film(
        body, states, TILE_WIDTH, fixed=fixed, outline=outline, surroundings=surroundings
    ) as film:
        tiles = [film.draw(state) for state in states]
        bars = film.bars
    texts = captions or [milliseconds(state.time) for state in states]
    return save_image(sheet_of(tiles, texts, columns, title, bars), path)


def key_frames(states: Sequence[State], count: int) -> list[State]:
    """Choose frames for a sheet: more of them where the body moves, fewer where it rests.

    Parameters
    ----------
    states : in order of time.
    count : how many to choose, or all if there are fewer; >= 2. The first and the last are chosen.

    Returns
    -------
    list of State
        Evenly apart in the sum of time and way (root mean square over the nodes), each as a share
        of its whole.
    """
    if len(states) <= count:
        return list(states)
    time = np.diff([state.time for state in states])
    steps = np.diff([state.displacement for state in states], axis=0)
    way = np.sqrt((steps**2).sum(axis=2).mean(axis=1))
    share = time / max(time.sum(), 1e-30) + way / max(way.sum(), 1e-30)
    progress = np.concatenate([[0.0], np.cumsum(share)])
    goals = np.linspace(0.0, progress[-1], count)
    nearest = np.abs(progress[:, None] - goals).argmin(axis=0)
    # No state twice, and enough states left for the goals that remain.
    place = np.arange(count)
    chosen = np.maximum.accumulate(nearest - place) + place
    chosen = np.minimum(chosen, len(states) - count + place)
    return [states[number] for number in chosen]


def final_shapes(
    body: Body,
    named_states: Mapping[str, State],
    path: Path | str,
    *,
    columns: int = 4,
    title: str = "",
    fixed: Sequence[str] = (),
    surroundings: Surroundings | None = None,
) -> Path:
    """Draw one shape per name over the faint outline of the body at rest.

    Parameters
    ----------
    body : the body.
    named_states : name, e.g. of the muscle that was active -> its last state.
    path, columns, title, fixed, surroundings : see `contact_sheet`.

    Returns
    -------
    Path
        `path`.
    """
    states = list(named_states.values())
    with Film(
        body, states, TILE_WIDTH, fixed=fixed, whiskers=False, surroundings=surroundings
    ) as film:
        tiles = [film.draw(state) for state in states]
        bars = film.bars
    texts = [spoken(name) for name in named_states]
    return save_image(sheet_of(tiles, texts, columns, title, bars), path)
