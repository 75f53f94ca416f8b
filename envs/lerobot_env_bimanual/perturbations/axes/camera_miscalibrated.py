"""Cameras stand elsewhere than their calibration says."""

import numpy as np

from lerobot_env_bimanual.episode.reset import EpisodeStart
from lerobot_env_bimanual.perturbations.axes._moved_cameras import move_cameras
from lerobot_env_bimanual.perturbations.axis import Axis, Group
from lerobot_env_bimanual.perturbations.registry import register
from lerobot_env_bimanual.world.appearance import Appearance


@register
class CameraMiscalibrated(Axis):
    """Points of several cameras no longer meet where they should."""

    name = "camera_miscalibrated"
    group = Group.SEEN
    levels = (1, 3, 10)
    unit = "degrees and centimetres"
    summary = "each of the five cameras is turned and moved, and its calibration says where it was"
    source = (
        "chosen here: a careful hand-eye calibration errs by about level 1, a knocked tripod by level 2 or 3"
    )

    def look(
        self, start: EpisodeStart, appearance: Appearance, magnitude: float, rng: np.random.Generator
    ) -> Appearance:
        """Move them, and say nothing."""
        return move_cameras(start.scene.model, appearance, magnitude, rng, told=False)
