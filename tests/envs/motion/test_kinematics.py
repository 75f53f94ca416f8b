import numpy as np

from lerobot_bimanual.arms import ARMS
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.robots.kinematics import LIMIT_SAFETY_RAD


def test_forward_kinematics_is_that_of_the_simulated_arm(scene, postures):
    data = mujoco.MjData(scene.model)
    for arm in ARMS:
        kinematics = scene.arm_pair.kinematics[arm]
        site = scene.model.site(scene.arm_pair.tcp_site(arm)).id
        joints = [scene.model.joint(name).qposadr[0] for name in scene.arm_pair.joint_names(arm)]
        for posture in postures:
            data.qpos[joints] = posture
            mujoco.mj_kinematics(scene.model, data)
            pose = kinematics.fk(posture)
            assert np.abs(pose[:3, 3] - data.site_xpos[site]).max() < 1e-6
            assert np.abs(pose[:3, :3] - data.site_xmat[site].reshape(3, 3)).max() < 1e-6


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


def test_solutions_reach_their_pose_within_the_limits_and_are_all_there_are(kinematics, postures):
    count, bent = 0, 0
    for posture in postures:
        pose = kinematics.fk(posture)
        solutions = kinematics.ik(pose)
        exact = [kinematics.reaches(solution, pose) for solution in solutions]
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
