import frankik
import numpy as np
import pytest

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.robots.panda_pair import PANDA_PAIR
from lerobot_env_bimanual.world.scene import Scene

GRIPPERS = (7, 15)


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene()


def put_joints(scene: Scene, arm: Arm, joints: np.ndarray) -> None:
    for name, value in zip(PANDA_PAIR.joint_names(arm), joints, strict=True):
        scene.set_joint(name, value)


def action(left: np.ndarray, right: np.ndarray, gripper: float = 1.0) -> np.ndarray:
    return np.array([*left, gripper, *right, gripper], dtype=np.float32)


@pytest.mark.parametrize("arm", ARMS)
def test_forward_kinematics_equal_an_independent_implementation(scene, arm):
    rng = np.random.default_rng(0)
    for _ in range(50):
        joints = rng.uniform(PANDA_PAIR.joint_lower, PANDA_PAIR.joint_upper)
        put_joints(scene, arm, joints)
        expected = PANDA_PAIR.base_pose(arm).matrix @ frankik.fk(joints)
        assert np.abs(scene.tcp(arm).matrix - expected).max() < 1e-6
    scene.reset()


def test_the_arms_face_each_other_with_the_hands_down_at_home(scene):
    scene.reset()
    left, right = (scene.tcp(arm) for arm in ARMS)
    assert left.rotation[2, 2] < -0.95
    assert right.rotation[2, 2] < -0.95
    assert left.rotation[0, 2] > 0.2  # tilted towards +x, where the other arm stands
    assert right.rotation[0, 2] < -0.2
    assert scene.data.ncon == 0


def test_actuators_come_in_the_order_of_the_joint_action(scene):
    names = [scene.model.actuator(index).name for index in range(scene.model.nu)]
    assert names == [name for arm in ARMS for name in PANDA_PAIR.actuator_names(arm)]
    assert names[7] == "left_gripper"
    assert names[8] == "right_actuator1"


def test_only_the_fingers_are_coupled(scene):
    model = scene.model
    assert np.all(model.eq_type == mujoco.mjtEq.mjEQ_JOINT)
    assert [model.equality(index).name for index in range(model.neq)] == ["left_fingers", "right_fingers"]


def test_motors_carry_no_gravity(scene):
    rng = np.random.default_rng(1)
    scene.reset()
    for arm in ARMS:
        put_joints(scene, arm, PANDA_PAIR.home_joints + rng.uniform(-0.1, 0.1, 7))
    held = action(*(scene.joint_positions(arm) for arm in ARMS))
    for _ in range(20):
        scene.tick(held)
    assert not scene.unstable
    for arm, joints in zip(ARMS, (held[:7], held[8:15]), strict=True):
        assert np.abs(scene.joint_positions(arm) - joints).max() < 1e-4


def test_the_hands_follow_a_fast_stroke_within_millimetres(scene):
    scene.reset()
    goal = PANDA_PAIR.home_joints + np.array([0.5, 0.35, 0.0, -0.5, 0.1, 0.3, 0.2])
    errors = []
    for u in np.linspace(0, 1, 21)[1:]:  # one second
        joints = PANDA_PAIR.home_joints + (goal - PANDA_PAIR.home_joints) * (10 * u**3 - 15 * u**4 + 6 * u**5)
        scene.tick(action(joints, joints))
        for arm in ARMS:
            wanted = PANDA_PAIR.base_pose(arm).matrix @ frankik.fk(joints)
            errors.append(np.linalg.norm(scene.tcp(arm).position - wanted[:3, 3]))
    assert np.mean(errors) < 0.002
    assert np.max(errors) < 0.005
    scene.reset()


@pytest.mark.parametrize("arm", ARMS)
def test_a_gripper_closes_opens_and_reports_it(scene, arm):
    scene.reset()
    command = scene.commanded
    assert scene.gripper_opening(arm) == pytest.approx(1.0, abs=1e-3)
    command[GRIPPERS[arm.ordinal]] = 0.0
    for _ in range(10):
        scene.tick(command)
    assert scene.gripper_opening(arm) < 0.02
    assert scene.gripper_opening(arm.other) == pytest.approx(1.0, abs=1e-3)
    assert np.ptp(scene.finger_positions(arm)) < 5e-4
    command[GRIPPERS[arm.ordinal]] = 0.5
    for _ in range(10):
        scene.tick(command)
    half = (PANDA_PAIR.gripper_ctrl(0.5)) / PANDA_PAIR.finger_travel_m
    assert scene.gripper_opening(arm) == pytest.approx(half, abs=0.02)


def test_each_finger_presses_with_about_twenty_newtons_when_closed_on_nothing(scene):
    scene.reset()
    command = scene.commanded
    command[list(GRIPPERS)] = 0.0
    for _ in range(20):
        scene.tick(command)
    for arm in ARMS:
        force = scene.data.actuator(f"{arm.value}_gripper").force[0] / 2  # the servo drives two fingers
        assert force == pytest.approx(-20.0, abs=4.0)


def test_a_scene_refuses_robots_whose_actuators_are_in_another_order():
    from dataclasses import replace

    def gripper_first(spec, prefix, base):
        PANDA_PAIR.add_arm(spec, prefix, base)
        spec.actuator(f"{prefix}_actuator1").name = "swap"
        spec.actuator(f"{prefix}_actuator2").name = f"{prefix}_actuator1"
        spec.actuator("swap").name = f"{prefix}_actuator2"

    with pytest.raises(ValueError, match="order of the joint action"):
        Scene(arm_pair=replace(PANDA_PAIR, add_arm=gripper_first))
