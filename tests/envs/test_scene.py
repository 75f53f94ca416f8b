import numpy as np
import pytest

from lerobot_bimanual.arms import Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual.conditions import Held, Touched, Untouched
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.props.block import Block
from lerobot_env_bimanual.props.target import Target
from lerobot_env_bimanual.world.arena import PHYSICS_STEP_S
from lerobot_env_bimanual.world.scene import MAX_SETTLE_TICKS, Scene
from lerobot_env_bimanual.world.servo_commands import STEPS_PER_TICK, TICK_S

ON_TABLE = Pose.upright((0.25, 0.1, 0.7905))


@pytest.fixture
def scene(scene_of) -> Scene:
    return scene_of(Block(), Target())


def test_a_tick_is_fifty_milliseconds_of_physics_and_an_episode_begins_at_home_with_open_hands(scene):
    for arm in Arm:
        assert scene.joint_positions(arm) == pytest.approx(scene.arm_pair.home_joints)
        assert scene.gripper_opening(arm) == 1.0
    assert not scene.data.qvel.any()
    assert scene.commanded[[7, 15]] == pytest.approx((1.0, 1.0))
    before = scene.data.time
    scene.tick(scene.commanded)
    assert scene.data.time - before == pytest.approx(TICK_S) == STEPS_PER_TICK * PHYSICS_STEP_S
    assert not scene.data.timer.duration.any()  # no clock is read while physics runs
    assert scene.model.opt.timestep == PHYSICS_STEP_S == 0.002


def test_props_are_placed_and_rest_on_the_table_and_reset_takes_them_back(scene):
    pose = Pose.upright((0.1, 0.2, 0.75), 0.4)
    scene.place("target", pose)
    scene.place("item", ON_TABLE)
    assert scene.pose("item").distance_to(ON_TABLE)[0] < 1e-12
    scene.settle()
    assert scene.data.time < MAX_SETTLE_TICKS * TICK_S
    assert scene.pose("item").distance_to(ON_TABLE)[0] < 2e-3
    assert scene.speed("item") < 1e-4
    assert max(scene.pose("target").distance_to(pose)) < 1e-6
    assert not scene.unstable
    scene.reset()
    assert np.abs(scene.pose("target").position).max() == 0


def test_poses_and_contacts_belong_to_the_current_positions_after_a_tick(scene):
    scene.place("item", ON_TABLE.translated((0, 0, 0.5)))
    scene.tick(scene.commanded)
    scene.tick(scene.commanded)
    fresh = mujoco.MjData(scene.model)
    fresh.qpos[:] = scene.data.qpos
    mujoco.mj_kinematics(scene.model, fresh)
    assert scene.speed("item") == pytest.approx(9.81 * 0.1, rel=0.01)  # free fall
    assert np.array_equal(fresh.xpos, scene.data.xpos)


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
    assert Held("item", arm)(scene)
    assert Touched("item", arm)(scene)
    assert not Untouched("item", arm)(scene)
    assert all(scene.contacts(f"{arm}_finger{finger}", "item") for finger in (1, 2))
    assert not Held("item", arm.other)(scene)
    assert not Touched("item", arm.other)(scene)
    assert Untouched("item", arm.other)(scene)
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
    tcp = scene.tcp(arm)  # a block jammed between wide open fingers is not held
    scene.place("item", Pose.looking(tcp.position, approach=tcp.rotation[:, 1], opening=tcp.rotation[:, 2]))
    scene.tick(scene.commanded)
    assert all(scene.contacts(f"{arm}_finger{finger}", "item") for finger in (1, 2))
    assert not scene.held(arm, "item")


def test_a_diverging_state_is_reported_until_reset_and_leaves_no_trace(scene, caplog, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scene.place("item", ON_TABLE)
    scene.settle(5)
    settled = scene.state_hash()
    assert not scene.unstable
    scene.data.qvel[:] = np.nan
    scene.tick(scene.commanded)
    assert scene.unstable
    assert "unstable" in caplog.text
    assert not list(tmp_path.iterdir())  # by default MuJoCo writes a log to the working directory
    state = scene.save_state()
    scene.reset()
    assert not scene.unstable
    scene.place("item", ON_TABLE)
    scene.settle(5)
    assert scene.state_hash() == settled
    scene.restore_state(state)
    assert scene.unstable


def test_all_that_a_reset_may_change_and_the_last_bit_of_the_last_command_are_in_the_hash(scene):
    scene.place("item", ON_TABLE)
    state, hashes = scene.save_state(), [scene.state_hash()]
    command = scene.commanded
    other = command.copy()
    other[0] = np.nextafter(command[0], np.float32(1))
    for change in (
        lambda: scene.set_color("target", (0, 1, 0, 1)),
        lambda: scene.place("target", Pose.upright((0.3, 0.3, 0.75))),
        lambda: scene.place("item", Pose.upright((0.0, 0.3, 0.80))),
        lambda: scene.tick(command),
        lambda: scene.tick(other),
    ):
        scene.restore_state(state)
        change()
        hashes.append(scene.state_hash())
    assert len(set(hashes)) == len(hashes)


def commands_of_every_step(scene: Scene, actions: np.ndarray, monkeypatch) -> np.ndarray:
    """Actuator commands (ticks * 25, 16) while these joint actions (ticks, 16) are carried out."""
    seen = []
    for function in ("mj_step2", "mj_step"):  # with these every step of physics begins
        real = getattr(mujoco, function)

        def spy(model, data, real=real):
            seen.append(data.ctrl.copy())
            real(model, data)

        monkeypatch.setattr(mujoco, function, spy)
    for action in actions:
        scene.tick(action)
    monkeypatch.undo()
    return np.array(seen)


def test_commanded_acceleration_between_ticks_is_that_of_the_actions(scene, monkeypatch):
    actions = np.tile(scene.commanded.astype(np.float64), (8, 1))
    actions[2:, 3] += np.cumsum([0.01, 0.03, 0.04, 0.02, 0.0, 0.0])
    actions = actions.astype(np.float32)
    commands = commands_of_every_step(scene, actions, monkeypatch)[:, 3].reshape(8, 25)
    by_actions = np.diff(actions[:, 3].astype(np.float64), n=2) / 0.05**2
    # Between two ticks the command steps, by what velocity and inertia need to be fed forward.
    accelerations = np.diff(commands[2:], n=2, axis=1) / PHYSICS_STEP_S**2
    assert accelerations == pytest.approx(np.repeat(by_actions[:, None], 23, axis=1), abs=0.05)
    assert commands[-1] == pytest.approx(actions[-1, 3], abs=1e-6)


def test_a_hand_that_lets_go_does_so_at_once_and_closes_at_the_hands_pace(scene, monkeypatch):
    pair = scene.arm_pair
    closed, opened = scene.commanded, scene.commanded
    closed[7] = 0.0
    closing = commands_of_every_step(scene, np.tile(closed, (12, 1)), monkeypatch)[:, 7]
    assert -np.diff(closing).min() == pytest.approx(pair.finger_speed_m_s * PHYSICS_STEP_S)
    assert closing[-1] == pair.closed_travel_m
    opening = commands_of_every_step(scene, np.tile(opened, (10, 1)), monkeypatch)[:, 7]
    assert opening[0] == pytest.approx(0.0, abs=1e-3)  # where the fingers are
    assert np.diff(opening).max() == pytest.approx(pair.finger_speed_m_s * PHYSICS_STEP_S)
    assert scene.gripper_opening(Arm.LEFT) == pytest.approx(1.0, abs=0.02)
