"""Kinematics of an arm, and straight lines of its hand."""

import numpy as np

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual.motion import lines
from lerobot_env_bimanual.motion.feasibility import goal_postures
from lerobot_env_bimanual.motion.lines import LineRequest, line_poses, straight_lines
from lerobot_env_bimanual.robots.kinematics import LIMIT_SAFETY_RAD, ArmKinematics
from lerobot_env_bimanual.robots.panda_pair import PANDA_PAIR


def test_forward_kinematics_is_that_of_the_simulated_arm(scene, postures):
    for posture in postures:
        scene.pose_arms(np.tile(posture, (2, 1)))
        for arm in ARMS:
            assert np.abs(scene.arm_pair.kinematics[arm].fk(posture) - scene.tcp(arm).matrix).max() < 1e-6


def test_batched_poses_are_the_forward_kinematics_and_the_jacobian_is_their_derivative(kinematics, postures):
    poses, jacobian = kinematics.poses_and_jacobians(postures)
    expected = [kinematics.in_base(kinematics.fk(posture)) for posture in postures]
    assert np.allclose(poses, expected, atol=1e-9)
    for joint, step in enumerate(1e-6 * np.eye(7)):
        after, _ = kinematics.poses_and_jacobians(postures + step)
        before, _ = kinematics.poses_and_jacobians(postures - step)
        velocity = (after - before) / 2e-6
        assert np.allclose(velocity[:, :3, 3], jacobian[:, :3, joint], atol=1e-6)
        turning = np.cross(jacobian[:, 3:, joint, None], poses[:, :3, :3], axis=1)
        assert np.allclose(velocity[:, :3, :3], turning, atol=1e-6)


def test_solutions_reach_their_pose_within_the_limits_and_none_is_missing(kinematics, postures):
    count, bent = 0, 0
    for posture in postures:
        pose = kinematics.fk(posture)
        solutions = kinematics.ik(pose)
        exact = [kinematics.is_exact_solution(solution, pose) for solution in solutions]
        assert np.sum(exact) >= len(exact) - 1  # the closed form is inexact only at the edge of a branch
        assert (solutions > kinematics.lower + LIMIT_SAFETY_RAD).all()
        assert (solutions < kinematics.upper - LIMIT_SAFETY_RAD).all()
        count += len(solutions)
        if posture[3] < -0.5:  # elbows nearly straight are left out of the closed form
            bent += 1
            solutions = kinematics.ik(pose, near_q7=posture[6])
            assert np.abs(solutions - posture).max(axis=1).min() < 1e-6
    assert count > 10 * len(postures)
    assert bent > 20
    pose[:3, 3] += (0.0, 3.0, 0.0)
    assert kinematics.ik(pose).shape == (0, 7)


HOME = PANDA_PAIR.home_joints


def _line(kinematics: ArmKinematics, start: np.ndarray, target: np.ndarray) -> np.ndarray | None:
    (line,) = straight_lines([LineRequest(kinematics, start, target)])
    return line


def _lines(kinematics: ArmKinematics, count: int):
    """Random feasible lines of up to 40 cm and 60 degrees, from hands that point down."""
    rng = np.random.default_rng(0)
    while count:
        above = Pose.looking(rng.uniform((0.15, -0.3, 0.85), (0.4, 0.2, 1.1)), (0, 0, -1), rng.normal(size=3))
        start = goal_postures(kinematics, HOME, above.matrix)[0]
        shift, tilt = rng.uniform(-0.23, 0.23, 3), rng.uniform(-0.6, 0.6, 3)
        opening = above.rotation[:, 1] + tilt
        target = Pose.looking(above.position + shift, tilt * (1, 1, 0) - (0, 0, 1), opening).matrix
        path = _line(kinematics, start, target)
        if path is not None:
            yield start, target, path
            count -= 1


def test_a_line_leads_from_the_commanded_joints_to_the_target_in_small_steps_within_the_limits(kinematics):
    for start, target, path in _lines(kinematics, 10):
        assert np.array_equal(path[0], start)
        assert np.abs(kinematics.fk(path[-1]) - target).max() < 1e-6
        origin = kinematics.fk(start)[:3, 3]
        way = target[:3, 3] - origin
        for joints, limit in [(path, 2e-5), ((path[1:] + path[:-1]) / 2, 1e-3)]:
            points = np.array([kinematics.fk(posture)[:3, 3] for posture in joints]) - origin
            along = points @ way / (way @ way)
            assert np.linalg.norm(points - along[:, None] * way, axis=1).max() < limit
            assert (np.diff(along) > 0).all()
        poses = line_poses(kinematics.fk(start), target)
        assert len(path) == len(poses) + 1
        steps = np.diff(np.concatenate([kinematics.fk(start)[None], poses]), axis=0)
        assert np.linalg.norm(steps[:, :3, 3], axis=1).max() < lines.STEP_M + 1e-9
        assert np.abs(steps[:, :3, :3]).max() < lines.STEP_RAD + 1e-9
        assert np.abs(np.diff(path, axis=0)).max() < lines.MAX_JOINT_STEP_RAD
        assert kinematics.within_limits(path[1:]).all()


def test_the_shoulder_passes_its_upright_posture_smoothly():
    # With the upper arm upright, joints 1 and 3 turn about one axis and the closed form leaves them open.
    kinematics = PANDA_PAIR.kinematics[Arm.LEFT]
    start = np.array([0.384, -0.112, 0.461, -2.677, 0.093, 2.575, -0.259])
    target = kinematics.fk(start)
    target[2, 3] -= 0.1
    path = _line(kinematics, start, target)
    assert path is not None
    assert path[0, 1] < 0 < path[-1, 1]
    assert np.abs(np.diff(path, axis=0)).max() < 0.1


def test_the_search_over_all_solutions_stays_on_the_line_too(kinematics, monkeypatch):
    feasible = list(_lines(kinematics, 10))
    monkeypatch.setattr(lines, "_project", lambda requests, ends, poses: dict.fromkeys(ends))
    found = [(target, _line(kinematics, start, target)) for start, target, _ in feasible]
    paths = [(target, path) for target, path in found if path is not None]
    assert len(paths) >= 5
    for target, path in paths:
        assert kinematics.is_exact_solution(path[-1], target)
        assert np.abs(np.diff(path, axis=0)).max() < lines.MAX_JOINT_STEP_RAD


def test_two_lines_at_once_are_those_of_each_alone_whatever_one_of_them_reaches():
    arms = [PANDA_PAIR.kinematics[arm] for arm in ARMS]
    feasible = [next(_lines(kinematics, 1)) for kinematics in arms]
    requests = [LineRequest(kinematics, *line[:2]) for kinematics, line in zip(arms, feasible, strict=True)]
    for both, (_, _, alone) in zip(straight_lines(requests), feasible, strict=True):
        assert both is not None
        assert np.allclose(both, alone, rtol=0, atol=1e-12)
    far = arms[1].fk(HOME)
    far[2, 3] += 1.5
    found = straight_lines([requests[0], LineRequest(arms[1], HOME, far)])
    assert found[0] is not None
    assert found[1] is None
