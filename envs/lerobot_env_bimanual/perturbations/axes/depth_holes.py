"""Depth is not measured everywhere."""

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_env_bimanual.episode.progress import EpisodeProgress
from lerobot_env_bimanual.episode.reset import EpisodeStart
from lerobot_env_bimanual.perturbations.axis import Axis, Group, Image
from lerobot_env_bimanual.perturbations.registry import register

MOST_SLANT_DEG = 90
SLANT_DEG = 30
"""By which the largest slant that is still measured is less at magnitude 1."""
EDGE = 1 / 85
"""Share of an image's height that is lost beside an edge at magnitude 1: three pixels of 256."""
DARK = 60
"""At magnitude 1 no channel of a pixel that is too dark is above this, of 255."""


@register
class DepthHoles(Axis):
    """An edge is a very slanted surface between two pixels, so one rule finds both."""

    name = "depth_holes"
    group = Group.SEEN
    levels = (0.3, 0.6, 0.9)
    unit = "share of what is lost at most: 30 degrees of slant, 3 of 256 pixels beside edges, the darkest 60 of 255 greys"
    summary = "nothing is measured beside edges, on surfaces seen at a flat angle, and on dark ones"
    source = (
        "chosen here: what is lost by cameras that see a pattern with one eye or with two; beyond 60 to 80 degrees of "
        "slant and on black surfaces little of it comes back"
    )

    def begin(self, start: EpisodeStart, magnitude: float, rng: np.random.Generator) -> None:
        """Note by how much depth changes from one pixel to the next on the flattest surface, per m and image height."""
        model = start.scene.model
        steepest = np.tan(np.deg2rad(MOST_SLANT_DEG - SLANT_DEG * magnitude))
        start.progress.memory[self.name] = {
            camera: float(steepest * 2 * np.tan(np.deg2rad(model.camera(camera).fovy / 2)).item())
            for camera in CAMERA_NAMES
        }

    def see(
        self,
        camera: str,
        image: Image,
        progress: EpisodeProgress,
        magnitude: float,
        rng: np.random.Generator,
    ) -> Image:
        """Set depth to 0 where it is lost."""
        rgb, depth_m = image
        height, width = depth_m.shape
        step = max(1, round(magnitude * EDGE * height))
        most = np.float32(progress.memory[self.name][camera] * step / height)
        # One step along the diagonal finds what changes along rows and along columns; as one line of numbers NumPy goes
        # through an image several times as fast as row by row.
        lost, line = _is_dark(rgb, round(magnitude * DARK)), depth_m.reshape(-1)
        back = step * (width + 1)
        change_m = line[back:] - line[:-back]
        lost[back:] |= np.abs(change_m, out=change_m) > (line * most)[back:]
        lost = lost.reshape(depth_m.shape)
        lost[:, :step] = True  # beyond this edge of the image the other eye sees nothing
        depth_m *= ~lost
        return rgb, depth_m


def _is_dark(rgb: NDArray[np.uint8], darkest: int) -> NDArray[np.bool_]:
    """(height x width,) pixels without a channel above a value."""
    line = rgb.reshape(-1)
    brightest = np.maximum(line[:-2], line[1:-1])
    np.maximum(brightest, line[2:], out=brightest)
    return brightest[::3].copy() <= darkest
