"""LeRobot's configuration, and vector environments: lazy, held after an episode, the same bits in every process."""

import os
import re
import signal
import subprocess
import sys
from dataclasses import dataclass, fields
from functools import partial

import draccus
import numpy as np
import pytest
import torch
from lerobot.configs import FeatureType
from lerobot.envs.configs import EnvConfig
from lerobot.envs.factory import make_env
from lerobot.envs.utils import env_to_policy_features, preprocess_observation
from lerobot.utils.feature_utils import dataset_to_policy_features

from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.dataset import feature_table, schema
from lerobot_bimanual.errors import InvalidAction, InvalidChoice
from lerobot_bimanual.joint_action import JOINT_ACTION_DIM
from lerobot_bimanual.keypose_layout import KEYPOSE_DIM
from lerobot_bimanual.results.proof import actions_to_text
from lerobot_env_bimanual import BimanualEnvConfig
from lerobot_env_bimanual.conditions import AtRest
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.episode.progress import SUCCESS_TICKS
from lerobot_env_bimanual.eval_program import OPTIONS_OF_LEROBOT
from lerobot_env_bimanual.tasks.lift_ball import LiftBall
from lerobot_env_bimanual.tasks.registry import list_suites
from lerobot_env_bimanual.vector.lazy_vector_env import LazyVectorEnv
from lerobot_env_bimanual.workers import WorkerDied

make_lift_ball = partial(BimanualEnv, "lift_ball", image_size=16, cameras=("front",))


MAIN_SCRIPT = """
with open("runs", "a") as runs:
    runs.write("x")

def make_reporting_env():
    import sys
    from lerobot_env_bimanual.env import BimanualEnv
    env = BimanualEnv("lift_ball", obs="state")
    env.loaded = sorted({"lerobot", "torch", "mujoco"} & set(sys.modules))
    return env

if __name__ == "__main__":
    from lerobot_env_bimanual.vector.lazy_vector_env import LazyVectorEnv
    envs = LazyVectorEnv([make_reporting_env] * 2, asynchronous=True)
    print(envs.get_attr("loaded"))
    envs.close()
    print(__file__, __spec__)
"""


def test_workers_do_not_run_the_main_script_again_and_load_neither_lerobot_nor_torch(tmp_path):
    script = tmp_path / "main_script"
    script.write_text(MAIN_SCRIPT)
    command = [sys.executable, script]
    output = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True).stdout
    assert output.splitlines() == ["(['mujoco'], ['mujoco'])", f"{script} None"]
    assert (tmp_path / "runs").read_text() == "x"


def test_environments_start_at_first_use_and_end_at_close():
    made = []

    def make() -> BimanualEnv:
        made.append(make_lift_ball())
        return made[-1]

    envs = LazyVectorEnv([make, make], asynchronous=False)
    assert len(made) == 1, "an example"
    for count in (3, 5):
        envs.reset(seed=0)
        assert len(made) == count
        envs.close()
        envs.close()


def test_a_finished_environment_repeats_its_last_transition_until_an_explicit_reset(monkeypatch):
    monkeypatch.setattr(LiftBall, "conditions", lambda *_: (AtRest("world"),))
    envs = LazyVectorEnv([partial(BimanualEnv, "lift_ball", obs="state")], asynchronous=False)
    for arguments in ({"seed": [1]}, {"options": {"lerobot_new_rollout": True}}, {"seed": [1]}, {}):
        _, info = envs.reset(**arguments)
        assert info["ticks"].tolist() == [0]
        action = holding(envs)
        transitions = [envs.step(action) for _ in range(SUCCESS_TICKS)]
        assert [rewards.item() for _, rewards, *_ in transitions] == [0.0] * (SUCCESS_TICKS - 1) + [1.0]
        state = envs.call("state_hash")
        observation, rewards, *_, info = envs.step(action)
        assert (rewards.item(), info["ticks"].item(), info["is_success"].item()) == (0.0, SUCCESS_TICKS, True)
        np.testing.assert_equal(observation, transitions[-1][0])
        assert envs.call("state_hash") == state


