"""Goal postures of keyposes: joint solutions of a pose, best first, and which are free of collisions.

The planner and the rehearsal ask the same questions here, so an arm goes to the posture from which the rest of the
script was found feasible.
"""

import itertools
from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import Arm
from lerobot_env_bimanual.motion.collision import CollisionChecker, CollisionRules
from lerobot_env_bimanual.robots.kinematics import ArmKinematics

Array = NDArray[np.floating]

GOAL_MARGIN_WEIGHT = 0.15
"""Weight of limit closeness against squared joint travel; with a smaller one wrists end so near their limits that the
next straight line is infeasible."""
MAX_CANDIDATES = 6
DISTINCT_RAD = 0.35
"""Postures closer than this in every joint count as one candidate."""

STAY_M = 1e-4
STAY_RAD = 1e-3


def is_at_target(kinematics: ArmKinematics, joints: Array, target: Array) -> bool:
    """Whether joints (7,) already are at the target pose (4, 4), so that the arm must not move at all."""
    difference = np.square(kinematics.fk(joints) - target)
    # Two rotation matrices that are a small angle apart differ by sqrt(2) times that angle.
    return bool(difference[:3, 3].sum() < STAY_M**2 and difference[:3, :3].sum() < 2 * STAY_RAD**2)


def goal_postures(kinematics: ArmKinematics, start: Array, target: Array) -> list[Array]:
    """Up to six clearly different postures (7,) at a pose (4, 4), cheapest first; empty if out of reach."""
    solutions = kinematics.ik(target)
    order = np.argsort(kinematics.posture_cost(solutions, start, GOAL_MARGIN_WEIGHT), kind="stable")
    return list(itertools.islice(kinematics.distinct(solutions[order], target, DISTINCT_RAD), MAX_CANDIDATES))


def free_goals(
    checker: CollisionChecker,
    rules: CollisionRules,
    standing: Mapping[Arm, Array],
    candidates: Mapping[Arm, list[Array]],
) -> Iterator[tuple[dict[Arm, Array], str | None]]:
    """Every choice of one candidate per arm, best first, with what is in its way; None if it is free of collisions.

    Args:
        checker: that has looked at the scene.
        rules: of the motion.
        standing: (7,) rad, where an arm without candidates is.
        candidates: postures (7,) per arm, best first.
    """
    # Those with the smallest sum of ranks come first.
    ranks = sorted(itertools.product(*(range(len(postures)) for postures in candidates.values())), key=sum)
    for choice in ranks:
        goal = {arm: postures[rank] for (arm, postures), rank in zip(candidates.items(), choice, strict=True)}
        both = {**standing, **goal}
        yield goal, checker.obstacle(rules, both[Arm.LEFT], both[Arm.RIGHT])
