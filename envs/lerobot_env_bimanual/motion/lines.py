"""Straight lines of the hand as joint paths.

The hand moves straight and turns by the shortest way, which leaves the arm one freedom. It is used like this: the
best posture at the end of the line is chosen first (closed form, all of them are known); then the straight way
in joint space from the start to that posture is projected onto the line, at all knots at once. The result is
smooth and stays near the shortest joint path. Where the projection fails, dynamic programming searches all
solutions at all knots; where that fails too, the line is infeasible.
"""

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.geometry.rotations import rotation_vector
from lerobot_env_bimanual.motion.jacobian import hand_frames
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
MAX_ENDS = 3
"""Postures at the end that are tried before the complete search."""
DISTINCT_RAD = 0.2
"""Two of them differ in some joint by at least this much."""

MAX_NEWTON_STEPS = 12
NEWTON_TOLERANCE = 1e-8
NEWTON_DAMPING = 1e-6
MAX_NEWTON_STEP_RAD = 0.6


def cartesian_line(kinematics: ArmKinematics, start: Array, target: Array) -> Array | None:
    """Joint path along a straight line of the hand.

    Args:
        kinematics: The arm.
        start: (7,) rad, commanded joints at the start; the first knot.
        target: (4, 4) world pose of the tool centre point at the end.

    Returns:
        Knots (n, 7) in rad at equal fractions of the line, or None if the line leaves the arm's reach.
    """
    poses = line_poses(kinematics.fk(start), target)
    for end in _end_postures(kinematics, start, target):
        path = _project(kinematics, start, end, poses)
        if path is not None:
            return path
    return _search(kinematics, start, poses)


def line_poses(start: Array, target: Array) -> Array:
    """Poses (n, 4, 4) at equal fractions of the straight line between two poses (4, 4), without the start."""
    turn = rotation_vector(target[:3, :3] @ start[:3, :3].T)
    shift = target[:3, 3] - start[:3, 3]
    angle = float(np.linalg.norm(turn))
    count = max(MIN_KNOTS, int(np.ceil(max(np.linalg.norm(shift) / STEP_M, angle / STEP_RAD))))
    fractions = np.arange(1, count + 1) / count
    # Rodrigues' formula: turned(u) = start + sin(u a) (k x start) + (1 - cos(u a)) (k x (k x start)).
    x, y, z = turn / angle if angle > 0 else turn
    axis_cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    cross = axis_cross @ start[:3, :3]
    twice = axis_cross @ cross
    sine, versine = np.sin(fractions * angle), 1.0 - np.cos(fractions * angle)
    poses = np.zeros((count, 4, 4))
    poses[:, :3, :3] = start[:3, :3] + sine[:, None, None] * cross + versine[:, None, None] * twice
    poses[:, :3, 3] = start[:3, 3] + fractions[:, None] * shift
    poses[:, 3, 3] = 1.0
    poses[-1] = target
    return poses


def _end_postures(kinematics: ArmKinematics, start: Array, target: Array) -> list[Array]:
    """The few best postures (7,) at a pose (4, 4): near the start's, and away from joint limits."""
    solutions = np.concatenate([kinematics.ik(target, near_q7=start[-1]), kinematics.ik(target)])
    order = np.argsort(kinematics.posture_cost(solutions, start, END_MARGIN_WEIGHT), kind="stable")
    return kinematics.distinct(solutions[order], target, DISTINCT_RAD, MAX_ENDS)


def _project(kinematics: ArmKinematics, start: Array, end: Array, poses: Array) -> Array | None:
    """The joint path from `start` to `end` that is straight but for what the poses (n, 4, 4) demand.

    Newton's method with least joint steps, from equally spaced postures on the straight way. None if it does
    not converge, or the path jumps or leaves the joint limits.
    """
    in_base = kinematics.in_base(poses)
    target_axes, target_position = in_base[:, :3, :3].transpose(2, 1, 0), in_base[:, :3, 3].T
    joints = start + (end - start) * (np.arange(1, len(poses) + 1) / len(poses))[:, None]
    damping = NEWTON_DAMPING * np.eye(6)
    for _ in range(MAX_NEWTON_STEPS):
        axes, position, jacobian = hand_frames(joints)
        error = np.concatenate([target_position - position, _turn_between(axes, target_axes)]).T
        if np.abs(error).max() < NEWTON_TOLERANCE:
            break
        transposed = jacobian.transpose(0, 2, 1)
        step = (transposed @ np.linalg.solve(jacobian @ transposed + damping, error[..., None]))[..., 0]
        joints = joints + step * min(1.0, MAX_NEWTON_STEP_RAD / np.abs(step).max())
    else:
        return None
    path = np.concatenate([start[None], joints])
    smooth = np.abs(np.diff(path, axis=0)).max() < MAX_JOINT_STEP_RAD
    # The error also vanishes at half a turn.
    upright = ((axes * target_axes).sum(axis=1) > 0).all()
    return path if smooth and upright and kinematics.within_limits(joints).all() else None


def _turn_between(axes: Array, targets: Array) -> Array:
    """Sine of the angle, times the axis, that turns frames (3, 3, n) of three axes onto others; (3, n)."""
    a, b = axes, targets
    crosses = [(a[:, i] * b[:, j] - a[:, j] * b[:, i]).sum(axis=0) for i, j in ((1, 2), (2, 0), (0, 1))]
    return 0.5 * np.stack(crosses)


def _search(kinematics: ArmKinematics, start: Array, poses: Array) -> Array | None:
    """Path of least squared steps through all solutions at all poses (n, 4, 4), or None."""
    layers, parents, cost = [start[None]], [], np.zeros(1)
    for pose in poses:
        solutions = kinematics.ik(pose)
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
    path = np.array([start, *reversed(path)])
    exact = all(kinematics.reaches(joints, pose) for joints, pose in zip(path[1:], poses, strict=True))
    return path if exact else None
