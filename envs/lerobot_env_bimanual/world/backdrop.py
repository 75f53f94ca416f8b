"""What stands still as a camera that stands still sees it: drawn once, then shown behind what moves."""

import numpy as np
from numpy.typing import NDArray

from lerobot_env_bimanual.world.offscreen import Offscreen, Pixels

type Picture = tuple[NDArray[np.uint8], NDArray[np.float32]]
"""RGB (height, width, 3) and depth (height, width) in metres along the optical axis."""


class Backdrop:
    """An image of what stands still.

    Args:
        still: the image.
        offscreen: where it was drawn.
    """

    def __init__(self, still: Pixels, offscreen: Offscreen):
        self._still = still
        self._depth_m = offscreen.depth_m(still.nearness)
        self._offscreen = offscreen

    def behind(self, moving: Pixels) -> Picture | None:
        """A fresh picture of both, bit for bit the one that is drawn at once.

        Of all that falls on a pixel the depth test keeps the nearest, whatever is drawn first.

        Args:
            moving: everything else, as the same camera sees it.

        Returns:
            The picture; None where something that moves is exactly as near as something that stands still, for then
            it counts which is drawn first.
        """
        nearness, still_nearness = moving.nearness.ravel(), self._still.nearness.ravel()
        shown = np.flatnonzero(nearness >= still_nearness)
        shown_nearness = nearness[shown]
        if np.any((shown_nearness == still_nearness[shown]) & (shown_nearness > 0)):
            return None
        rgb, depth_m = self._still.rgb.copy(), self._depth_m.copy()
        _whole_pixels(rgb)[shown] = _whole_pixels(moving.rgb)[shown]
        depth_m.ravel()[shown] = self._offscreen.depth_m(shown_nearness)
        return rgb, depth_m


def _whole_pixels(rgb: NDArray[np.uint8]) -> NDArray[np.void]:
    """A view (height * width,) of an image, which NumPy moves several times as fast as rows of three bytes."""
    return rgb.reshape(-1, 3).view("V3").ravel()
