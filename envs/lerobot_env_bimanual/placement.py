"""Where props may stand: an area of the table to draw from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lerobot_bimanual.geometry.pose import Pose


@dataclass(frozen=True)
class PlacementArea:
    """An upright rectangle on the table with a range of headings.

    Attributes:
        center_m: x and y of the middle, world frame.
        half_size_m: how far a prop's origin may lie from it along x and y.
        half_yaw_rad: how far a prop may be turned to either side about the vertical.
    """

    center_m: tuple[float, float]
    half_size_m: tuple[float, float]
    half_yaw_rad: float = 0.0

    def sample(self, rng: np.random.Generator, height_m: float) -> Pose:
        """A uniform upright pose with its origin at `height_m` above the floor."""
        xy = np.array(self.center_m) + rng.uniform(-1.0, 1.0, 2) * self.half_size_m
        return Pose.upright((*xy, height_m), rng.uniform(-1.0, 1.0) * self.half_yaw_rad)
