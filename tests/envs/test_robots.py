import numpy as np
import pytest

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.joint_action import GRIPPER_FRAMES
from lerobot_env_bimanual.robots import panda
from lerobot_env_bimanual.robots.panda_pair import PANDA_PAIR

GRIPPERS = (7, 15)


def test_motors_carry_the_weight_within_their_torque_limits(scene):
    held = scene.commanded
    for _ in range(5):
        scene.tick(held)
    joints = [scene.model.joint(name) for arm in ARMS for name in PANDA_PAIR.joint_names(arm)]
    weight = np.array([scene.data.qfrc_gravcomp[joint.dofadr[0]] for joint in joints]).reshape(2, 7)
    torque = np.array([scene.data.qfrc_actuator[joint.dofadr[0]] for joint in joints]).reshape(2, 7)
    assert torque == pytest.approx(weight, abs=0.1)
    assert np.abs(weight[:, 1]).min() > 20  # the shoulder's
    far = held.copy()
    far[[1, 9]] -= 1.0  # pull the shoulders up with all they have
    scene.tick(far)
    for arm in ARMS:
        shoulder = scene.model.joint(f"{arm.value}_joint2")
        assert abs(scene.data.qfrc_actuator[shoulder.dofadr[0]]) == pytest.approx(panda.TORQUE_LIMIT_NM[1])
    limits = scene.model.jnt_actfrcrange[[joint.id for joint in joints], 1]
    assert list(limits) == [*panda.TORQUE_LIMIT_NM] * 2


def test_the_hands_follow_a_fast_stroke_within_millimetres_half_a_tick_later(scene):
    goal = PANDA_PAIR.home_joints + np.array([0.5, 0.35, 0.0, -0.5, 0.1, 0.3, 0.2])

    def stroke(u: float) -> np.ndarray:
        u = min(max(u, 0.0), 1.0)
        return PANDA_PAIR.home_joints + (goal - PANDA_PAIR.home_joints) * (10 * u**3 - 15 * u**4 + 6 * u**5)

    errors = []
    for tick in range(1, 23):  # one second, and a little rest
        scene.tick(np.float32([*stroke(tick / 20), 1.0] * 2))
        for arm in ARMS:
            wanted = PANDA_PAIR.kinematics[arm].fk(stroke((tick - 0.5) / 20))
            errors.append(np.linalg.norm(scene.tcp(arm).position - wanted[:3, 3]))
    assert np.mean(errors) < 0.002
    assert np.max(errors) < 0.005


def test_a_folded_hand_meets_its_own_forearm(scene):
    folded = PANDA_PAIR.home_joints.copy()
    folded[5], folded[6] = 0.05, 2.0
    scene.pose_arms(np.tile(folded, (2, 1)))
    for arm in ARMS:
        assert scene.contacts(f"{arm.value}_link5", PANDA_PAIR.hand_body(arm))


@pytest.mark.parametrize("arm", ARMS)
def test_a_gripper_closes_opens_and_reports_it(scene, arm):
    command = scene.commanded
    assert scene.gripper_opening(arm) == pytest.approx(1.0, abs=1e-3)
    command[GRIPPERS[arm.ordinal]] = 0.0
    fingers = [scene.model.joint(name).dofadr[0] for name in PANDA_PAIR.finger_names(arm)]
    speeds = []
    for _ in range(GRIPPER_FRAMES):
        scene.tick(command)
        speeds.append(np.abs(scene.data.qvel[fingers]).max())
    assert np.median(speeds) == pytest.approx(PANDA_PAIR.finger_speed_m_s, rel=0.05)
    assert max(speeds) < 1.15 * PANDA_PAIR.finger_speed_m_s
    assert scene.gripper_opening(arm) < 0.02
    assert scene.gripper_opening(arm.other) == pytest.approx(1.0, abs=1e-3)
    assert np.ptp(scene.finger_positions(arm)) < 5e-4
    for _ in range(20 - GRIPPER_FRAMES):
        scene.tick(command)
    force_n = scene.data.actuator(f"{arm}_gripper").force[0]
    assert force_n / 2 == pytest.approx(-20.0, abs=4.0)  # on each of two fingers
    command[GRIPPERS[arm.ordinal]] = 0.5
    for _ in range(10):
        scene.tick(command)
    half = PANDA_PAIR.finger_target_m(0.5) / PANDA_PAIR.finger_travel_m
    assert scene.gripper_opening(arm) == pytest.approx(half, abs=0.02)
