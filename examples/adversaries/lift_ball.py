"""Lift the ball, alone: push it against the other arm's base, and roll it up there as high as it goes."""

from collections.abc import Iterator

import numpy as np

from adversaries.hand import Hand, Moves
from adversaries.ways import Way, parameter_grid
from lerobot_bimanual.arms import Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.tasks.lift_ball import BALL

GAP_M = 0.05


def ways(env: BimanualEnv, arm: Arm) -> Iterator[Way]:
    """Every choice of how far the hand presses into the ball, how low, and how fast it goes up."""
    return parameter_grid(_alone, arm=[arm], press_m=(0.03, 0.08), low_m=(0.0, -0.06), speed_m_s=(0.2, 0.6))


def _alone(env: BimanualEnv, arm: Arm, press_m: float, low_m: float, speed_m_s: float) -> Moves:
    hand, scene = Hand(env, arm), env.scene
    base = scene.arm_pair.base_pose(arm.other).position

    def pushing(ahead_m: float, up_m: float = 0.0) -> Pose:
        """Behind the ball as seen from the other base, pointing down; `ahead_m` into it."""
        ball = scene.pose("ball").position
        way = (base - ball) * (1, 1, 0)
        way /= np.linalg.norm(way)
        place = ball + (ahead_m - BALL.radius_m) * way + (0, 0, low_m + up_m)
        return Pose.looking(place, approach=(0, 0, -1), opening=np.cross((0, 0, 1), way))

    yield from hand.grip(0.0, 1)
    yield from hand.go(pushing(-GAP_M, 0.2))
    yield from hand.line(pushing(-GAP_M))
    yield from hand.servo(lambda: pushing(press_m), 60, 0.4, 0.0)
    yield from hand.servo(lambda: pushing(press_m, 0.05), 80, speed_m_s, 0.0)
