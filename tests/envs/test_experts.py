"""Experts solve their episodes within the limits of load, and the baselines do not."""

from dataclasses import replace
from functools import cache, partial
from itertools import pairwise

import numpy as np
import pytest
from sample_results import LIGHT

from lerobot_bimanual.codec import KeyposeCodec
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.rotations import quat_wxyz_from_axis_angle, rotation_angle_rad
from lerobot_bimanual.keypose import BimanualKeypose, Keypose
from lerobot_bimanual.keypose_layout import KEYPOSE_NAMES
from lerobot_bimanual.results.episode import LoadMetrics
from lerobot_env_bimanual import play_expert
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts import load as load_module
from lerobot_env_bimanual.experts.baselines import Layout, demonstrations, make_player, mean_of_episodes
from lerobot_env_bimanual.experts.load import BOUNDS, LoadMeter, excesses, keyframes_found, run_measured
from lerobot_env_bimanual.experts.runner import MAX_TIP_ERROR_MM, expert, run_episode
from lerobot_env_bimanual.robots.panda_pair import PANDA_PAIR
from lerobot_env_bimanual.tasks.registry import get_task, list_tasks
from lerobot_env_bimanual.world.arena import PHYSICS_STEP_S
from lerobot_env_bimanual.world.contact_forces import low_pass_filter
from lerobot_env_bimanual.world.scene import Scene
from lerobot_env_bimanual.world.servo_commands import STEPS_PER_TICK, TICK_S

SEED = 0
TASK_NAMES = list_tasks()


@pytest.fixture(scope="module")
def env_of():
    return cache(partial(BimanualEnv, obs="state", split="val"))


@pytest.mark.parametrize(("seed", "codec"), [(0, None), (1, KeyposeCodec()), (2, KeyposeCodec())])
@pytest.mark.parametrize("name", TASK_NAMES)
def test_the_expert_solves_its_task_with_exact_and_rounded_keyposes(env_of, name, seed, codec):
    outcome = run_episode(env_of(name), seed, expert(codec))
    assert outcome.success, outcome
    assert outcome.unmet == ()
    assert outcome.line_fallbacks == 0, outcome
    assert outcome.late_moves == (), outcome
    assert outcome.ticks <= 0.8 * env_of(name).task_definition.spec.horizon_ticks


def test_the_outcome_reports_the_keyposes_as_they_were_executed(env_of):
    moves = []
    outcome = run_episode(env_of("handover_item_easy"), SEED, expert(KeyposeCodec()), moves.append)
    assert [report.name for report in outcome.moves] == [move.name for move in moves]
    assert outcome.last_move == moves[-1].name
    assert sum(report.ticks for report in outcome.moves) == outcome.ticks
    codec = KeyposeCodec()
    for command, move in zip(outcome.commands, moves, strict=True):
        assert np.array_equal(np.float32(command), move.action)
        rounded = codec.discretise(BimanualKeypose.from_vector(move.action)).to_vector()
        assert np.allclose(rounded, move.action, atol=1e-5)
    in_free_space = outcome.moves[0]
    assert max(in_free_space.left_error_mm, in_free_space.right_error_mm) < 3


def test_holding_still_ends_with_the_time(env_of):
    env = env_of("lift_ball")
    outcome = run_episode(env, SEED, make_player("noop", seed=0))
    assert outcome.failure == "out of time"
    assert outcome.unmet
    assert outcome.ticks == env.task_definition.spec.horizon_ticks


def test_a_hand_that_does_not_reach_its_target_is_reported_unless_it_presses_a_prop(env_of):
    env = env_of("lift_ball")
    solved = run_episode(env, SEED, expert())
    squeeze = solved.moves[1]
    assert max(squeeze.left_error_mm, squeeze.right_error_mm) > MAX_TIP_ERROR_MM
    assert solved.late_moves == ()

    def silent(env):
        for move in expert()(env):
            yield replace(move, presses=None)

    assert 1 in run_episode(env, SEED, silent).late_moves


