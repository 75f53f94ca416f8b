"""Push the box, alone: now at one end, now at the other, so that it turns to and fro on its way."""

import math
from collections.abc import Iterator
from functools import partial

import numpy as np

from adversaries.hand import Hand, Moves
from adversaries.ways import Way
from lerobot_bimanual.arms import Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.tasks.push_box import BOX, PUSH_Z_M, pushing_hand
from lerobot_env_bimanual.world.servo_commands import TICK_S

WIDE_M, EVEN_M, MIDDLE_M = (-0.10, 0.15), (-0.13, 0.13), (-0.02, 0.02)
"""Where it is pushed: left and right of its middle."""
PUSH_M_S, MOVE_M_S = 0.6, 0.9
PRESS_M = 0.12
"""How far into the box the hand is sent while it pushes."""
CLEAR_M = 0.03
NEAR_M = 0.03
STALLED_M_S, STALLED_TICKS = 0.02, 6


def ways(env: BimanualEnv, arm: Arm) -> Iterator[Way]:
    """The box turns far, or as little as is allowed; or it is struck again and again near its middle."""
    far, little = ((22, WIDE_M), (22, EVEN_M), (30, WIDE_M)), ((7, WIDE_M), (7, EVEN_M), (5, MIDDLE_M))
    for swing_deg, ends_m in far + little:
        yield partial(_alone, arm=arm, ends_m=ends_m, swing_deg=swing_deg)


def _alone(env: BimanualEnv, arm: Arm, ends_m: tuple[float, float], swing_deg: float) -> Moves:
    hand, scene = Hand(env, arm), env.scene
    back_m = BOX.size_m[1] / 2

    def way() -> np.ndarray:
        """(2,) from the box to the target, in the box's axes."""
        box, target = scene.pose("box"), scene.pose("target").position
        return box.inverse().apply((*target[:2], box.position[2]))[:2]

    def at(x_m: float, ahead_m: float) -> Pose:
        return pushing_hand(scene.pose("box"), arm, x_m, ahead_m - back_m, PUSH_Z_M)

    def heading_deg() -> float:
        """By how much the box has to turn to point to the target."""
        aside, ahead = way()
        return float(np.rad2deg(math.atan2(-aside, max(ahead, 0.25))))

    end = ends_m[int(heading_deg() > 0)]
    yield from hand.grip(0.0, 1)
    yield from hand.go(at(end, -0.02).translated((0, 0, 0.15)))
    yield from hand.servo(partial(at, end, -0.02), 20, MOVE_M_S)
    still, before = 0, scene.pose("box").position
    while way()[1] > NEAR_M:
        now = scene.pose("box").position
        still = still + 1 if np.linalg.norm(now - before) < STALLED_M_S * TICK_S else 0
        before = now
        if heading_deg() * np.sign(end) < -swing_deg or still > STALLED_TICKS:
            still = -STALLED_TICKS
            yield from hand.servo(partial(at, end, -CLEAR_M), 4, 1.2)
            end = sum(ends_m) - end
            yield from hand.servo(partial(at, end, -CLEAR_M), 25, MOVE_M_S, 0.03)
        yield from hand.servo(partial(at, end, PRESS_M), 1, PUSH_M_S)
    yield from hand.servo(partial(at, end, -0.05), 4, 1.2)
    yield from hand.hold(20)
