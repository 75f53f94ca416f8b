"""The environment keeps Gymnasium's contract, its own contract of bits, and speaks clearly when misused."""

import itertools
import subprocess
import sys
import warnings
from pathlib import Path
from typing import get_args

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.dataset import schema
from lerobot_bimanual.errors import (
    InvalidAction,
    InvalidChoice,
    UnknownCamera,
    UnknownTask,
    UnknownVariation,
)
from lerobot_bimanual.keypose import BimanualKeypose, Keypose
from lerobot_env_bimanual.env import SUCCESS_TICKS, BimanualEnv
from lerobot_env_bimanual.registry import get_task, list_tasks
from lerobot_env_bimanual.settings import ControlMode, ObservationMode

TASK = "lift_ball"
ACTIONS_ARE_NOT_NORMALISED = ".*recommend using a symmetric and normalized space"


@pytest.fixture(scope="module")
def state_env():
    env = BimanualEnv(TASK, obs="state")
    yield env
    env.close()


@pytest.fixture(scope="module")
def rgbd_env():
    env = BimanualEnv(TASK, image_size=(24, 32))
    yield env
    env.close()


def wiggle(env: BimanualEnv, seed: int, ticks: int) -> list[np.ndarray]:
    """Joint actions of a random walk that starts where the arms stand."""
    rng = np.random.default_rng(seed)
    steps = rng.uniform(-0.05, 0.05, (ticks, 16))
    return list((env.scene.commanded + np.cumsum(steps, axis=0)).astype(np.float32))


def hash_sequence(env: BimanualEnv, seed: int, ticks: int = 5) -> list[str]:
    env.reset(seed=seed)
    hashes = [env.state_hash()]
    for action in wiggle(env, seed, ticks):
        env.step(action)
        hashes.append(env.state_hash())
    return hashes


def keypose_below(env: BimanualEnv, drop_m: float = 0.1, gripper_open: bool = True) -> np.ndarray:
    """Both hands straight down from where they are."""
    poses = [env.scene.tcp(arm) for arm in ARMS]
    targets = [pose.translated((0.0, 0.0, -drop_m)) for pose in poses]
    return BimanualKeypose(*(Keypose(target, gripper_open, True) for target in targets)).to_vector()


@pytest.fixture
def instant_placement(monkeypatch):
    """Take the first placement as it is drawn; rehearsing it is most of a reset's time."""
    monkeypatch.setattr("lerobot_env_bimanual.motion.rehearsal.rehearse", lambda *_: None)


def assert_follows_gymnasiums_api(env: BimanualEnv) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", message=ACTIONS_ARE_NOT_NORMALISED)
        check_env(env, skip_render_check=env.spec is None)
    env.close()


MODES = list(itertools.product(get_args(ControlMode), get_args(ObservationMode)))


@pytest.mark.parametrize(("task", "modes"), list(zip(list_tasks(), itertools.cycle(MODES), strict=False)))
def test_every_task_follows_gymnasiums_api_in_some_modes(task, modes, instant_placement):
    control_mode, obs = modes
    assert_follows_gymnasiums_api(BimanualEnv(task, control_mode=control_mode, obs=obs, image_size=16))


@pytest.mark.slow
@pytest.mark.parametrize(("control_mode", "obs"), MODES)
@pytest.mark.parametrize("task", list_tasks())
def test_every_task_follows_gymnasiums_api_in_all_modes(task, control_mode, obs, instant_placement):
    assert_follows_gymnasiums_api(BimanualEnv(task, control_mode=control_mode, obs=obs, image_size=16))


def test_environments_made_by_gymnasium_follow_its_api_and_render(instant_placement):
    env = gym.make("bimanual/LiftBall-v0", cameras=("front",), image_size=16).unwrapped
    assert isinstance(env, BimanualEnv)
    assert_follows_gymnasiums_api(env)


def test_every_registered_task_has_a_gymnasium_id():
    ids = {name for name in gym.registry if name.startswith("bimanual/")}
    assert ids == {
        f"bimanual/{''.join(part.title() for part in task.split('_'))}-v0" for task in list_tasks()
    }


def test_observation_has_the_names_and_shapes_of_the_dataset(rgbd_env):
    observation, _ = rgbd_env.reset(seed=0)
    names = {f"observation.{key}": value for key, value in observation.items()}
    names[schema.STATE] = names.pop("observation.agent_pos")
    pixels = names.pop("observation.pixels")
    names |= {schema.image_key(camera): image for camera, image in pixels.items()}
    for key, feature in schema.features(CAMERA_NAMES, 24, 32, "frames").items():
        if key == schema.NEXT_KEYPOSE or not key.startswith("observation."):
            assert key not in names
            continue
        value = names.pop(key)
        if feature["dtype"] == "float32":
            assert value.dtype == np.float32
            assert value.shape == feature["shape"]
        elif feature.get("info"):
            assert value.dtype == np.float32
            assert value.shape == (1, 24, 32)
        else:
            assert value.dtype == np.uint8
            assert value.shape == (24, 32, 3)
    assert not names


