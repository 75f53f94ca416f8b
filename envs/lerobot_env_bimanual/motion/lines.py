"""Straight lines of the hand as joint paths.

The hand moves straight and turns by the shortest way, which leaves the arm one freedom. It is used like this: the
best posture at the end of the line is chosen first (closed form, all of them are known); then the straight way
in joint space from the start to that posture is projected onto the line, at all knots at once. The result is
smooth and stays near the shortest joint path. Where the projection fails, dynamic programming searches all
solutions at all knots; where that fails too, the line is infeasible.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import Arm
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
NEWTON_TOLERANCE = 1e-5
"""Error of a knot between the ends, m and rad; the ends are exact."""
NEWTON_DAMPING = 1e-6
MAX_NEWTON_STEP_RAD = 0.6


def straight_lines(
    kinematics: Mapping[Arm, ArmKinematics], starts: Mapping[Arm, Array], targets: Mapping[Arm, Array]
) -> dict[Arm, Array | None]:
    """Joint paths along straight lines of the hands.

    Args:
        kinematics: Of both arms.
        starts: (7,) rad, commanded joints at the start; the first knot.
        targets: (4, 4) world pose of the tool centre point at the end, of the arms that move. Both are computed
            together, which takes hardly longer than one; neither result depends on the other.

    Returns:
        For each arm of `targets` its knots (n, 7) in rad at equal fractions of the line, or None if the line leaves
        the arm's reach.
    """
    poses = {arm: line_poses(kinematics[arm].fk(starts[arm]), target) for arm, target in targets.items()}
    ends = {arm: _end_postures(kinematics[arm], starts[arm], target) for arm, target in targets.items()}
    lines: dict[Arm, Array | None] = dict.fromkeys(targets)
    for rank in range(MAX_ENDS):
        tried = {arm: ends[arm][rank] for arm in targets if lines[arm] is None and rank < len(ends[arm])}
        if tried:
            lines |= _project(kinematics, starts, tried, poses)
    for arm, line in lines.items():
        if line is None:
            lines[arm] = _search(kinematics[arm], starts[arm], poses[arm])
    return lines


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


def _project(
    kinematics: Mapping[Arm, ArmKinematics],
    starts: Mapping[Arm, Array],
    ends: Mapping[Arm, Array],
    poses: Mapping[Arm, Array],
) -> dict[Arm, Array | None]:
    """The joint paths from `starts` to `ends` that are straight but for what the poses (n, 4, 4) demand.

    Each knot is found by itself, from its place on the straight way. None for an arm whose knots are not all
    found, or whose path jumps or leaves the joint limits.
    """
    straight = [
        starts[arm] + (end - starts[arm]) * (np.arange(1, len(poses[arm]) + 1) / len(poses[arm]))[:, None]
        for arm, end in ends.items()
    ]
    in_base = [kinematics[arm].in_base(poses[arm]) for arm in ends]
    joints, found = _nearest_solutions(np.concatenate(straight), np.concatenate(in_base))
    borders = np.cumsum([len(part) for part in straight])[:-1]
    paths: dict[Arm, Array | None] = {}
    for arm, knots, reached in zip(ends, np.split(joints, borders), np.split(found, borders), strict=True):
        path = np.concatenate([starts[arm][None], knots])
        smooth = np.abs(np.diff(path, axis=0)).max() < MAX_JOINT_STEP_RAD
        feasible = smooth and reached.all() and kinematics[arm].within_limits(knots).all()
        paths[arm] = path if feasible else None
    return paths


def _nearest_solutions(joints: Array, targets: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Newton's method with least joint steps, from postures (n, 7) to poses (n, 4, 4) in the arm's base frame.

    Returns:
        Joints (n, 7), and (n,) whether they are a solution.
    """
    damping = NEWTON_DAMPING * np.eye(6)
    error = np.empty((len(joints), 6))
    found = np.zeros(len(joints), dtype=bool)
    for _ in range(MAX_NEWTON_STEPS):
        poses, jacobian = hand_frames(joints)
        error[:, :3] = targets[:, :3, 3] - poses[:, :3, 3]
        turn = targets[:, :3, :3] @ poses[:, :3, :3].transpose(0, 2, 1)
        # Its skew part is the axis of the turn, times the sine of the angle.
        error[:, 3:] = 0.5 * (turn[:, (2, 0, 1), (1, 2, 0)] - turn[:, (1, 2, 0), (2, 0, 1)])
        # It also vanishes at half a turn, where the trace is -1.
        found = (np.abs(error).max(axis=1) < NEWTON_TOLERANCE) & (np.trace(turn, axis1=1, axis2=2) > 0)
        if found.all():
            break
        transposed = jacobian.transpose(0, 2, 1)
        step = (transposed @ np.linalg.solve(jacobian @ transposed + damping, error[..., None]))[..., 0]
        joints = joints + step * np.minimum(
            1.0, MAX_NEWTON_STEP_RAD / np.abs(step).max(axis=1, keepdims=True)
        )
    return joints, found


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
