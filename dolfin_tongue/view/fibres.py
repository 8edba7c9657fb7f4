"""Pictures of muscle fibres in the manner of the report's figures 19-26."""

from __future__ import annotations

import colorsys
from pathlib import Path

import numpy as np
from PIL import Image, ImageChops

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.body.body import Body
from dolfin_tongue.body.fibres import MuscleFibres
from dolfin_tongue.view.camera import OBLIQUE, Camera
from dolfin_tongue.view.canvas import Bar, length_bar, save_image, sheet_of, silhouette, spoken
from dolfin_tongue.view.fields import corner_means, deformation_gradients, half_lengths
from dolfin_tongue.view.palette import Colour, Pixels
from dolfin_tongue.view.scene3d import OVERSAMPLING, Stage

#: Width of the picture of one muscle, and of its tile in the sheet, pixels.
WIDTH, TILE_WIDTH = 640, 320

_OUTLINE = (150, 130, 128)


def muscle_colour(number: int, count: int) -> Colour:
    """Colour of a muscle: hues apart from each other, dark enough for white ground."""
    red, green, blue = colorsys.hsv_to_rgb((0.58 + number / max(count, 1)) % 1.0, 0.85, 0.75)
    return round(255 * red), round(255 * green), round(255 * blue)


def fibre_segments(
    body: Body, muscle: MuscleFibres, displacement: FloatArray | None = None
) -> FloatArray:
    """Return the ends of one line per cell through its centre, along the fibres.

    Parameters
    ----------
    body : the body.
    muscle : one of its muscles.
    displacement : ndarray, shape (n, 3), m -- lines move and turn with the deformation.

    Returns
    -------
    ndarray, shape (k, 2, 3), m -- three quarters as long as the cell is in that direction.
    """
    cells = muscle.cells
    length = 0.75 * half_lengths(body, cells, muscle.directions)
    half = length[:, None, None] * muscle.directions[:, None]
    ends = corner_means(body, body.points)[cells][:, None] + half * np.array([-1.0, 1.0])[:, None]
    if displacement is None:
        return ends
    centre = ends.mean(axis=1, keepdims=True)
    moved = centre + corner_means(body, displacement)[cells][:, None]
    gradients = deformation_gradients(body, displacement)[muscle.cells]
    return moved + np.einsum("kij,kaj->kai", gradients, ends - centre)


def see_through(body: Pixels, rods: Pixels, share: float, outline: Image.Image) -> Image.Image:
    """Combine pictures of a body and of the rods inside of it, at half their size.

    Parameters
    ----------
    body, rods : ndarrays, shape (h, w, 3) -- both from one stage.
    share : of the body's own colour; the rest is white.
    outline : mask of the outline of the body.
    """
    solid = Image.fromarray(body)
    light = Image.blend(Image.new("RGB", solid.size, "white"), solid, share)
    light.paste(_OUTLINE, mask=outline)
    return ImageChops.multiply(light, Image.fromarray(rods)).reduce(OVERSAMPLING)


def fibre_pictures(body: Body, folder: Path | str) -> list[Path]:
    """Draw the fibres of each muscle, and a sheet of all.

    Short rods at the centres of the cells show the fibre directions; element edges of the surface
    are faint. The tip of the tongue is to the left.

    Parameters
    ----------
    body : the body.
    folder : gets ``<muscle>.png`` for each muscle and ``all.png``.

    Returns
    -------
    list of Path
        The pictures, the sheet last.

    Raises
    ------
    ValueError : the body has no muscles.
    """
    folder, muscles = Path(folder), body.fibres.muscles
    if not muscles:
        raise ValueError(f"{body.name} has no muscles to draw")
    paths, tiles = [], []
    camera = Camera.fitting([body.points], OVERSAMPLING * WIDTH, OBLIQUE)
    bar = length_bar(camera.scale / OVERSAMPLING, WIDTH)
    with Stage(body, camera) as stage:
        frame = stage.frame(body.points)
        outline = silhouette(frame, OVERSAMPLING)
        for number, muscle in enumerate(muscles):
            bundle = (fibre_segments(body, muscle), muscle_colour(number, len(muscles)))
            rods = stage.rods([bundle], 1.9 * OVERSAMPLING / camera.scale)
            picture = see_through(frame, rods, 0.3, outline)
            framed = sheet_of([picture], [spoken(muscle.name)], 1, bars=[bar])
            paths.append(save_image(framed, folder / f"{muscle.name}.png"))
            tiles.append(picture.resize((TILE_WIDTH, TILE_WIDTH * picture.height // WIDTH)))
    names = [spoken(muscle.name) for muscle in muscles]
    small = Bar(bar.label, bar.length * TILE_WIDTH / WIDTH)
    sheet = sheet_of(tiles, names, 4, "Muscle fibres at the centres of the elements", [small])
    return [*paths, save_image(sheet, folder / "all.png")]
