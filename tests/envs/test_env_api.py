"""The environment follows Gymnasium's API, is reproducible bit for bit, and reports misuse clearly."""

import itertools
import warnings
from typing import get_args
from unittest.mock import Mock

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.errors import InvalidAction, InvalidChoice, PlacementFailure
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.options import ControlMode, EnvOptions, ObservationMode
from lerobot_env_bimanual.tasks.registry import get_task, list_tasks
from lerobot_env_bimanual.worlds import EpisodeReset

TASK = "lift_ball"
ACTIONS_ARE_NOT_NORMALISED = ".*recommend using a symmetric and normalized space"


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


def test_environments_made_by_gymnasium_follow_its_api_and_render(instant_placement):
    env = gym.make("bimanual/LiftBall-v0", cameras=("front",), image_size=16).unwrapped
    assert isinstance(env, BimanualEnv)
    assert_follows_gymnasiums_api(env)


def test_vectors_say_where_the_arms_are(state_env):
    observation, _ = state_env.reset(seed=0)
    scene = state_env.scene
    vectors = (np.split(observation[key], 2) for key in ("agent_pos", "ee_pose"))
    for arm, agent, pose in zip(ARMS, *vectors, strict=True):
        assert np.allclose(agent[:7], scene.joint_positions(arm), atol=1e-6)
        assert agent[7] == pytest.approx(1.0, abs=0.02)
        assert np.allclose(pose[:3], scene.tcp(arm).position, atol=1e-6)
    assert np.allclose(observation["gripper_fingers"], 0.04, atol=1e-3)


def with_entry(length: int, value: float) -> np.ndarray:
    return np.where(np.arange(length) == 3, value, 0.0)


@pytest.mark.parametrize(
    ("control_mode", "action", "complaint"),
    [
        ("auto", np.zeros(17), "16 or 18"),
        ("auto", with_entry(16, np.nan), "left_joint4"),
        ("auto", with_entry(18, np.inf), "left_qw"),
        ("auto", ["0"] * 16, "got str"),
        ("auto", np.zeros(16, complex), "got complex128"),
        ("auto", [[0.0], *[0.0] * 15], "what NumPy cannot read"),
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


def test_a_variation_can_be_fixed_for_all_episodes_or_for_one_and_changes_nothing_else():
    def episode(variation: str | int, /, **options) -> tuple:
        env = BimanualEnv("handover_item", obs="state", variation=variation)
        env.reset(seed=3, options=options)
        found = env.variation, env.task_description, env.state_hash()
        return found

    drawn, *_ = episode("any")
    assert episode("any") == episode(drawn) == episode("any", of_another_library=1)
    assert drawn != 4
    assert episode("any", variation=4) == episode(4)
    with pytest.raises(InvalidChoice, match="variation of handover_item is 5"):
        episode("any", variation=5)


def test_a_keyword_overrides_the_same_option_of_an_options_object():
    options = EnvOptions(obs="state", split="val")
    env = BimanualEnv("lift_ball", options=options, split="train")
    assert (env.options.obs, env.options.split, options.split) == ("state", "train", "val")
    with pytest.raises(InvalidChoice, match="Did you mean 'variation'"):
        BimanualEnv("lift_ball", options=options, variaton=0)


def test_an_episode_that_could_not_start_cannot_be_played(monkeypatch):
    env = BimanualEnv("lift_ball", obs="state")
    with monkeypatch.context() as patch:
        patch.setattr(EpisodeReset, "start", Mock(side_effect=PlacementFailure("no placement")))
        with pytest.raises(PlacementFailure):
            env.reset(seed=0)
    with pytest.raises(gym.error.ResetNeeded):
        env.step(np.zeros(16, np.float32))
    env.reset(seed=0)
    assert not env.step(env.scene.commanded)[2]


def test_instructions_are_drawn_from_those_of_the_variation():
    env = BimanualEnv("handover_item_easy", obs="state")
    spec = get_task("handover_item_easy").spec
    assert env.task_description == spec.instructions[0]
    drawn = set()
    for seed in range(30):
        env.reset(seed=seed)
        drawn.add(env.task_description)
    assert drawn == set(spec.instructions_for(spec.variations[0]))
