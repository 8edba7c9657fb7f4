"""Cameras: parallel projections of the body to pixels, the same for VTK and for what is drawn over.

All views have the tip of the tongue to the LEFT and up upwards, as midsagittal pictures in speech
science do: x (front to back) points to the right, z up, and the viewer stands on the left side of
the tongue, at y < 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dolfin_tongue.base.arrays import FloatArray


@dataclass(frozen=True)
class View:
    """A direction of sight.

    Parameters
    ----------
    azimuth : turn of the viewer from the left side towards the front, degrees.
    elevation : rise of the viewer over the horizontal, degrees.
    """

    azimuth: float
    elevation: float

    @property
    def axes(self) -> FloatArray:
        """Unit vectors to the right, up and towards the viewer as rows, shape (3, 3)."""
        a, e = np.radians([self.azimuth, self.elevation])
        right = np.array([np.cos(a), -np.sin(a), 0.0])
        toward = np.array([-np.sin(a) * np.cos(e), -np.cos(a) * np.cos(e), np.sin(e)])
        return np.stack([right, np.cross(toward, right), toward])


#: Nearly from the side: frames of a movement.
SIDE = View(azimuth=18.0, elevation=10.0)
#: From the front, the side and above: a single picture, fibres across the tongue.
OBLIQUE = View(azimuth=38.0, elevation=22.0)
#: From above: what touches the palate.
ABOVE = View(azimuth=10.0, elevation=70.0)


@dataclass(frozen=True)
class Camera:
    """A parallel projection.

    Parameters
    ----------
    view : direction of sight.
    centre : ndarray, shape (3,), m -- the point in the middle of the picture.
    scale : pixels per metre.
    size : width and height, pixels.
    reach : nothing that is drawn is farther from `centre`, m.
    """

    view: View
    centre: FloatArray
    scale: float
    size: tuple[int, int]
    reach: float

    @classmethod
    def fitting(
        cls,
        clouds: Sequence[FloatArray],
        width: int,
        view: View = SIDE,
        *,
        margin: float = 0.06,
        aspect: tuple[float, float] = (0.55, 1.1),
    ) -> Camera:
        """Build the camera that has all points in its picture.

        Parameters
        ----------
        clouds : ndarrays, shape (n, 3), m.
        width : of the picture, pixels.
        view : direction of sight.
        margin : share of the width that stays free on every side.
        aspect : smallest and largest height over width. In between, the height fits the points.
        """
        axes = view.axes
        seen = [cloud @ axes.T for cloud in clouds]
        low = np.min([points.min(axis=0) for points in seen], axis=0)
        high = np.max([points.max(axis=0) for points in seen], axis=0)
        extent = np.maximum(high - low, 1e-9)[:2]
        reach = float(np.linalg.norm(high - low) + extent.max())
        room = width * (1 - 2 * margin)
        height = room * extent[1] / extent[0] + 2 * margin * width
        height = np.clip(height, aspect[0] * width, aspect[1] * width)
        # Even numbers: pictures are drawn at twice their size and halved.
        size = (2 * round(width / 2), 2 * round(height / 2))
        scale = min(room / extent[0], (size[1] - 2 * margin * width) / extent[1])
        return cls(view, (low + high) / 2 @ axes, float(scale), size, reach)

    def project(self, points: FloatArray) -> FloatArray:
        """Pixels (right, down) of points of shape (n, 3), m; shape (n, 2)."""
        seen = (points - self.centre) @ self.view.axes[:2].T
        return np.array(self.size) / 2 + seen * self.scale * [1.0, -1.0]