def test_depth_is_in_millimetres(rgbd_env):
    observation, _ = rgbd_env.reset(seed=0)
    assert 300 < np.median(observation["images.front_depth"]) <= 4000


def test_vectors_say_where_the_arms_are(state_env):
    observation, _ = state_env.reset(seed=0)
    scene = state_env.scene
    for arm, agent, pose in zip(
        ARMS, np.split(observation["agent_pos"], 2), np.split(observation["ee_pose"], 2), strict=True
    ):
        assert np.allclose(agent[:7], scene.joint_positions(arm), atol=1e-6)
        assert agent[7] == pytest.approx(1.0, abs=0.02)
        assert np.allclose(pose[:3], scene.tcp(arm).position, atol=1e-6)
    assert np.allclose(observation["gripper_fingers"], 0.04, atol=1e-3)


@pytest.mark.parametrize(
    ("obs", "present", "absent"),
    [
        ("rgb", {"pixels", "camera_extrinsics", "agent_pos"}, {"images.front_depth"}),
        ("state", {"camera_intrinsics", "ee_pose", "agent_pos"}, {"pixels", "images.front_depth"}),
    ],
)
def test_observation_modes_leave_images_out(obs, present, absent):
    keys = set(BimanualEnv(TASK, obs=obs).observation_space.spaces)
    assert present <= keys
    assert not absent & keys


def test_only_the_chosen_cameras_are_observed_while_calibration_covers_all(rgbd_env):
    env = BimanualEnv(TASK, cameras=("left_wrist",), image_size=16)
    observation, _ = env.reset(seed=0)
    env.close()
    assert set(observation["pixels"]) == {"left_wrist"}
    assert [key for key in observation if key.endswith("_depth")] == ["images.left_wrist_depth"]
    assert observation["camera_extrinsics"].shape == (80,)


def test_info_is_complete_and_without_success_at_reset(state_env):
    for seed in range(3):
        _, info = state_env.reset(seed=seed)
        assert info["is_success"] is False
        assert info["conditions"]
        assert not all(info["conditions"].values())
        assert info["failure"] == ""
        assert (info["ticks"], info["line_fallbacks"]) == (0, 0)
        _, _, _, _, info = state_env.step(state_env.scene.commanded)
        assert info["is_success"] is False
        assert info["ticks"] == 1


def test_same_seed_gives_the_same_bits_after_other_episodes(state_env):
    first = hash_sequence(state_env, seed=7)
    hash_sequence(state_env, seed=8)
    state_env.reset(seed=9)
    state_env.step(keypose_below(state_env))
    assert hash_sequence(state_env, seed=7) == first
    assert len(set(first)) == len(first)


def test_same_seed_gives_the_same_bits_in_another_process(state_env):
    script = (
        "import sys; sys.path.insert(0, sys.argv[1]); import test_env_api as t;"
        f"print(*t.hash_sequence(t.BimanualEnv({TASK!r}, obs='state'), seed=7))"
    )
    command = [sys.executable, "-c", script, str(Path(__file__).parent)]
    output = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert output.split() == hash_sequence(state_env, seed=7)


def test_observing_does_not_change_the_simulation(state_env, rgbd_env):
    assert hash_sequence(rgbd_env, seed=3) == hash_sequence(state_env, seed=3)


def test_a_seed_means_another_episode_in_every_split():
    hashes = set()
    for split in ("train", "val", "test"):
        env = BimanualEnv(TASK, obs="state", split=split)
        env.reset(seed=5)
        hashes.add(env.state_hash())
        env.close()
    assert len(hashes) == 3


def test_reset_without_seed_continues_the_generator_of_the_last_seed(state_env):
    def unseeded_episodes() -> list[str]:
        state_env.reset(seed=4)
        hashes = []
        for _ in range(2):
            state_env.reset()
            hashes.append(state_env.state_hash())
        return hashes

    episodes = unseeded_episodes()
    assert len(set(episodes)) == 2
    assert unseeded_episodes() == episodes


