"""How one hand picks up a block with upright sides, from wherever it can reach it."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from lerobot_bimanual.arms import Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual.world.scene_view import SceneView

PITCHES_RAD = np.deg2rad((90.0, 70.0, 55.0, 40.0, 28.0, 18.0))
"""Of the hand below the horizontal; a tilted one reaches further."""


@dataclass(frozen=True)
class Grip:
    """Directions of a hand that takes a block by two of its sides."""

    approach: np.ndarray
    opening: np.ndarray

    def at(self, position) -> Pose:
        """The hand with its tool centre point at a position (3,)."""
        return Pose.looking(position, self.approach, self.opening)


def grips(block: Pose, base_m: np.ndarray, pitches_rad=PITCHES_RAD) -> Iterator[Grip]:
    """All grips of a block by its upright sides, steep ones first; then, to reach further, straight away from the arm.

    Args:
        block: an upright block whose sides lie along its x and y axes.
        base_m: (3,) where the arm stands.
        pitches_rad: of the hand below the horizontal.
    """
    across, along = block.rotation[:, 0], block.rotation[:, 1]
    away = (block.position - base_m) * (1, 1, 0)
    headings = [across, along, -across, -along]
    for pitch, heading in (
        *product(pitches_rad, headings),
        *product(pitches_rad, [away / np.linalg.norm(away)]),
    ):
        approach = np.cos(pitch) * heading - (0, 0, np.sin(pitch))
        yield Grip(approach, np.cross((0, 0, 1), heading))


def base_of(scene: SceneView, arm: Arm) -> np.ndarray:
    """(3,) where an arm stands."""
    return scene.arm_pair.base_poses[arm.ordinal].position