@pytest.fixture(scope="module", params=[False, True], ids=["sync", "async"])
def pair(request):
    """Two environments without images."""
    envs = LazyVectorEnv([partial(BimanualEnv, "lift_ball", obs="state")] * 2, asynchronous=request.param)
    yield envs
    envs.close()


def holding(envs) -> np.ndarray:
    return np.stack([observation["agent_pos"] for observation in envs.call("observe")])


BAD_ACTIONS = {
    "NaN": (lambda action: np.where(np.arange(16) == 3, np.nan, action), "not finite in: left_joint4"),
    "ragged": (lambda action: [[1.0], *action[1:]], "what NumPy cannot read"),
    "a tensor that requires its gradient": (lambda _: torch.zeros(16, requires_grad=True), "requires grad"),
    "nothing": (lambda _: None, "got a NoneType of object"),
}


@pytest.mark.parametrize("bad", BAD_ACTIONS)
def test_a_bad_action_ends_its_own_episode_alone(bad, pair):
    spoil, complaint = BAD_ACTIONS[bad]
    pair.reset(seed=[3, 4])
    start = pair.call("state_hash")
    good, other = holding(pair)
    _, rewards, terminated, truncated, info = pair.step([good, spoil(other)])
    assert (terminated.tolist(), truncated.any(), rewards.any()) == ([False, True], False, False)
    assert info["failure"][0] == ""
    assert re.match(f"invalid action: .*{complaint}", info["failure"][1])
    assert info["ticks"].tolist() == [1, 0]
    assert pair.call("state_hash")[1] == start[1]
    pair.step([good, spoil(other)])
    assert pair.call("state_hash")[1] == start[1]  # neither stepped nor reset
    assert pair.reset(seed=[3, 4])[1]["failure"].tolist() == ["", ""]
    assert pair.call("state_hash") == start
    assert not pair.step(holding(pair))[2].any()


@pytest.mark.parametrize(
    ("actions", "complaint"),
    [
        (np.zeros((2, 17)), r"16 or 18 numbers, got shape \(17,\)"),
        (np.zeros((3, 16)), r"2 environments take as many actions, got ndarray of shape \(3, 16\)"),
        (7, "got int"),
    ],
)
def test_actions_that_no_environment_could_read_are_refused_before_any_steps(actions, complaint, pair):
    pair.reset(seed=0)
    before = pair.call("state_hash")
    with pytest.raises(InvalidAction, match=complaint):
        pair.step(actions)
    assert pair.call("state_hash") == before


def test_an_error_of_one_environment_is_raised_and_the_next_reset_works(pair):
    pair.reset(seed=0)
    before = pair.call("state_hash")
    with pytest.raises(InvalidChoice, match="variation of lift_ball is 7"):
        pair.reset(seed=0, options={"variation": 7})
    pair.reset(seed=0)
    assert pair.call("state_hash") == before


def test_a_dead_worker_is_one_error_after_which_environments_start_anew():
    envs = LazyVectorEnv([partial(BimanualEnv, "lift_ball", obs="state")] * 2, asynchronous=True)
    envs.reset(seed=0)
    start, actions = envs.call("state_hash"), holding(envs)
    for use in (lambda: envs.step(actions), lambda: envs.reset(seed=0), lambda: envs.call("state_hash")):
        first, second = worker_processes(envs)
        os.kill(second.pid, signal.SIGKILL)
        with pytest.raises(WorkerDied, match=r"environment 1 \(killed by SIGKILL\) died"):
            use()
        assert not first.is_alive()
        envs.reset(seed=0)
        assert envs.call("state_hash") == start
    for process in worker_processes(envs):
        os.kill(process.pid, signal.SIGKILL)
        process.join()
    envs.close()
    envs.reset(seed=0)
    assert envs.call("state_hash") == start
    envs.close()


def worker_processes(envs: LazyVectorEnv) -> list:
    return list(envs._ensure().processes)


@dataclass
class CommandLine:
    env: EnvConfig


