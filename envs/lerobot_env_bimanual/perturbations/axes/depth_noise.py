"""Depth is noisy, the more the further away."""

import numpy as np

from lerobot_env_bimanual.episode.progress import EpisodeProgress
from lerobot_env_bimanual.perturbations.axes._noise import normal
from lerobot_env_bimanual.perturbations.axis import Axis, Group, Image
from lerobot_env_bimanual.perturbations.registry import register


@register
class DepthNoise(Axis):
    """Stereo and structured light measure a disparity, whose error counts with the square of the distance."""

    name = "depth_noise"
    group = Group.SEEN
    levels = (0.0016, 0.0032, 0.0064)
    unit = "m of standard deviation per squared m of distance"
    summary = "each pixel's depth errs by itself, normally, with the square of the distance"
    source = (
        "Khoshelham and Elberink, Sensors 12 (2012) 1437: of a Kinect about 4 cm at 5 m, and as the distance squared; "
        "twice and four times as much: a shorter baseline, a darker room"
    )

    def see(
        self,
        camera: str,
        image: Image,
        progress: EpisodeProgress,
        magnitude: float,
        rng: np.random.Generator,
    ) -> Image:
        """Add noise; where nothing was measured there is still nothing."""
        rgb, depth_m = image
        depth_m += np.square(depth_m) * normal(depth_m.shape, magnitude, rng, np.float32)
        return rgb, depth_m