def test_a_restored_state_continues_bit_for_bit(state_env):
    state_env.reset(seed=2)
    actions = wiggle(state_env, 2, 8)
    for action in actions[:3]:
        state_env.step(action)
    saved = state_env.save_state()

    def rest() -> tuple[list[str], dict]:
        hashes = []
        for action in actions[3:]:
            _, _, _, _, info = state_env.step(action)
            hashes.append(state_env.state_hash())
        state_env.step(keypose_below(state_env))
        return [*hashes, state_env.state_hash()], info

    expected = rest()
    state_env.reset(seed=11)
    for _ in range(2):
        state_env.restore_state(saved)
        assert rest() == expected


def test_a_keypose_is_the_joint_actions_that_the_listener_saw(state_env):
    heard = []
    state_env.tick_listener = lambda env, action: heard.append((env.progress.ticks, action.copy()))
    state_env.reset(seed=1)
    state_env.step(keypose_below(state_env, gripper_open=False))
    after_keypose = state_env.state_hash()
    state_env.tick_listener = None
    assert [tick for tick, _ in heard] == list(range(len(heard)))

    state_env.reset(seed=1)
    for _, action in heard:
        state_env.step(action)
    assert state_env.state_hash() == after_keypose


def test_a_keypose_moves_both_hands_there_and_counts(state_env):
    state_env.reset(seed=1)
    target = keypose_below(state_env)
    observation, reward, terminated, truncated, info = state_env.step(target)
    assert (reward, terminated, truncated, info["failure"]) == (0.0, False, False, "")
    assert observation["keypose_step"] == [1.0]
    assert info["ticks"] > 5
    for pose, goal in zip(np.split(observation["ee_pose"], 2), np.split(target, 2), strict=True):
        assert np.allclose(pose[:3], goal[:3], atol=5e-3)


def test_an_unreachable_keypose_ends_the_episode_and_names_the_arm(state_env):
    state_env.reset(seed=1)
    action = keypose_below(state_env)
    action[9:12] = [-0.25, 0.45, 1.55]
    _, reward, terminated, truncated, info = state_env.step(action)
    assert (reward, terminated, truncated, info["is_success"]) == (0.0, True, False, False)
    assert "right" in info["failure"]
    with pytest.raises(gym.error.ResetNeeded):
        state_env.step(action)


def test_success_needs_all_conditions_for_half_a_second(state_env, monkeypatch):
    state_env.reset(seed=1)
    met = [True] * (SUCCESS_TICKS - 1) + [False] + [True] * SUCCESS_TICKS
    verdicts = iter(met)
    monkeypatch.setattr(
        state_env.task_definition, "check", lambda *_: {"easy": True, "hard": next(verdicts)}, raising=True
    )
    results = [state_env.step(state_env.scene.commanded)[1:3] for _ in met]
    assert results == [(0.0, False)] * (len(met) - 1) + [(1.0, True)]


def test_success_ends_a_keypose_at_once(state_env, monkeypatch):
    state_env.reset(seed=1)
    monkeypatch.setattr(state_env.task_definition, "check", lambda *_: {"done": True})
    _, reward, terminated, _, info = state_env.step(keypose_below(state_env, 0.2))
    assert (reward, terminated, info["is_success"], info["ticks"]) == (1.0, True, True, SUCCESS_TICKS)


def test_a_keypose_waits_for_the_verdict(state_env, monkeypatch):
    state_env.reset(seed=1)
    saved = state_env.save_state()
    _, _, _, _, info = state_env.step(keypose_below(state_env))
    duration = info["ticks"]
    state_env.restore_state(saved)
    monkeypatch.setattr(
        state_env.task_definition, "check", lambda *_: {"late": state_env.progress.ticks >= duration}
    )
    _, _, terminated, _, info = state_env.step(keypose_below(state_env))
    assert (terminated, info["ticks"]) == (True, duration + SUCCESS_TICKS - 1)


def test_an_episode_is_truncated_at_its_horizon(state_env):
    state_env.reset(seed=1)
    horizon = get_task(TASK).spec.horizon_ticks
    state_env.progress.ticks = horizon - 2
    assert state_env.step(state_env.scene.commanded)[2:4] == (False, False)
    assert state_env.step(state_env.scene.commanded)[2:4] == (False, True)


def test_an_episode_is_truncated_after_its_last_keypose():
    env = BimanualEnv(TASK, obs="state", control_mode="keypose", max_keyposes=2)
    env.reset(seed=1)
    down, back = keypose_below(env, 0.1), keypose_below(env, 0.0)
    assert env.step(down)[2:4] == (False, False)
    assert env.step(back)[2:4] == (False, True)
    assert env._max_episode_steps == 2
    env.close()


def test_a_warning_of_mujoco_ends_the_episode(state_env):
    state_env.reset(seed=1)
    state_env.scene.data.warning[0].number += 1
    _, _, terminated, _, info = state_env.step(state_env.scene.commanded)
    assert (terminated, info["is_success"], info["failure"]) == (True, False, "simulation_unstable")


