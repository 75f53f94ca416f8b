"""The environment goes onto the Hub, and LeRobot's own loader makes environments of what it finds there."""

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import loopback_hub
import numpy as np
import pytest
from lerobot.envs.configs import HubEnvConfig
from lerobot.envs.utils import _call_make_env, _import_hub_module, _normalize_hub_result
from packaging.requirements import Requirement

from lerobot_bimanual.cli import main
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.options import EnvOptions
from lerobot_env_bimanual.tasks.registry import get_task, list_tasks

REPO_ID = "someone/bimanual"
LOAD = """
import json, sys
from lerobot.envs.factory import make_env
envs = make_env(sys.argv[1], n_envs=1, trust_remote_code=sys.argv[2:] == ["trust"])
observation, info = envs["lift_ball"][1].reset(seed=[7])
print(json.dumps([
    {task: list(numbered) for task, numbered in envs.items()},
    list(observation["pixels"]["front"].shape),
    observation["ee_pose"][0].tolist(),
]))
"""


def make_from(folder: Path, **arguments) -> dict:
    """What LeRobot makes of a repository that it has downloaded."""
    module = _import_hub_module(str(folder / "env.py"), REPO_ID)
    cfg = arguments.pop("cfg", None)
    return _normalize_hub_result(_call_make_env(module, **arguments, cfg=cfg))


@pytest.fixture
def repository(tmp_path, capsys) -> Path:
    root = tmp_path / "envhub"
    assert main(["envhub", f"--root={root}", "--image_size=32", "--obs=rgb", f"--repo_id={REPO_ID}"]) == 0
    assert "env.py, README.md, requirements.txt" in capsys.readouterr().out
    return root


def test_lerobot_makes_every_task_with_the_chosen_options(repository) -> None:
    envs = make_from(repository, n_envs=2, use_async_envs=False)
    assert {task: list(numbered) for task, numbered in envs.items()} == {
        task: [get_task(task).spec.id] for task in list_tasks()
    }
    for numbered in envs.values():
        (env,) = numbered.values()
        assert env.num_envs == 2
        assert env.single_observation_space["pixels"]["front"].shape == (32, 32, 3)
        assert "images.front_depth" not in env.single_observation_space.spaces


def test_a_config_with_a_task_chooses_another(repository) -> None:
    assert list(
        make_from(repository, n_envs=1, use_async_envs=False, cfg=HubEnvConfig(task="symmetric"))
    ) == [
        "dual_push_buttons",
        "lift_ball",
        "lift_tray",
        "push_box",
    ]
    assert list(make_from(repository, n_envs=1, use_async_envs=False, cfg=HubEnvConfig())) == list(
        list_tasks()
    )


def test_the_requirements_can_be_read_and_are_what_is_installed(repository) -> None:
    (requirement,) = (
        Requirement(line) for line in (repository / "requirements.txt").read_text().splitlines()
    )
    assert requirement.name == "lerobot_env_bimanual"
    assert (
        f'VERSION = "{str(requirement.specifier).removeprefix("==")}"' in (repository / "env.py").read_text()
    )


def test_another_version_is_refused_with_the_command_that_installs_the_right_one(repository) -> None:
    code = (repository / "env.py").read_text()
    (repository / "env.py").write_text(code.replace('VERSION = "', 'VERSION = "99.'))
    with pytest.raises(ImportError, match=r"pip install lerobot_env_bimanual==99\."):
        make_from(repository, n_envs=1, use_async_envs=False)


@pytest.mark.parametrize(
    ("flag", "message"),
    [
        ("--task=lift_bal", "Did you mean 'lift_ball'?"),
        ("--variation=3", "has no variation 3"),
        ("--video_dir=films", "video_dir names a folder of this machine"),
        ("--repo_id=bimanual", "name it USER/NAME"),
        ("--image_size=7", "image_size is 7"),
    ],
)
def test_what_cannot_be_published_is_one_clear_line(tmp_path, capsys, flag, message) -> None:
    assert main(["envhub", f"--root={tmp_path / 'envhub'}", flag]) in (1, 2)
    told = capsys.readouterr().err
    assert message in told
    assert told.count("\n") == 1
    assert not (tmp_path / "envhub").exists()


@pytest.fixture(scope="module")
def desk(tmp_path_factory) -> Iterator[loopback_hub.Desk]:
    with loopback_hub.LoopbackHub() as hub:
        yield loopback_hub.Desk(tmp_path_factory.mktemp("hub") / "desk", hub.address, loopback_hub.TOKEN)


@pytest.mark.slow
def test_a_stranger_makes_it_by_its_name_and_only_after_saying_so(desk) -> None:
    pushed = desk.run(
        "lerobot-bimanual",
        "envhub",
        "--root=envhub",
        "--task=lift_ball,push_box",
        "--image_size=32",
        f"--repo_id={REPO_ID}",
        "--push_to_hub",
    )
    assert pushed.returncode == 0, pushed.stderr
    pinned = pushed.stdout.split()[-1]
    assert pinned.startswith(f"{REPO_ID}@")

    def load(name: str, *trust: str) -> subprocess.CompletedProcess[str]:
        return desk.run(Path(sys.executable).name, "-c", LOAD, name, *trust)

    refused = load(pinned)
    assert refused.returncode == 1
    assert "Refusing to execute remote code" in refused.stderr
    done = load(pinned, "trust")
    assert done.returncode == 0, done.stderr[-3000:]
    tasks, shape, ee_pose = json.loads(done.stdout.splitlines()[-1])
    assert tasks == {"lift_ball": [1], "push_box": [0]}
    assert shape == [1, 32, 32, 3]
    env = BimanualEnv("lift_ball", options=EnvOptions(obs="state"))
    observation, _ = env.reset(seed=7)
    assert np.array_equal(np.float32(ee_pose), observation["ee_pose"])
    env.close()
