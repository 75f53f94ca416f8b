"""Straighten the rope, alone: one end after the other, or one end alone, with the other one trailing behind it."""

from collections.abc import Iterator
from functools import partial
from itertools import product

import numpy as np

from adversaries.single_arm import Strategy, alone
from lerobot_bimanual.arms import Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual.conditions import Inside
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.task import Variation
from lerobot_env_bimanual.tasks.straighten_rope import ABOVE_Z_M, GRASP_Z_M, ON_PLATE_M, ROPE
from lerobot_env_bimanual.world.scene_view import SceneView

ENDS = ((ROPE.tail, "tail_plate"), (ROPE.head, "head_plate"))
ROUNDS = 6
TUGS = 6
TAUT_M = 0.36
"""From the end in the hand to where the trailing one would lie if the table held it fast."""


def strategies(scene: SceneView, variation: Variation, arm: Arm) -> Iterator[Strategy]:
    """Either end first, with either roll of the hand."""
    for side, order, strategy in product((1, -1), (1, -1), (_in_turn, _towing)):
        yield partial(strategy, arm=arm, ends=ENDS[::order], side=side)


def _in_turn(scene: SceneView, arm: Arm, ends, side: int) -> Iterator[Stage]:
    """Take the end that is not in place, drag it onto its plate, let go."""
    for number in range(ROUNDS):
        end, plate = ends[number % 2]
        if number >= 2 and Inside(end, plate, *ON_PLATE_M)(scene):
            continue
        grasp, pull = _hand(scene.pose(end), scene.pose(plate), side)
        up = (0, 0, ABOVE_Z_M - GRASP_Z_M)
        yield alone(arm, "above", grasp.translated(up), is_open=True)
        yield alone(arm, "grasp", grasp, is_open=False)
        yield alone(arm, "drag", pull, is_open=True)
        yield alone(arm, "let go", pull.translated(up))


def _towing(scene: SceneView, arm: Arm, ends, side: int) -> Iterator[Stage]:
    """Take one end, tow the other one onto its plate, and stretch the rope against the table's friction."""
    (end, plate), (trailing, its_plate) = ends
    grasp, pull = _hand(scene.pose(end), scene.pose(plate), side)
    up = (0, 0, ABOVE_Z_M - GRASP_Z_M)
    yield alone(arm, "above", grasp.translated(up), is_open=True)
    yield alone(arm, "grasp", grasp, is_open=False)
    goal = scene.pose(its_plate).position
    towards = (pull.position - goal) * (1, 1, 0)
    towards /= np.linalg.norm(towards)
    for number in range(TUGS):
        short = goal - scene.pose(trailing).position if number else np.zeros(3)
        at = goal + TAUT_M * towards + short * (1, 1, 0)
        yield alone(arm, "tow", Pose.looking((*at[:2], GRASP_Z_M), (0, 0, -1), pull.rotation[:, 1]))
    yield alone(arm, "stretch", pull.translated(0.02 * towards))


def _hand(end: Pose, plate: Pose, side: int) -> tuple[Pose, Pose]:
    """Straight down on an end of the rope and on its plate, fingers to both sides of the rope."""
    across_end, across_plate = end.rotation[:, 1] * (1, 1, 0), plate.rotation[:, 0]
    if across_end @ across_plate < 0:
        across_plate = -across_plate

    def hand(at: Pose, across: np.ndarray) -> Pose:
        return Pose.looking((*at.position[:2], GRASP_Z_M), approach=(0, 0, -1), opening=side * across)

    return hand(end, across_end), hand(plate, across_plate)
