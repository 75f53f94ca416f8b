import numpy as np
import pytest

from lerobot_bimanual.arms import Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.props.block import Block
from lerobot_env_bimanual.props.target import Target
from lerobot_env_bimanual.world.scene import MAX_SETTLE_TICKS, PHYSICS_STEP_S, STEPS_PER_TICK, Scene

ON_TABLE = Pose.upright((0.25, 0.1, 0.7905))


@pytest.fixture(scope="module")
def shared() -> Scene:
    return Scene([Block(), Target()])


@pytest.fixture
def scene(shared: Scene) -> Scene:
    shared.reset()
    return shared


def test_a_tick_is_fifty_milliseconds_of_physics(scene):
    assert STEPS_PER_TICK == 25
    before = scene.data.time
    scene.tick(scene.commanded)
    assert scene.data.time - before == pytest.approx(0.05)
    assert scene.model.opt.timestep == PHYSICS_STEP_S == 0.002


def test_the_clock_starts_after_settling(scene):
    scene.settle()
    assert scene.data.time > 0
    assert scene.ticks == 0
    scene.tick(scene.commanded)
    assert scene.ticks == 1


def test_a_placed_block_rests_on_the_table(scene):
    scene.place("item", ON_TABLE)
    assert scene.pose("item").distance_to(ON_TABLE)[0] < 1e-12
    scene.settle()
    assert scene.pose("item").distance_to(ON_TABLE)[0] < 2e-3
    assert scene.speed("item") < 1e-4
    assert not scene.unstable


def test_a_static_prop_is_placed_and_reset_takes_it_back(scene):
    pose = Pose.upright((0.1, 0.2, 0.75), 0.4)
    scene.place("target", pose)
    assert max(scene.pose("target").distance_to(pose)) < 1e-6
    scene.settle()
    assert max(scene.pose("target").distance_to(pose)) < 1e-6
    scene.reset()
    assert np.abs(scene.pose("target").position).max() == 0


def test_a_color_lasts_until_the_next_reset(scene):
    pristine = scene.model.geom("item").rgba.copy()
    scene.set_color("item", (0, 0, 1, 1))
    assert scene.model.geom("item").rgba == pytest.approx((0, 0, 1, 1))
    scene.reset()
    assert scene.model.geom("item").rgba == pytest.approx(pristine)


def test_reset_starts_with_arms_at_home_and_open_hands(scene):
    for arm in Arm:
        assert scene.joint_positions(arm) == pytest.approx(scene.arm_pair.home_joints)
        assert scene.gripper_opening(arm) == 1.0
    assert not scene.data.qvel.any()
    assert scene.commanded[[7, 15]] == pytest.approx((1.0, 1.0))


def test_poses_and_contacts_belong_to_the_current_positions_after_a_tick(scene):
    scene.place("item", ON_TABLE.translated((0, 0, 0.2)))
    for _ in range(3):  # falling
        scene.tick(scene.commanded)
    fresh = mujoco.MjData(scene.model)
    fresh.qpos[:] = scene.data.qpos
    mujoco.mj_kinematics(scene.model, fresh)
    assert scene.speed("item") > 1.0
    assert np.array_equal(fresh.xpos, scene.data.xpos)


def test_the_speed_of_a_falling_block_is_that_of_free_fall(scene):
    scene.place("item", ON_TABLE.translated((0, 0, 0.5)))
    scene.tick(scene.commanded)
    scene.tick(scene.commanded)
    assert scene.speed("item") == pytest.approx(9.81 * 0.1, rel=0.01)


def grasp(scene: Scene, arm: Arm) -> np.ndarray:
    """Close a hand on the block where the hand is now, without gravity while it closes."""
    scene.place("item", scene.tcp(arm))
    gravity = scene.model.opt.gravity.copy()
    scene.model.opt.gravity[:] = 0
    command = scene.commanded
    command[7 + 8 * arm.ordinal] = 0.0
    for _ in range(10):
        scene.tick(command)
    scene.model.opt.gravity[:] = gravity
    return command


@pytest.mark.parametrize("arm", Arm)
def test_friction_alone_holds_a_block_and_lets_it_go(scene, arm):
    command = grasp(scene, arm)
    start = scene.tcp(arm).inverse() @ scene.pose("item")
    for _ in range(40):
        scene.tick(command)
    assert scene.held(arm, "item")
    assert scene.touching(arm, "item")
    assert scene.arm_touches(arm, "item")
    assert not scene.arm_touches(arm.other, "item")
    slip_m, turn_rad = start.distance_to(scene.tcp(arm).inverse() @ scene.pose("item"))
    assert slip_m < 0.001
    assert turn_rad < 0.05
    command[7 + 8 * arm.ordinal] = 1.0
    for _ in range(4):
        scene.tick(command)
    assert not scene.held(arm, "item")
    for _ in range(4):
        scene.tick(command)
    assert not scene.arm_touches(arm, "item")
    assert not scene.unstable


def test_a_held_block_is_touched_by_each_finger_and_not_by_the_forearm(scene):
    grasp(scene, Arm.LEFT)
    assert scene.contacts("left_finger1", "item")
    assert scene.contacts("item", "left_finger2")
    assert not scene.contacts("right_hand", "item")
    assert not scene.held(Arm.RIGHT, "item")


def test_a_diverging_state_is_reported_until_reset(scene, caplog, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scene.place("item", ON_TABLE)
    scene.settle(1)
    assert not scene.unstable
    scene.data.qvel[:] = np.nan
    scene.tick(scene.commanded)
    assert scene.unstable
    assert "unstable" in caplog.text
    assert not list(tmp_path.iterdir())  # MuJoCo's own habit is a log file where the user stands
    state = scene.save_state()
    scene.reset()
    assert not scene.unstable
    scene.restore_state(state)
    assert scene.unstable


def test_targets_between_ticks_are_interpolated_with_the_servos_lead(scene, monkeypatch):
    seen = []
    step = mujoco.mj_step

    def spy(model, data):
        seen.append(data.ctrl.copy())
        step(model, data)

    monkeypatch.setattr(mujoco, "mj_step", spy)
    start = scene.commanded.astype(np.float64)
    change = np.zeros(16)
    change[3] = 0.02
    change[7] = -1.0  # close the left gripper
    scene.tick((start + change).astype(np.float32))
    lead = scene.arm_pair.servo_lead_s / 0.05
    ticks = np.arange(2, 26) / 25
    joint = np.array([ctrl[3] for ctrl in seen])
    assert joint == pytest.approx(start[3] + 0.02 * (ticks + lead), abs=1e-6)
    assert [ctrl[7] for ctrl in seen] == pytest.approx([scene.arm_pair.gripper_closed_ctrl] * 24)
    assert [ctrl[15] for ctrl in seen] == pytest.approx([scene.arm_pair.gripper_open_ctrl] * 24)


def test_readings_are_copies(scene):
    position = scene.pose("item").position
    joints = scene.joint_positions(Arm.LEFT)
    commanded = scene.commanded
    before = scene.state_hash()
    position += 1
    joints += 1
    commanded += 1
    assert scene.state_hash() == before


def test_settling_ends_when_all_props_sleep_or_the_time_is_up(scene):
    scene.place("item", ON_TABLE)
    scene.settle()
    resting_s = scene.data.time
    scene.reset()
    scene.place("item", ON_TABLE.translated((0, 0, 1.0)))
    scene.settle()
    assert resting_s < scene.data.time == pytest.approx(MAX_SETTLE_TICKS * 0.05)
