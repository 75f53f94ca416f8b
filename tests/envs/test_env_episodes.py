"""How keyposes are executed and how episodes end; episodes are reproducible bit for bit."""

import copy
import hashlib
import pickle
import re
import subprocess
import sys
from itertools import product
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from test_conditions import When

from lerobot_bimanual.errors import InvalidChoice
from lerobot_bimanual.joint_action import by_arm
from lerobot_env_bimanual.conditions import Always
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.episode.progress import SUCCESS_TICKS
from lerobot_env_bimanual.options import SETTINGS, SPLITS
from lerobot_env_bimanual.registry import AXES
from lerobot_env_bimanual.tasks.registry import get_task
from lerobot_env_bimanual.world.servo_commands import TICK_S

TASK = "lift_ball"


def test_a_keypose_moves_both_hands_there_and_counts(state_env, keypose_below):
    state_env.reset(seed=1)
    target = keypose_below(state_env)
    observation, reward, terminated, truncated, info = state_env.step(target)
    assert (reward, terminated, truncated, info["failure"]) == (0.0, False, False, "")
    assert observation["keypose_step"] == [1.0]
    assert info["ticks"] > 5
    for pose, goal in zip(np.split(observation["ee_pose"], 2), np.split(target, 2), strict=True):
        assert np.allclose(pose[:3], goal[:3], atol=5e-3)


@pytest.mark.parametrize(
    ("entries", "numbers", "failure"),
    [(slice(9, 12), (-0.25, 0.45, 1.55), "right arm: "), (slice(12, 16), 0, "right arm: zero quaternion")],
)
def test_an_impossible_keypose_ends_its_episode(entries, numbers, failure, state_env, keypose_below):
    state_env.reset(seed=1)
    action = keypose_below(state_env)
    action[entries] = numbers
    _, reward, terminated, truncated, info = state_env.step(action)
    assert (reward, terminated, truncated, info["is_success"]) == (0.0, True, False, False)
    assert info["failure"].startswith(failure)
    with pytest.raises(gym.error.ResetNeeded):
        state_env.step(action)


def test_steps_report_all_conditions_but_ticks_stop_at_an_unmet_one(state_env, keypose_below, monkeypatch):
    looks = {"first": 0, "second": 0}

    def look(name: str) -> bool:
        looks[name] += 1
        return name == "second"

    conditions = tuple(When(name, lambda name=name: look(name)) for name in looks)
    monkeypatch.setattr(state_env.task_definition, "conditions", lambda _: conditions)
    for info in (state_env.reset(seed=1)[1], state_env.step(keypose_below(state_env))[4]):
        assert info["conditions"] == {"when(first)": False, "when(second)": True}
    assert info["ticks"] > 1
    assert looks == {"first": 1 + info["ticks"], "second": 2}


def test_success_needs_all_conditions_for_half_a_second(state_env, monkeypatch):
    state_env.reset(seed=1)
    met = [True] * (SUCCESS_TICKS - 1) + [False] + [True] * SUCCESS_TICKS
    verdicts = iter(met)
    conditions = (When("easy", lambda: True), When("hard", lambda: next(verdicts)))
    monkeypatch.setattr(state_env.task_definition, "conditions", lambda _: conditions)
    results = [state_env.step(state_env.scene.commanded)[1:3] for _ in met]
    assert results == [(0.0, False)] * (len(met) - 1) + [(1.0, True)]


def test_conditions_on_the_way_are_part_of_the_state_and_its_hash(state_env, monkeypatch):
    state_env.reset(seed=1)
    good = [True]
    always = Always((When("good", lambda: good[0]),))
    monkeypatch.setattr(state_env.task_definition, "conditions", lambda _: (always,))
    state_env.step(state_env.scene.commanded)
    saved, hashes = state_env.save_state(), []
    for good[0] in (True, False):
        state_env.restore_state(saved)
        state_env.step(state_env.scene.commanded)
        hashes.append(state_env.state_hash())
        good[0] = True
        *_, info = state_env.step(state_env.scene.commanded)
        assert info["conditions"] == {always.name: len(hashes) == 1}
    assert hashes[0] != hashes[1]


def test_success_ends_a_keypose_at_once(state_env, monkeypatch, keypose_below):
    state_env.reset(seed=1)
    monkeypatch.setattr(state_env.task_definition, "conditions", lambda _: (When("done", lambda: True),))
    _, reward, terminated, _, info = state_env.step(keypose_below(state_env, 0.2))
    assert (reward, terminated, info["is_success"], info["ticks"]) == (1.0, True, True, SUCCESS_TICKS)