def test_flags_reach_the_environment():
    given = {"variation": 0, "split": "val", "cameras": "front,left_wrist", "image_size": "24x32"}
    given |= {"obs": "rgb", "control_mode": "joint", "video_dir": "films", "max_keyposes": 7}
    flags = [
        f"--env.{name}={value}" for name, value in {"type": "bimanual", "task": "lift_ball", **given}.items()
    ]
    config = draccus.parse(CommandLine, args=flags).env
    options = BimanualEnv("lift_ball", **config.gym_kwargs).options
    assert {name: getattr(options, name) for name in given} == given
    assert (options.camera_names, options.size) == (("front", "left_wrist"), (24, 32))


@pytest.mark.parametrize(
    ("given", "count"),
    [({}, 16), ({"cameras": "left_wrist"}, 8), ({"obs": "rgb"}, 11), ({"obs": "state"}, 6)],
)
def test_the_declared_features_are_what_policies_get_and_what_datasets_hold(given, count, instant_placement):
    config = BimanualEnvConfig(image_size="24x32", **given)
    env = BimanualEnv("push_box", **config.gym_kwargs)
    observation, _ = env.reset(seed=0)
    pixels = {camera: image[None] for camera, image in observation.pop("pixels", {}).items()}
    observations = {key: value[None] for key, value in observation.items()} | {"pixels": pixels}
    batch = preprocess_observation(observations)
    features = env_to_policy_features(config)
    action = features.pop(schema.ACTION)
    assert (action.type, len(features)) == (FeatureType.ACTION, count)
    assert {key: feature.shape for key, feature in features.items()} == {
        key: tuple(value.shape[1:]) for key, value in batch.items()
    }
    stored = dataset_to_policy_features(feature_table.features(CAMERA_NAMES, 24, 32, "frames"))
    assert features == {key: stored[key] for key in features}


@pytest.mark.parametrize(("mode", "length"), [("auto", 16), ("joint", 16), ("keypose", 18)])
def test_the_declared_action_follows_the_control_mode(mode, length):
    config = BimanualEnvConfig(control_mode=mode)
    assert config.features[schema.ACTION].shape == (length,)
    assert BimanualEnv("push_box", **config.gym_kwargs).action_space.shape == (length,)


def test_the_checks_of_flags_know_all_options_of_lerobots_environments():
    assert {each.name for each in fields(EnvConfig)} <= {*OPTIONS_OF_LEROBOT}


def test_joint_actions_are_rounded_for_small_results_and_keyposes_are_not():
    _, process = BimanualEnvConfig().get_env_processors()
    joints, keyposes = torch.rand(50, JOINT_ACTION_DIM), torch.rand(50, KEYPOSE_DIM)
    rounded = process({schema.ACTION: joints})[schema.ACTION]
    torch.testing.assert_close(rounded, joints, rtol=0, atol=0.5 / 4096)
    assert len(actions_to_text(rounded)) < 0.8 * len(actions_to_text(joints))
    assert torch.equal(process({schema.ACTION: keyposes})[schema.ACTION], keyposes)


def test_environments_are_grouped_by_suite_and_a_task_alone_is_a_group():
    suites = list_suites()
    alone = next(task for task in suites["all"] if task not in suites["symmetric"])
    envs = make_env(BimanualEnvConfig(task=f"{alone}, symmetric"), n_envs=2)
    groups = {alone: (alone,), "symmetric": suites["symmetric"]}
    assert envs.keys() == groups.keys()
    for group, numbered in envs.items():
        assert [*numbered] == [*range(len(groups[group]))]
        assert [env.call("task") for env in numbered.values()] == [(task, task) for task in groups[group]]


def test_bad_options_are_refused_with_the_valid_ones():
    with pytest.raises(InvalidChoice, match="symmetric"):
        BimanualEnvConfig(task="symetric")
    with pytest.raises(InvalidChoice, match=r"share no task, .*push_box"):
        BimanualEnvConfig(task="push_box,all")
    with pytest.raises(InvalidChoice, match="20"):
        BimanualEnvConfig(fps=30)


def test_a_training_does_not_start_with_a_folder_for_results_of_one_policy(monkeypatch):
    monkeypatch.setattr("sys.argv", ["/usr/bin/lerobot-train"])
    BimanualEnvConfig()
    with pytest.raises(InvalidChoice, match="given to `lerobot-eval` alone"):
        BimanualEnvConfig(results_dir="here")
