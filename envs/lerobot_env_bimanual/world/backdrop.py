"""What stands still as a camera that stands still sees it: drawn once, then shown behind what moves."""

from __future__ import annotations

import copy

import numpy as np
from numpy.typing import NDArray

from lerobot_env_bimanual.world.offscreen import Offscreen, Pixels


class Backdrop:
    """An image that others can be laid over.

    Args:
        pixels: the image.
        offscreen: where it was drawn.

    Attributes:
        rgb: (height, width, 3) uint8.
        nearness: (height, width) float32, as in `Pixels`.
        depth_m: (height, width) float32, metres along the optical axis.
    """

    def __init__(self, pixels: Pixels, offscreen: Offscreen):
        self.rgb, self.nearness = pixels
        self.depth_m = offscreen.depth_m(pixels.nearness)
        self._offscreen = offscreen

    def behind(self, front: Pixels) -> Backdrop | None:
        """A fresh image of what both show, bit for bit the one that is drawn at once.

        Of all that falls on a pixel the depth test keeps the nearest, whatever is drawn first.

        Args:
            front: of other geoms, from the same camera.

        Returns:
            The image; None where a geom of one is exactly as near as one of the other, for then it counts which is drawn
            first.
        """
        is_front = front.nearness > self.nearness
        if np.any((front.nearness == self.nearness) & (front.nearness > 0)):
            return None
        both = copy.copy(self)
        both.nearness = np.maximum(front.nearness, self.nearness)
        both.rgb, both.depth_m = self.rgb.copy(), self.depth_m.copy()
        np.copyto(_whole_pixels(both.rgb), _whole_pixels(front.rgb), where=is_front)
        both.depth_m[is_front] = self._offscreen.depth_m(front.nearness[is_front])
        return both


def _whole_pixels(rgb: NDArray[np.uint8]) -> NDArray[np.void]:
    """A view (height, width) of an image, which NumPy copies several times as fast as rows of three bytes."""
    return rgb.view("V3")[..., 0]