def test_the_open_loop_baseline_plays_the_given_keyposes_and_skips_what_it_cannot_reach(env_of):
    solved = run_episode(env_of("lift_ball"), SEED, expert())
    keyposes = solved.commands
    replayed = run_episode(env_of("lift_ball"), SEED, make_player("open_loop", 0, mean_keyposes=keyposes))
    assert replayed.success
    assert replayed.state_hash == solved.state_hash

    far = np.array(keyposes[1])
    far[KEYPOSE_NAMES.index("left_x")] = 5.0
    with_detour = make_player("open_loop", 0, mean_keyposes=[keyposes[0], far])
    outcome = run_episode(env_of("lift_ball"), SEED, with_detour)
    assert outcome.failure == "no move left"
    assert outcome.commands[1][:3] == pytest.approx(keyposes[0][:3])
    assert outcome.commands[1][9:12] == pytest.approx(keyposes[1][9:12])


def test_the_nearest_baseline_plays_the_demonstration_of_the_scene_that_is_most_alike(env_of, monkeypatch):
    monkeypatch.setattr("lerobot_env_bimanual.experts.baselines.DEMONSTRATIONS", 3)
    demonstrations.cache_clear()
    known = BimanualEnv("lift_ball", split="train", obs="state")
    same = run_episode(known, 1, make_player("nearest", 0))
    assert same.success
    assert same.commands == run_episode(known, 1, expert()).commands

    known.reset(seed=1)
    shown = demonstrations("lift_ball", 0, "standard")
    here, found = Layout.of(known), [layout for layout, _ in shown]
    assert [here.distance_m(layout) < 1e-6 for layout in found] == [False, True, False]
    unknown = run_episode(env_of("lift_ball"), SEED, make_player("nearest", 0)).commands
    nearest = min(found, key=Layout.of(env_of("lift_ball")).distance_m)
    _, keyposes = shown[found.index(nearest)]
    assert unknown[0] == tuple(keyposes[0].tolist())
    demonstrations.cache_clear()


def test_mean_keyposes_average_positions_rotations_and_flags_of_episodes_of_the_usual_length():
    def keypose(x_m, angle_rad, gripper_open):
        pose = Pose((x_m, 0, 1), quat_wxyz_from_axis_angle((0, 0, 1), angle_rad))
        return BimanualKeypose(*[Keypose(pose, gripper_open, True)] * 2).to_vector()

    episodes = [[keypose(0.1, 3.0, True)], [keypose(0.2, 3.2, True)], [keypose(0.3, 3.4, False)]]
    (mean,) = mean_of_episodes([*episodes, [keypose(0.5, 0, True)] * 2])
    target = BimanualKeypose.from_vector(mean)
    for arm in (target.left, target.right):
        assert arm.pose.position == pytest.approx((0.2, 0, 1))
        expected = quat_wxyz_from_axis_angle((0, 0, 1), 3.2)
        assert rotation_angle_rad(arm.pose.quat_wxyz, expected) == pytest.approx(0, abs=1e-4)
        assert arm.gripper_open
        assert arm.ignore_collisions


@pytest.mark.parametrize("name", [name for name in TASK_NAMES if len(get_task(name).spec.variations) > 1])
def test_the_script_of_the_expert_is_among_the_scripts_for_all_instructions(env_of, name):
    env = env_of(name)
    for variation in get_task(name).spec.variations:
        env.reset(seed=0, options={"variation": variation.index})
        first = [
            next(iter(script(env.scene)))
            for script in env.task_definition.scripts_for_all_instructions(env.scene)
        ]
        expert = next(iter(env.task_definition.script(env.scene, variation)))
        poses = [_poses(stage) for stage in first]
        assert any(np.allclose(pose, _poses(expert)) for pose in poses)
        assert len({tuple(pose.round(6)) for pose in poses}) == len(poses)


def _poses(stage) -> np.ndarray:
    poses = [pose for pose in (stage.left, stage.right) if pose is not None]
    return np.concatenate([pose.matrix.ravel() for pose in poses])


def test_frames_of_an_expert_hold_the_actions_that_solve_the_task() -> None:
    frames = list(play_expert("lift_ball", seed=3, obs="state"))
    env = BimanualEnv("lift_ball", obs="state")
    observation, info = env.reset(seed=3)
    for frame in frames:
        np.testing.assert_array_equal(frame.observation["ee_pose"], observation["ee_pose"])
        observation, *_, info = env.step(frame.action)
    assert info["is_success"]
    assert {frame.keypose.shape for frame in frames} == {(18,)}
    assert not any(np.shares_memory(a.keypose, b.keypose) for a, b in pairwise(frames))


