"""Colours, and what pixels are: known to everything that draws."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

#: Red, green, blue of each pixel, shape (height, width, 3), 0-255.
Pixels: TypeAlias = npt.NDArray[np.uint8]
#: Red, green, blue, 0-255.
Colour: TypeAlias = tuple[int, int, int]

WHITE: Colour = (255, 255, 255)
INK: Colour = (40, 40, 48)
FAINT: Colour = (120, 120, 132)
WHISKER: Colour = (22, 62, 150)

TISSUE: Colour = (233, 143, 135)
EDGES: Colour = (140, 62, 60)
#: Element edges on a field of colours.
FIELD_EDGES: Colour = (90, 90, 96)

#: Bone under its thin skin, and what the tissue only slides on.
IVORY: Colour = (238, 220, 176)
SLATE: Colour = (176, 196, 210)

BONE: Colour = (244, 232, 200)
BONE_EDGE: Colour = (110, 90, 48)
SPRING: Colour = (84, 90, 100)
#: A line muscle that is fully active, and one that is not.
MUSCLE: Colour = (176, 16, 28)
IDLE: Colour = (222, 150, 146)

#: Colours of bones that a palette has to have.
BONE_INKS = [BONE, BONE_EDGE, SPRING, MUSCLE, IDLE]
