"""Depth is not measured everywhere."""

from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_env_bimanual.episode.progress import EpisodeProgress
from lerobot_env_bimanual.episode.reset import EpisodeStart
from lerobot_env_bimanual.perturbations.axes._noise import normal
from lerobot_env_bimanual.perturbations.axis import Axis, Group, Image
from lerobot_env_bimanual.perturbations.registry import register

MOST_SLANT_DEG = 90
SLANT_DEG = 30
"""By which the largest slant that is still measured is less at magnitude 1."""
EDGE = 1 / 85
"""Share of an image's height that is lost beside an edge at magnitude 1: three pixels of 256."""
DARK = 40
"""No channel of a dark pixel is above this, of 255."""
SIGMA = 25
"""Of the numbers by which dark pixels are drawn, which are integers for speed."""


@register
class DepthHoles(Axis):
    """An edge is a very slanted surface between two pixels, so one rule finds both."""

    name = "depth_holes"
    group = Group.SEEN
    levels = (0.3, 0.6, 0.9)
    unit = "share of dark pixels that is lost; 30 degrees of slant and 3 of 256 pixels beside edges per unit"
    summary = (
        "nothing is measured beside edges, on surfaces seen at a flat angle, and on a share of dark ones"
    )
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
        lost = _is_dark(rgb)
        lost &= normal(depth_m.shape, SIGMA, rng, np.int8) < round(SIGMA * NormalDist().inv_cdf(magnitude))
        step = max(1, round(magnitude * EDGE * height))
        most = np.float32(progress.memory[self.name][camera] * step / height)
        # As one line of numbers, which NumPy goes through several times as fast as through the rows of two images.
        line, lost_line, most_m = depth_m.reshape(-1), lost.reshape(-1), (depth_m * most).reshape(-1)
        for pixels in (step * width, step):
            change_m = line[pixels:] - line[:-pixels]
            lost_line[pixels:] |= np.abs(change_m, out=change_m) > most_m[pixels:]
        lost[:, :step] = True  # beyond this edge of the image the other eye sees nothing
        depth_m *= ~lost
        return rgb, depth_m


def _is_dark(rgb: NDArray[np.uint8]) -> NDArray[np.bool_]:
    line = rgb.reshape(-1)
    brightest = np.maximum(line[:-2], line[1:-1])
    np.maximum(brightest, line[2:], out=brightest)
    return (brightest[::3].copy() <= DARK).reshape(rgb.shape[:2])
