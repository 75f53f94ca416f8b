"""Straight lines of the hand as joint paths.

The hand moves straight and turns by the shortest way; the redundancy angle q7 is free. First q7 is led linearly
from its value at the start to a good value at the end, which gives smooth joint paths and costs one closed-form
solution per knot. If no such path stays within the joint limits, dynamic programming searches all of q7 at
every knot; if that fails too, the line is infeasible.
"""

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.geometry.rotations import matrix_from_rotation_vector, rotation_vector
from lerobot_env_bimanual.motion.kinematics import ArmKinematics

Array = NDArray[np.floating]

STEP_M = 0.012
STEP_RAD = 0.06
"""Largest distance and turn of the hand between two knots (design study)."""
MIN_KNOTS = 6
MAX_JOINT_STEP_RAD = 0.25
"""A larger step between knots means that the path has jumped to another branch."""
END_MARGIN_WEIGHT = 0.03
"""Weight of limit closeness against squared joint travel, for the posture at the end of a line."""
KNOT_MARGIN_WEIGHT = 0.0005
"""The same for every knot of the search by dynamic programming."""
MAX_ENDS = 8
"""Redundancy angles at the end that are tried before the complete search."""


def cartesian_line(kinematics: ArmKinematics, start: Array, target: Array) -> Array | None:
    """Joint path along a straight line of the hand.

    Args:
        kinematics: The arm.
        start: (7,) rad, commanded joints at the start; the first knot.
        target: (4, 4) world pose of the tool centre point at the end.

    Returns:
        Knots (n, 7) in rad at equal fractions of the line, or None if the line leaves the arm's reach.
    """
    knots = line_poses(kinematics.fk(start), target)
    ends = np.concatenate([kinematics.ik(target, near_q7=start[-1]), kinematics.ik(target)])
    if not len(ends):
        return None
    order = np.argsort(kinematics.posture_cost(ends, start, END_MARGIN_WEIGHT), kind="stable")
    flanges = kinematics.flange(knots)
    for end in ends[order[:MAX_ENDS]]:
        path = _follow(kinematics, start, flanges, end)
        if path is not None and _on_line(kinematics, path, knots):
            return path
    path = _search(kinematics, start, knots)
    return path if path is not None and _on_line(kinematics, path, knots) else None


def line_poses(start: Array, target: Array) -> Array:
    """Poses (n, 4, 4) at equal fractions of the straight line between two poses (4, 4), without the start."""
    turn = rotation_vector(target[:3, :3] @ start[:3, :3].T)
    shift = target[:3, 3] - start[:3, 3]
    steps = max(np.linalg.norm(shift) / STEP_M, np.linalg.norm(turn) / STEP_RAD)
    fractions = np.linspace(0.0, 1.0, max(MIN_KNOTS, int(np.ceil(steps))) + 1)[1:, None]
    poses = np.zeros((len(fractions), 4, 4))
    poses[:, :3, :3] = matrix_from_rotation_vector(turn * fractions) @ start[:3, :3]
    poses[:, :3, 3] = start[:3, 3] + shift * fractions
    poses[:, 3, 3] = 1.0
    poses[-1] = target
    return poses


def _follow(kinematics: ArmKinematics, start: Array, flanges: Array, end: Array) -> Array | None:
    """Path to the posture `end` with a linear redundancy angle, or None where it breaks off or jumps."""
    path = [start]
    for flange, q7 in zip(flanges, np.linspace(start[-1], end[-1], len(flanges) + 1)[1:], strict=True):
        joints = kinematics.ik_near(flange, path[-1], q7)
        if joints[0] != joints[0]:  # NaN: this branch has no solution here
            return None
        path.append(joints)
    joints = np.array(path)
    smooth = np.abs(np.diff(joints, axis=0)).max() < MAX_JOINT_STEP_RAD
    return joints if smooth and kinematics.within_limits(joints[1:]).all() else None


def _on_line(kinematics: ArmKinematics, path: Array, knots: Array) -> bool:
    return all(kinematics.reaches(joints, knot) for joints, knot in zip(path[1:], knots, strict=True))


def _search(kinematics: ArmKinematics, start: Array, knots: Array) -> Array | None:
    """Path of least squared steps through all solutions at all knots, or None."""
    layers, parents, cost = [start[None]], [], np.zeros(1)
    for knot in knots:
        solutions = kinematics.ik(knot)
        steps = np.abs(solutions[:, None] - layers[-1][None])
        arrival = np.where(steps.max(axis=2) < MAX_JOINT_STEP_RAD, (steps**2).sum(axis=2) + cost, np.inf)
        parent = arrival.argmin(axis=1)
        best = arrival[np.arange(len(solutions)), parent]
        reached = np.isfinite(best)
        if not reached.any():
            return None
        layers.append(solutions[reached])
        parents.append(parent[reached])
        cost = best[reached] + KNOT_MARGIN_WEIGHT * kinematics.limit_closeness(layers[-1])
    index = int(cost.argmin())
    path = []
    for layer, parent in zip(reversed(layers[1:]), reversed(parents), strict=True):
        path.append(layer[index])
        index = parent[index]
    return np.array([start, *reversed(path)])
