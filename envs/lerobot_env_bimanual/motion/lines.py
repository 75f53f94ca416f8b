"""Straight lines of the hand as joint paths.

The hand moves straight and turns by the shortest way, which leaves the arm one degree of freedom. First, the best
posture at the end of the line is chosen; all its postures are known in closed form. Then the straight path in joint
space from the start to that posture is projected onto the line, at all knots at once. The result is smooth and stays
near the shortest joint path. If the projection fails, dynamic programming searches all solutions at all knots; if
that fails too, the line is infeasible.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.geometry.rotations import rotation_vector
from lerobot_env_bimanual.robots.kinematics import NEAR_GRID_SPAN_DEG, ArmKinematics

Array = NDArray[np.floating]

STEP_M = 0.012
STEP_RAD = 0.06
"""Largest distance and turn of the hand between two knots."""
MIN_KNOTS = 6
MAX_JOINT_STEP_RAD = 0.25
"""A larger step between knots means that the path has jumped to another branch."""
END_MARGIN_WEIGHT = 0.03
"""Weight of limit closeness against squared joint travel, for the posture at the end of a line."""
KNOT_MARGIN_WEIGHT = 0.0005
"""The same for every knot of the search by dynamic programming."""
MAX_ENDS = 3
"""End postures, found with all values of the last joint, that are tried before the complete search."""
NEAR_M = 0.15
"""Travel of a hand from which on all values of the last joint are searched at once, instead of first those near its
present one; for turns, the threshold is half the span of the near search."""
DISTINCT_RAD = 0.2
"""Two end postures that are tried differ in some joint by more than this."""

MAX_NEWTON_STEPS = 12
LAST_STEP_ERROR = 5e-4
LAST_STEP_RAD = 5e-3
"""Newton's method ends with the step at which a knot's error, m and rad, and the joint step are below these. The error that
remains is about the step squared: 1e-9 in the median and 2e-5 at most. The ends of a line are exact."""
NEWTON_DAMPING = 1e-6
MAX_NEWTON_STEP_RAD = 0.6


@dataclass(frozen=True, eq=False)
class LineRequest:
    """A straight line that a hand is to follow.

    Attributes:
        kinematics: of the arm.
        start: (7,) rad, commanded joints at the start; the first knot.
        target: (4, 4) world pose of the tool centre point at the end.
    """

    kinematics: ArmKinematics
    start: Array
    target: Array


def straight_lines(requests: Sequence[LineRequest]) -> list[Array | None]:
    """Joint paths along straight lines of hands.

    All are computed together, which takes hardly longer than one; no result depends on the others.

    Returns:
        For each request its knots (n, 7) in rad at equal fractions of the line, or None if the line leaves the
        arm's reach.
    """
    presents = [request.kinematics.fk(request.start) for request in requests]
    poses = [line_poses(present, request.target) for present, request in zip(presents, requests, strict=True)]
    ends = [_end_postures(request, present) for request, present in zip(requests, presents, strict=True)]
    lines: list[Array | None] = [None] * len(requests)
    while tried := {
        index: end for index, line in enumerate(lines) if line is None for end in islice(ends[index], 1)
    }:
        for index, line in _project(requests, tried, poses).items():
            lines[index] = line
    return [
        _search(request, request_poses) if line is None else line
        for line, request, request_poses in zip(lines, requests, poses, strict=True)
    ]


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


def _end_postures(request: LineRequest, present: Array) -> Iterator[Array]:
    """Postures (7,) at the end of a line to be tried, best first: near the start's, and away from joint limits.

    The last joint follows the hand, so the whole of its range is searched only for a hand that goes further than
    `NEAR_M` or turns by more than half of `NEAR_GRID_SPAN_DEG` from its `present` pose (4, 4), or where the best
    posture near the start's has not led to a line.
    """
    kinematics, start, target = request.kinematics, request.start, request.target

    def ranked(solutions: Array) -> Iterator[Array]:
        order = np.argsort(kinematics.posture_cost(solutions, start, END_MARGIN_WEIGHT), kind="stable")
        return kinematics.distinct(solutions[order], target, DISTINCT_RAD)

    near = kinematics.ik(target, near_q7=start[-1])
    is_short = np.linalg.norm(target[:3, 3] - present[:3, 3]) < NEAR_M
    # The trace of one rotation times the inverse of another is 1 + 2 cos(angle between them).
    if is_short and np.vdot(present[:3, :3], target[:3, :3]) > 1.0 + 2.0 * np.cos(
        np.deg2rad(NEAR_GRID_SPAN_DEG / 2)
    ):
        yield from islice(ranked(near), 1)
    yield from islice(ranked(np.concatenate([near, kinematics.ik(target)])), MAX_ENDS)


def _project(
    requests: Sequence[LineRequest], ends: Mapping[int, Array], poses: Sequence[Array]
) -> dict[int, Array | None]:
    """Joint paths: the straight ways from the starts to `ends`, projected onto the poses (n, 4, 4).

    Each knot is projected by itself, from its place on the straight way. A path is None if some of its knots are
    not found, or if it jumps or leaves the joint limits. Keys of ends and paths are indices of requests.
    """
    straight, in_base = [], []
    for index, end in ends.items():
        start, count = requests[index].start, len(poses[index])
        straight.append(start + (end - start) * (np.arange(1, count + 1) / count)[:, None])
        in_base.append(requests[index].kinematics.in_base(poses[index]))
    kinematics = requests[0].kinematics  # in the frame of its base one arm is like the other
    joints, found = _nearest_solutions(kinematics, np.concatenate(straight), np.concatenate(in_base))
    borders = np.cumsum([len(part) for part in straight])[:-1]
    paths: dict[int, Array | None] = {}
    for index, knots, reached in zip(ends, np.split(joints, borders), np.split(found, borders), strict=True):
        path = np.concatenate([requests[index].start[None], knots])
        smooth = np.abs(np.diff(path, axis=0)).max() < MAX_JOINT_STEP_RAD
        feasible = smooth and reached.all() and requests[index].kinematics.within_limits(knots).all()
        paths[index] = path if feasible else None
    return paths


def _nearest_solutions(
    kinematics: ArmKinematics, joints: Array, targets: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """Newton's method with least joint steps from postures (n, 7) to poses (n, 4, 4) in the arm's base frame.

    Returns joints (n, 7), and (n,) whether they are a solution.
    """
    joints = joints.copy()
    damping = NEWTON_DAMPING * np.eye(6)
    open_knots = np.arange(len(joints))
    for _ in range(MAX_NEWTON_STEPS):
        poses, jacobian = kinematics.poses_and_jacobians(joints[open_knots])
        goals = targets[open_knots]
        error = np.empty((len(open_knots), 6))
        error[:, :3] = goals[:, :3, 3] - poses[:, :3, 3]
        turn = goals[:, :3, :3] @ poses[:, :3, :3].transpose(0, 2, 1)
        # Its skew part is the axis of the turn, times the sine of the angle.
        error[:, 3:] = 0.5 * (turn[:, (2, 0, 1), (1, 2, 0)] - turn[:, (1, 2, 0), (2, 0, 1)])
        transposed = jacobian.transpose(0, 2, 1)
        step = (transposed @ np.linalg.solve(jacobian @ transposed + damping, error[..., None]))[..., 0]
        step_rad = np.abs(step).max(axis=1)
        joints[open_knots] += step / np.maximum(1.0, step_rad / MAX_NEWTON_STEP_RAD)[:, None]
        is_last = (np.abs(error).max(axis=1) < LAST_STEP_ERROR) & (step_rad < LAST_STEP_RAD)
        # The error also vanishes at half a turn, where the trace is -1.
        is_last &= np.trace(turn, axis1=1, axis2=2) > 0
        open_knots = open_knots[~is_last]
        if not len(open_knots):
            break
    found = np.ones(len(joints), dtype=bool)
    found[open_knots] = False
    return joints, found


def _search(request: LineRequest, poses: Array) -> Array | None:
    """Path of least squared steps through all solutions at all poses (n, 4, 4), or None."""
    kinematics, start = request.kinematics, request.start
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
    exact = all(
        kinematics.is_exact_solution(joints, pose) for joints, pose in zip(path[1:], poses, strict=True)
    )
    return path if exact else None