MEASURED_SEED = 3


@pytest.mark.parametrize("mode", ["none", "joint", "keypose"])
def test_measuring_leaves_an_episode_as_it_is_and_its_replay_goes_through_the_same_states(env_of, mode):
    env = env_of("lift_ball")
    found = run_measured(env, MEASURED_SEED, expert(), mode)
    assert not env.tick_observers
    assert not env.step_observers
    assert found.keyframes_found
    assert found.replayed is (None if mode == "none" else True)
    unmeasured = found.model_copy(update={"load": None, "keyframes_found": None, "replayed": None})
    assert unmeasured == run_episode(env, MEASURED_SEED, expert())  # the last state's hash among all else


def test_a_replay_of_other_actions_and_keyframes_at_other_ticks_are_reported(env_of, monkeypatch):
    env, actions = env_of("lift_ball"), []
    with env.observed_by(lambda _, action: actions.append(action.copy())):
        ticks = [move.ticks for move in run_episode(env, MEASURED_SEED, expert()).moves]
    assert keyframes_found(np.array(actions), ticks)
    assert not keyframes_found(np.array(actions), [ticks[0] + 5, ticks[1] - 5, *ticks[2:]])

    def changed(env, seed, actions, hashes):
        return replays(env, seed, [actions[0] + np.float32(1e-6), *actions[1:]], hashes)

    replays = load_module.replays
    monkeypatch.setattr(load_module, "replays", changed)
    assert run_measured(env, MEASURED_SEED, expert(), "keypose").replayed is False


def test_arms_that_hold_still_touch_nothing_and_carry_their_own_weight():
    scene = Scene()
    meter = LoadMeter(scene)
    for _ in range(2):
        meter.observe_tick()
        scene.tick(scene.commanded, [meter.observe_step])
    load = meter.result()
    assert (load.velocity, load.acceleration, load.jerk, load.contact_force_n) == (0, 0, 0, 0)
    assert (load.penetration_mm, load.penetrating) == (0, "")
    assert load.torque > 0.1  # joint 2 holds up an arm that reaches out
    assert load.finger_speed_m_s == pytest.approx(0, abs=1e-3)


def test_commands_are_differentiated_over_ticks():
    scene = Scene()
    meter = LoadMeter(scene)
    action, speed_rad_s = scene.commanded, 0.5
    for _ in range(4):  # as if joint 1 of the left arm started at once
        action[0] += speed_rad_s * TICK_S
        meter.observe_tick()
        scene.tick(action)
    meter.observe_step()
    load = meter.result()
    acceleration_rad_s2 = speed_rad_s / TICK_S
    expected = (
        (load.velocity, speed_rad_s / PANDA_PAIR.velocity_limit_rad_s[0]),
        (load.acceleration, acceleration_rad_s2 / PANDA_PAIR.acceleration_limit_rad_s2[0]),
        (load.jerk, acceleration_rad_s2 / PHYSICS_STEP_S / PANDA_PAIR.jerk_limit_rad_s3[0]),
    )
    for found, value in expected:
        assert found == pytest.approx(value, rel=1e-3)


def test_the_low_pass_filter_keeps_a_lasting_force_and_weakens_a_brief_one():
    lasting, knock = np.zeros((2, 10 * STEPS_PER_TICK, 2, 3))
    lasting[:, 0, 2] = 50.0
    knock[7, 0, 2] = 50.0
    assert low_pass_filter(lasting).max() == pytest.approx(50.0, rel=1e-3)
    assert 5.0 < low_pass_filter(knock).max() < 7.0


def test_every_number_has_a_bound_and_what_is_beyond_it_is_named():
    assert list(excesses("lift_ball", LIGHT)) == []
    heavy = LoadMetrics(**dict.fromkeys(BOUNDS, 1000.0), penetrating="pad, cube")
    found = dict(excesses("lift_ball", heavy))
    assert [*found] == [*BOUNDS]
    assert found["penetration_mm"] == "penetration_mm is 1e+03 (pad, cube), but must be at most 2"
