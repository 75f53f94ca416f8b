"""Cameras stand elsewhere, and their calibration knows it."""

import numpy as np

from lerobot_env_bimanual.episode.reset import EpisodeStart
from lerobot_env_bimanual.perturbations.axes._moved_cameras import move_cameras
from lerobot_env_bimanual.perturbations.axis import Axis, Group
from lerobot_env_bimanual.perturbations.registry import register
from lerobot_env_bimanual.world.appearance import Appearance


@register
class CameraMoved(Axis):
    """A policy that uses the calibration can answer it; one that has learned where cameras stand cannot."""

    name = "camera_moved"
    group = Group.SEEN
    levels = (1, 3, 10)
    unit = "degrees and centimetres"
    summary = "each of the five cameras is turned and moved, and its calibration says so"
    source = (
        "chosen here: from a knock to another mount; the same as camera_miscalibrated, to be compared with it"
    )

    def look(
        self, start: EpisodeStart, appearance: Appearance, magnitude: float, rng: np.random.Generator
    ) -> Appearance:
        """Move them, and tell."""
        return move_cameras(start.scene.model, appearance, magnitude, rng, told=True)
