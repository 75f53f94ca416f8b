"""Where a picture of the workspace is taken from: parallel projections."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ViewDirection:
    """A direction to look from. The arms face each other: the left one stands at low x, the right one at high x.

    Attributes:
        name: what is written above the picture.
        azimuth_deg: bearing of the viewer as seen from the workspace, from +x towards +y.
        elevation_deg: height of the viewer, 90 for straight above.
    """

    name: str
    azimuth_deg: float
    elevation_deg: float

    @property
    def axes(self) -> Array:
        """World directions (3, 3), by row: right and up in the picture, and towards the viewer."""
        azimuth, elevation = np.deg2rad([self.azimuth_deg, self.elevation_deg])
        level = np.cos(elevation)
        towards = np.array([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)])
        right = np.array([-np.sin(azimuth), np.cos(azimuth), 0])
        return np.stack([right, np.cross(towards, right), towards])


VIEW_DIRECTIONS = (
    ViewDirection("over the left arm's shoulder", 205, 35),
    ViewDirection("over the right arm's shoulder", 25, 20),
    ViewDirection("from above, the left arm at the bottom, the right one at the top", 180, 90),
)


@dataclass(frozen=True, eq=False)
class Frame:
    """A direction with a scale.

    Attributes:
        direction: the direction.
        pixels_per_m: scale.
        origin_px: (2,) column and row of the world's origin.
    """

    direction: ViewDirection
    pixels_per_m: float
    origin_px: Array

    @classmethod
    def fit(cls, direction: ViewDirection, points_m: ArrayLike, width: int, height: int) -> "Frame":
        """The frame in which points (n, 3) fill a picture."""
        places = np.asarray(points_m) @ direction.axes[:2].T * [1, -1]
        low, high = places.min(axis=0), places.max(axis=0)
        pixels_per_m = float((np.array([width, height]) / (high - low)).min())
        return cls(direction, pixels_per_m, np.array([width, height]) / 2 - pixels_per_m * (low + high) / 2)

    def project(self, points_m: ArrayLike) -> Array:
        """Pixels (..., 2), column and row, of world points (..., 3)."""
        places = np.asarray(points_m) @ self.direction.axes[:2].T * [1, -1]
        return self.origin_px + self.pixels_per_m * places

    def nearness(self, points_m: ArrayLike) -> Array:
        """How far (...) points (..., 3) stand towards the viewer, in metres."""
        return np.asarray(points_m) @ self.direction.axes[2]