def test_learned_joint_targets_are_clipped_to_the_limits():
    env = BimanualEnv(TASK, obs="state")
    env.reset(seed=1)
    env.step(np.full(16, 100.0, dtype=np.float32))
    assert np.array_equal(env.scene.commanded, env.action_space.high)
    env.close()


def test_a_learned_zero_quaternion_ends_the_episode(state_env):
    state_env.reset(seed=1)
    action = keypose_below(state_env)
    action[12:16] = 0
    _, _, terminated, _, info = state_env.step(action)
    assert terminated
    assert info["failure"] == "right arm: zero quaternion"


def with_entry(length: int, value: float) -> np.ndarray:
    return np.where(np.arange(length) == 3, value, 0.0)


@pytest.mark.parametrize(
    ("control_mode", "action", "complaint"),
    [
        ("auto", np.zeros(17), "16 or 18"),
        ("auto", np.zeros((1, 16)), "16 or 18"),
        ("auto", with_entry(16, np.nan), "left_joint4"),
        ("auto", with_entry(18, np.inf), "left_qw"),
        ("joint", np.zeros(18), "16 numbers"),
        ("joint", with_entry(16, -9.0), "left_joint4"),
        ("keypose", np.zeros(16), "18 numbers"),
        ("keypose", np.zeros(18), "zero quaternion"),
    ],
)
def test_bad_actions_are_refused_with_a_reason(control_mode, action, complaint):
    env = BimanualEnv(TASK, obs="state", control_mode=control_mode)
    env.reset(seed=0)
    before = env.state_hash()
    with pytest.raises(InvalidAction, match=complaint):
        env.step(action)
    assert env.state_hash() == before
    env.close()


@pytest.mark.parametrize(
    ("options", "error", "complaint"),
    [
        ({"task": "lift_bal"}, UnknownTask, "lift_ball"),
        ({"variation": 99}, UnknownVariation, "any"),
        ({"variation": "red"}, UnknownVariation, "any"),
        ({"split": "dev"}, InvalidChoice, "train, val, test"),
        ({"obs": "depth"}, InvalidChoice, "rgbd, rgb, state"),
        ({"control_mode": "ee"}, InvalidChoice, "auto, joint, keypose"),
        ({"cameras": ("front", "top")}, UnknownCamera, "left_shoulder"),
        ({"cameras": ()}, InvalidChoice, "non-empty"),
        ({"image_size": 0}, InvalidChoice, "pixels"),
        ({"image_size": "big"}, InvalidChoice, "pixels"),
        ({"max_keyposes": 0}, InvalidChoice, "at least 1"),
        ({"render_quality": "ultra"}, InvalidChoice, "observation, high"),
        ({"render_mode": "human"}, InvalidChoice, "rgb_array"),
    ],
)
def test_bad_options_are_refused_with_the_valid_ones(options, error, complaint):
    with pytest.raises(error, match=complaint):
        BimanualEnv(**({"task": TASK} | options))


def test_using_the_environment_before_reset_is_refused():
    with pytest.raises(gym.error.ResetNeeded):
        BimanualEnv(TASK).step(np.zeros(16))


def test_fixing_the_variation_changes_nothing_else():
    task = "handover_item_easy"
    drawn = BimanualEnv(task, obs="state")
    drawn.reset(seed=3)
    fixed = BimanualEnv(task, obs="state", variation=drawn.variation)
    fixed.reset(seed=3)
    assert fixed.state_hash() == drawn.state_hash()
    assert fixed.task_description == drawn.task_description
    drawn.close()
    fixed.close()


def test_instructions_are_drawn_from_those_of_the_variation():
    env = BimanualEnv("handover_item_easy", obs="state")
    spec = get_task("handover_item_easy").spec
    assert env.task_description == spec.instructions[0]
    drawn = {env._draw_episode(seed).instruction for seed in range(30)}
    assert drawn == set(spec.instructions_for(spec.variations[0]))


def test_rendering_shows_the_front_camera(rgbd_env):
    rgbd_env.reset(seed=0)
    frame = rgbd_env.render()
    assert (frame.dtype, frame.shape) == (np.uint8, (480, 640, 3))
    small = rgbd_env.observe()["pixels"]["front"]
    assert np.abs(frame.mean((0, 1)) - small.mean((0, 1))).max() < 10


def test_a_closed_environment_can_be_reset_again(state_env):
    first = hash_sequence(state_env, seed=6)
    state_env.close()
    state_env.close()
    assert hash_sequence(state_env, seed=6) == first