def test_a_keypose_is_held_until_its_success_is_decided(state_env, monkeypatch, keypose_below):
    state_env.reset(seed=1)
    saved = state_env.save_state()
    _, _, _, _, info = state_env.step(keypose_below(state_env))
    duration = info["ticks"]
    state_env.restore_state(saved)
    late = When("late", lambda: state_env.progress.ticks >= duration)
    monkeypatch.setattr(state_env.task_definition, "conditions", lambda _: (late,))
    _, _, terminated, _, info = state_env.step(keypose_below(state_env))
    assert (terminated, info["ticks"]) == (True, duration + SUCCESS_TICKS - 1)


def test_an_episode_is_truncated_at_its_horizon_or_after_its_last_keypose(state_env, keypose_below):
    state_env.reset(seed=1)
    horizon = get_task(TASK).spec.horizon_ticks
    state_env.progress.ticks = horizon - 2
    assert state_env.step(state_env.scene.commanded)[2:4] == (False, False)
    assert state_env.step(state_env.scene.commanded)[2:4] == (False, True)
    env = BimanualEnv(TASK, obs="state", control_mode="keypose", max_keyposes=2)
    env.reset(seed=1)
    down, back = keypose_below(env, 0.1), keypose_below(env, 0.0)
    assert env.step(down)[2:4] == (False, False)
    assert env.step(back)[2:4] == (False, True)
    assert env._max_episode_steps == 2


def test_a_warning_of_mujoco_ends_the_episode(state_env):
    state_env.reset(seed=1)
    state_env.scene.data.warning[0].number += 1
    _, _, terminated, _, info = state_env.step(state_env.scene.commanded)
    assert (terminated, info["is_success"], info["failure"]) == (True, False, "simulation_unstable")


def test_learned_joint_targets_are_clipped_to_the_limits_and_reached_as_fast_as_the_arm_can(state_env):
    state_env.reset(seed=1)
    pair, home = state_env.scene.arm_pair, state_env.scene.commanded
    target = home + np.float32(0.6)
    target[8:] = 100.0
    with state_env.observed_by(lambda _, action: actions.append(action)):
        actions, info = [home, home], {}
        for _ in range(40):
            *_, info = state_env.step(target)
    joints = np.array([by_arm(action)[:, :-1] for action in actions], dtype=np.float64)
    speeds = np.diff(joints, axis=0) / TICK_S
    assert (np.abs(speeds) <= pair.velocity_limit_rad_s).all()
    accelerations = np.diff(speeds, axis=0) / TICK_S
    assert (np.abs(accelerations[:, 0]) <= pair.acceleration_limit_rad_s2).all()
    assert accelerations.max() > 0.99 * pair.acceleration_limit_rad_s2.max()
    assert (joints[:, 0] <= target[:7] + 0.02).all()  # it slows down in time
    assert np.allclose(actions[-1][:8], state_env.action_space.high[:8].clip(max=target[:8]))
    assert np.allclose(actions[-1][8:], state_env.action_space.high[8:])
    assert info["clipped_rad"] > 2.0
    assert 5 < info["clipped_ticks"] < 40


def test_an_arm_that_presses_for_long_ends_the_episode_only_with_protective_stop():
    ends = []
    for protective_stop in (False, True):
        env = BimanualEnv(TASK, obs="state", protective_stop=protective_stop)
        _, info = env.reset(seed=3)
        for _ in range(100):
            press = env.scene.commanded
            press[1] += 0.05  # the left shoulder: the hand goes down onto the table, and on
            *_, terminated, truncated, info = env.step(press)
            if terminated or truncated:
                break
        ends.append(info["failure"])
    assert not ends[0]
    assert re.fullmatch("protective stop: the left arm pressed with [1-9][0-9][0-9] N", ends[1])


def hash_sequence(env: BimanualEnv, seed: int, ticks: int = 5) -> list[str]:
    """The state after the reset and after each tick of a random walk of the arms."""
    env.reset(seed=seed)
    hashes = [env.state_hash()]
    steps = np.random.default_rng(seed).uniform(-0.05, 0.05, (ticks, 16))
    for action in (env.scene.commanded + np.cumsum(steps, axis=0)).astype(np.float32):
        env.step(action)
        hashes.append(env.state_hash())
    return hashes


