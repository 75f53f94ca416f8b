"""Sweep, alone: drive the pan under the dirt, pick the lumps up one by one, or sweep or strike them into a pan that no hand holds."""

from collections.abc import Iterator
from itertools import product

import numpy as np

from adversaries.hand import Hand, Moves
from adversaries.ways import Way, every_choice
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
    """The right arm reaches the pan's handle, the left one the broom; either reaches the lumps."""
    if arm is Arm.LEFT:
        yield from every_choice(_strike, arm=[arm], stop_m=(0.14, 0.12), speed_m_s=(0.7, 0.8, 0.9))
    yield from every_choice(_pick_up, arm=[arm], order=(1, -1))
    if arm is Arm.LEFT:
        yaws_rad = np.deg2rad((20.0, -20.0, 0.0))
        yield from every_choice(_sweep, arm=[arm], yaw_rad=yaws_rad, speed_m_s=(0.12, 0.8))
    else:
        angles_rad = map(np.deg2rad, product((80, 45), (30, 50)))
        yield from every_choice(_scoop, arm=[arm], height_m=(0.33, 0.30), angles_rad=angles_rad)


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


class _Broom:
    """The broom in the left hand, and the pan that no hand holds, as far as it has been pushed."""

    def __init__(self, env: BimanualEnv, arm: Arm):
        self.hand, self._scene = Hand(env, arm), env.scene
        self._grip_z_m = TABLE_HEIGHT_M + expert.BROOM.height_m - expert.BELOW_END_M

    def take(self) -> Moves:
        """Lift the broom out of its stand."""
        x, y, _ = self._scene.pose(expert.BROOM.name).position
        grasp = Pose.looking((x, y, self._grip_z_m), approach=(0, 0, -1), opening=(-1, 0, 0))
        yield from self.hand.go(grasp.advanced(-expert.ABOVE_M))
        yield from self.hand.line(grasp)
        yield from self.hand.grip(0.0)
        yield from self.hand.line(grasp.translated(expert.TAKE_OUT_M))

    def at(self, ahead_m: float, yaw_rad: float = 0.0) -> Pose:
        """The hand where the broom is so far before the pan's middle, turned."""
        pan = self._scene.pose(expert.PAN.name)
        x, y, _ = pan.apply((0, ahead_m, 0))
        along = pan.rotation @ (-np.cos(yaw_rad), -np.sin(yaw_rad), 0)
        return Pose.looking((x, y, self._grip_z_m), approach=(0, 0, -1), opening=along)

    def behind(self, yaw_rad: float = 0.0) -> Moves:
        """Put the broom down behind all lumps, from above."""
        pose = self.at(expert.DIRT_HALF_M[1] - expert.PAN_Y_M + expert.BEHIND_DIRT_M, yaw_rad)
        yield from self.hand.line(pose.translated((0, 0, expert.TAKE_OUT_M[2])), 1.0)
        yield from self.hand.line(pose)


def _sweep(env: BimanualEnv, arm: Arm, speed_m_s: float, yaw_rad: float) -> Moves:
    """Sweep into the pan slantwise and slowly, so that the lumps climb its lip one after the other."""
    broom = _Broom(env, arm)
    yield from broom.take()
    yield from broom.behind(yaw_rad)
    yield from broom.hand.line(broom.at(expert.SWEEP_TO_M, yaw_rad), speed_m_s)
    yield from broom.hand.hold(15)


def _strike(env: BimanualEnv, arm: Arm, stop_m: float, speed_m_s: float) -> Moves:
    """Stop fast strokes before the pan, so that the lumps roll on into it."""
    broom = _Broom(env, arm)
    yield from broom.take()
    for _ in range(STROKES):
        yield from broom.behind()
        yield from broom.hand.servo(lambda: broom.at(stop_m), 40, speed_m_s)
        yield from broom.hand.hold(5)
        back = broom.at(stop_m + 0.07)
        yield from broom.hand.line(back, 1.0)
        yield from broom.hand.line(back.translated((0, 0, expert.TAKE_OUT_M[2])), 1.0)
    yield from broom.hand.hold(15)
