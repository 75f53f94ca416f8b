"""Straighten the rope, alone: drag one end beyond its plate, then the other end to its own, so that the first follows."""

from collections.abc import Iterator

import numpy as np

from adversaries.hand import Hand, Moves
from adversaries.ways import Way, parameter_grid
from lerobot_bimanual.arms import Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.tasks.straighten_rope import ABOVE_Z_M, GRASP_Z_M, ROPE

END_SHARE = 0.07
"""Share of the plates' distance by which an end is dragged beyond its plate's middle, so that the rope is pulled tight."""


def ways(env: BimanualEnv, arm: Arm) -> Iterator[Way]:
    """Either end first, dragged beyond its plate by either share; the second end slowly or with a jerk."""
    tail, head = (ROPE.tail, "tail_plate"), (ROPE.head, "head_plate")
    ends = ((tail, head), (head, tail))
    return parameter_grid(_alone, arm=[arm], speed_m_s=(0.3, 1.2), beyond=(0.2, 0.4), ends=ends)


def _alone(env: BimanualEnv, arm: Arm, speed_m_s: float, beyond: float, ends) -> Moves:
    hand, scene, (first, second) = Hand(env, arm), env.scene, ends
    for (end, plate), other, share, speed in (
        (first, second[1], beyond, 0.4),
        (second, first[1], END_SHARE, speed_m_s),
    ):
        across = scene.pose(end).rotation[:, 1] * (1, 1, 0)
        side = 1 if across[1] > 0 else -1

        def over(place, side=side, across=across) -> Pose:
            return Pose.looking((*place[:2], GRASP_Z_M), approach=(0, 0, -1), opening=side * across)

        start, goal = scene.pose(end).position, scene.pose(plate).position
        grasp, put = over(start), over(goal + share * (goal - scene.pose(other).position))
        up = np.array((0, 0, ABOVE_Z_M - GRASP_Z_M))
        yield from hand.grip(1.0, 1)
        yield from hand.go(grasp.translated(up))
        yield from hand.line(grasp)
        yield from hand.grip(0.0)
        yield from hand.line(put, speed)
        if end == second[0]:
            break
        yield from hand.grip(1.0)
        yield from hand.line(put.translated(up))
    yield from hand.hold(30)