def perturbed_sequence() -> list[str]:
    """`hash_sequence` with every axis at its highest level, and a hash of the last observation."""
    perturb = ",".join(f"{axis}:3" for axis in AXES.names if axis != "stiffness")  # the task has no joints
    env = BimanualEnv(TASK, image_size=16, perturb=perturb)
    hashes, observation = hash_sequence(env, seed=7), env.observe()
    images = [*observation.pop("pixels").values(), *observation.values()]
    return [*hashes, hashlib.sha256(b"".join(image.tobytes() for image in images)).hexdigest()]


def test_same_seed_gives_the_same_bits_in_another_process_and_with_images(state_env):
    script = (
        "import sys; sys.path.insert(0, sys.argv[1]); import test_env_episodes as t;"
        f"print(*t.hash_sequence(t.BimanualEnv({TASK!r}, obs='state'), seed=7), *t.perturbed_sequence())"
    )
    command = [sys.executable, "-c", script, str(Path(__file__).parent)]
    output = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    hashes = hash_sequence(state_env, seed=7)
    assert output.split() == [*hashes, *perturbed_sequence()]
    assert hash_sequence(BimanualEnv(TASK, image_size=(24, 32)), seed=7) == hashes


def test_an_interrupted_tick_leaves_no_trace_in_the_next_episode():
    env = BimanualEnv(TASK, obs="state", protective_stop=True)
    expected = hash_sequence(env, seed=3, ticks=1)
    env.reset(seed=3)
    while env.progress.filtered_forces_n.max() < 20:
        press = env.scene.commanded
        press[1] += 0.05
        env.step(press)
    steps = iter(range(20))
    with env.observed_by(lambda *_: None, lambda: next(steps)), pytest.raises(StopIteration):
        env.step(press)
    assert hash_sequence(env, seed=3, ticks=1) == expected


@pytest.mark.parametrize("options", [{"task": "push_box"}, {"setting": "varied"}, {"perturb": "size:3"}])
def test_a_state_of_another_world_is_refused_and_changes_nothing(options, state_env, instant_placement):
    other = BimanualEnv(**{"task": TASK} | options, obs="state")
    for env in (other, state_env):
        env.reset(seed=0)
    before = state_env.state_hash()
    with pytest.raises(InvalidChoice, match=f"but must be '{TASK} test'"):
        state_env.restore_state(other.save_state())
    assert state_env.state_hash() == before


def test_a_seed_means_another_episode_in_every_split_and_setting():
    places_m = set()
    for split, setting in product(SPLITS, SETTINGS):
        env = BimanualEnv("dual_push_buttons", obs="state", split=split, setting=setting)
        env.reset(seed=0)
        places_m.add(tuple(env.scene.pose("left_button").position[:2]))
    assert len(places_m) == len(SPLITS) * len(SETTINGS) == 6


def test_variations_of_a_seed_share_no_layout():
    env, cabinets = BimanualEnv("put_item_in_drawer", obs="state"), set()
    for variation in range(3):
        env.reset(seed=5, options={"variation": variation})
        cabinets.add(tuple(env.scene.pose("cabinet").position))
    assert len(cabinets) == 3


def test_reset_without_seed_continues_the_generator_of_the_last_seed(state_env):
    def unseeded_episodes() -> list[str]:
        state_env.reset(seed=4)
        return [state_env.state_hash() for _ in range(2) if state_env.reset()]

    episodes = unseeded_episodes()
    assert len(set(episodes)) == 2
    assert unseeded_episodes() == episodes


@pytest.mark.parametrize("duplicate", [copy.copy, copy.deepcopy, pickle.dumps])
def test_a_running_environment_is_not_copied_so_that_no_two_share_a_world(duplicate, state_env):
    state_env.reset(seed=0)
    with pytest.raises(TypeError, match=r"save_state\(\)"):
        duplicate(state_env)


@pytest.mark.parametrize(
    "duplicate",
    [copy.copy, copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))],
    ids=["copy", "deep", "pickle"],
)
def test_a_copy_of_an_environment_between_episodes_has_a_world_of_its_own(duplicate):
    env = BimanualEnv("push_box", obs="state")
    assert env.scene.ticks == 0  # its world exists
    other = duplicate(env)
    assert other.tick_observers is not env.tick_observers
    states = []
    for each in (env, other):
        each.reset(seed=3)
        each.step(each.scene.commanded)
        states.append(each.state_hash())
    other.reset(seed=4)
    assert states == [env.state_hash()] * 2
