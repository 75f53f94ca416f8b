"""Push both buttons, alone: fingertips on one, and hand and forearm laid down on the other."""

from collections.abc import Iterator

import numpy as np

from adversaries.hand import Hand, Moves
from adversaries.ways import Way, parameter_grid
from lerobot_bimanual.arms import Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.workspace import TABLE_HEIGHT_M
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.tasks.dual_push_buttons import LEFT, RIGHT

HOVER_M, PRESS_M = 0.12, 0.028
"""Heights of the fingertips above the table."""


def ways(env: BimanualEnv, arm: Arm) -> Iterator[Way]:
    """Fingertips on either button, the hand pitched up more or less, rolled, and in several postures of the arm."""
    hand = {"pitch_rad": np.deg2rad((8.0, 15.0)), "far": (LEFT, RIGHT), "roll": (1, -1)}
    return parameter_grid(_alone, arm=[arm], **hand, which=(0, 1))


def _alone(env: BimanualEnv, arm: Arm, far: str, pitch_rad: float, roll: int, which: int) -> Moves:
    hand, scene = Hand(env, arm), env.scene
    tip = scene.pose(far).position
    way = (tip - scene.pose(RIGHT if far == LEFT else LEFT).position) * (1, 1, 0)
    way /= np.linalg.norm(way)
    approach = np.cos(pitch_rad) * way - (0, 0, np.sin(pitch_rad))
    press = Pose.looking((*tip[:2], TABLE_HEIGHT_M + PRESS_M), approach, roll * np.cross((0, 0, 1), way))
    yield from hand.grip(0.0, 1)
    yield from hand.go(press.translated((0, 0, HOVER_M)), which=which)
    yield from hand.line(press.translated((0, 0, -0.02)), 0.3)
    yield from hand.hold(20)
