"""Sweep, alone: strike the lumps into a pan that no hand holds, or drive it under them, or pick them up one by one."""

from collections.abc import Iterator
from itertools import product

import numpy as np

from adversaries.hand import Hand, Moves
from adversaries.ways import Way, parameter_grid
from lerobot_bimanual.arms import Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.workspace import TABLE_HEIGHT_M
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.tasks import sweep_to_dustpan as expert

SCOOP_M_S, BACK_M, THROUGH_M = 1.0, 0.15, 0.30
STROKES = 4
HALF_OPEN = 0.5
PICK_Z_M, CARRY_Z_M, DROP_Z_M = 0.014, 0.060, 0.075
"""Heights above the table of a hand that takes a lump, carries it, and drops it into the pan."""


def ways(env: BimanualEnv, arm: Arm) -> Iterator[Way]:
    """The left arm reaches the broom, the right one the pan's handle and the lumps."""
    if arm is Arm.LEFT:
        yield from parameter_grid(_strike, arm=[arm], stop_m=(0.14, 0.12), speed_m_s=(0.7, 0.8, 0.9))
    else:
        yield from parameter_grid(_pick_up, arm=[arm], order=(1, -1))
        angles_rad = map(np.deg2rad, product((80, 45), (30, 50)))
        yield from parameter_grid(_scoop, arm=[arm], height_m=(0.33, 0.30), angles_rad=angles_rad)


def _scoop(env: BimanualEnv, arm: Arm, height_m: float, angles_rad: np.ndarray) -> Moves:
    """Take the pan by its handle, back off, and drive it under the lumps, which climb its lip by inertia."""
    hand, pan = Hand(env, arm), env.scene.pose(expert.PAN.name)
    (cos_yaw, cos_pitch), (sin_yaw, sin_pitch) = np.cos(angles_rad), np.sin(angles_rad)
    approach = np.array([-cos_yaw * cos_pitch, sin_yaw * cos_pitch, -sin_pitch])
    opening = np.cross((0, 0, 1), approach)
    handle = pan.apply((0, expert.PAN.handle_y_m, height_m))
    hold = Pose.looking(handle, pan.rotation @ approach, pan.rotation @ opening)
    ahead = pan.rotation[:, 1]
    yield from hand.go(hold.advanced(-expert.BEFORE_HANDLE_M))
    yield from hand.line(hold)
    yield from hand.grip(0.0)
    yield from hand.line(hold.translated(-BACK_M * ahead))
    yield from hand.line(hold.translated(THROUGH_M * ahead), SCOOP_M_S)
    yield from hand.hold(20)


def _pick_up(env: BimanualEnv, arm: Arm, order: int) -> Moves:
    """Pick the lumps up one by one, and drop them into the pan."""
    hand, scene = Hand(env, arm), env.scene
    pan, up = scene.pose(expert.PAN.name), np.array([0.0, 0.0, 1.0])
    left = [crumb.name for crumb in expert.CRUMBS]
    left.sort(key=lambda name: order * pan.inverse().apply(scene.pose(name).position)[1])
    yield from hand.grip(HALF_OPEN, 1)
    for index, name in enumerate(left):
        x, y, _ = scene.pose(name).position
        others = [scene.pose(other).position[:2] for other in left[index + 1 :]]
        turns = np.deg2rad((0, 30, -30, 60, -60, 90))
        room = [_room((x, y), turn, others) for turn in turns]
        turn = turns[int(np.argmax(room))]
        opening = (np.cos(turn), np.sin(turn), 0)
        grasp = Pose.looking((x, y, TABLE_HEIGHT_M + PICK_Z_M), approach=-up, opening=opening)
        x, y, _ = pan.apply((0.042 * (index - 2), 0, 0))
        drop = Pose.looking((x, y, TABLE_HEIGHT_M + DROP_Z_M), approach=-up, opening=opening)
        for target, speed_m_s in ((grasp.translated((CARRY_Z_M - PICK_Z_M) * up), 1.2), (grasp, 0.8)):
            yield from hand.servo(lambda target=target: target, 40, speed_m_s, 0.004)
        yield from hand.grip(0.0, 4)
        lifted = grasp.translated((DROP_Z_M - PICK_Z_M) * up)
        for target in (lifted, drop):
            yield from hand.servo(lambda target=target: target, 40, 1.2, 0.02)
        yield from hand.grip(HALF_OPEN, 3)
    yield from hand.hold(30)


def _room(place, turn_rad: float, others) -> float:
    """Distance from the fingers to the nearest other lump, up to what they need."""
    side = 0.034 * np.array([np.cos(turn_rad), np.sin(turn_rad)])
    fingers = [np.add(place, side), np.subtract(place, side)]
    return min([0.03, *(float(np.linalg.norm(other - finger)) for other in others for finger in fingers)])


def _strike(env: BimanualEnv, arm: Arm, stop_m: float, speed_m_s: float) -> Moves:
    """Take the broom, and stop fast strokes before the pan, so that the lumps roll on into it."""
    hand, scene = Hand(env, arm), env.scene
    grip_z_m = TABLE_HEIGHT_M + expert.BROOM.height_m - expert.BELOW_END_M
    up = np.array([0.0, 0.0, expert.TAKE_OUT_M[2]])

    def at(ahead_m: float) -> Pose:
        """Pose of the hand with the broom `ahead_m` in front of the pan's middle."""
        pan = scene.pose(expert.PAN.name)
        x, y, _ = pan.apply((0, ahead_m, 0))
        return Pose.looking((x, y, grip_z_m), approach=(0, 0, -1), opening=pan.rotation @ (-1, 0, 0))

    x, y, _ = scene.pose(expert.BROOM.name).position
    grasp = Pose.looking((x, y, grip_z_m), approach=(0, 0, -1), opening=(-1, 0, 0))
    yield from hand.go(grasp.advanced(-expert.ABOVE_M))
    yield from hand.line(grasp)
    yield from hand.grip(0.0)
    yield from hand.line(grasp.translated(expert.TAKE_OUT_M))
    for _ in range(STROKES):
        behind = at(expert.DIRT_HALF_M[1] - expert.PAN_Y_M + expert.BEHIND_DIRT_M)
        yield from hand.line(behind.translated(up), 1.0)
        yield from hand.line(behind)
        yield from hand.servo(lambda: at(stop_m), 40, speed_m_s)
        yield from hand.hold(5)
        back = at(stop_m + 0.07)
        yield from hand.line(back, 1.0)
        yield from hand.line(back.translated(up), 1.0)
    yield from hand.hold(15)
