"""LeRobot's plugin discovery in fresh interpreters: what is found, and what is not yet loaded."""

import json
import sys
from unittest.mock import Mock

import pytest
from datasets.exceptions import DatasetGenerationError
from programs import run

from lerobot_bimanual.cli import lerobot_program
from lerobot_bimanual.cli.lerobot_flags import is_trusted, strip_plugin_flags

DISCOVER = """
import json, sys
import lerobot.envs.configs, lerobot.configs.policies
from lerobot.utils.import_utils import register_third_party_plugins
before = set(sys.modules)
register_third_party_plugins()
from lerobot.configs.policies import PreTrainedConfig
from lerobot.envs.configs import EnvConfig
from lerobot.robots.config import RobotConfig
kinds = {"envs": EnvConfig, "policies": PreTrainedConfig, "robots": RobotConfig}
found = {
    kind: {name: config.__module__ for name, config in base.get_known_choices().items()}
    for kind, base in kinds.items()
}
print(json.dumps(found | {"loaded": sorted(set(sys.modules) - before)}))
"""


def test_lerobot_finds_environment_policies_and_robot_and_loads_neither_mujoco_nor_networks(tmp_path) -> None:
    printed = run(sys.executable, "-c", DISCOVER, folder=tmp_path)
    discovery = json.loads(next(line for line in printed.splitlines() if line.startswith("{")))
    assert discovery["envs"]["bimanual"].startswith("lerobot_env_bimanual.")
    assert discovery["policies"]["peract2"].startswith("lerobot_policy_bimanual.")
    assert discovery["robots"]["bimanual_sim"].startswith("lerobot_robot_bimanual.")
    loaded = discovery["loaded"]
    assert "lerobot_env_bimanual" in loaded
    assert not {"mujoco", "OpenGL", "frankik", "av", "einops"} & {name.partition(".")[0] for name in loaded}
    parts = {"nn", "network", "policy"}
    networks = [name for name in loaded if ".modeling_" in name or parts & set(name.split("."))]
    assert not [name for name in networks if name.startswith("lerobot_policy_bimanual")]


@pytest.mark.parametrize(
    ("ours", "trusted"),
    [
        (["--trust_checkpoint=true"], True),
        (["--trust_checkpoint", "true"], True),
        (["--trust_checkpoint"], True),
        (["--trust_checkpoint=false"], False),
        (["--keep_last", "2"], False),
        (["--keep_last"], False),
    ],
)
def test_lerobot_gets_none_of_our_flags(ours, trusted) -> None:
    lerobots = ["--policy.path=a", "--steps", "3"]
    for words in ([*ours, *lerobots], [*lerobots, *ours]):
        assert strip_plugin_flags(words) == lerobots
        assert is_trusted(words) is trusted


def test_lerobots_programs_say_that_it_is_not_installed(monkeypatch, capsys) -> None:
    monkeypatch.setattr(lerobot_program, "installed_version", lambda _: None)
    assert lerobot_program.run_program("lerobot-bimanual-eval", check=print, work=print, progress=False) == 1
    assert "pip install 'lerobot_bimanual[lerobot]'" in capsys.readouterr().err


def test_a_full_disk_behind_an_error_of_lerobots_loader_is_named_with_the_remedy(monkeypatch, capsys) -> None:
    def load(_: object) -> None:
        raise DatasetGenerationError("An error occurred while generating the dataset") from full

    full = OSError(28, "No space left")
    monkeypatch.setattr("sys.argv", ["lerobot-bimanual-train"])
    assert lerobot_program.run_program("lerobot-bimanual-train", check=bool, work=load, progress=False) == 1
    said = capsys.readouterr().err
    assert (
        "while generating the dataset: [Errno 28] No space left; LeRobot copies datasets to HF_DATASETS_CACHE"
        in said
    )
    monkeypatch.setattr("sys.argv", ["lerobot-bimanual-train"])
    denied = Mock(side_effect=PermissionError(13, "Permission denied", "outputs/mine"))
    assert lerobot_program.run_program("lerobot-bimanual-train", check=bool, work=denied, progress=False) == 1
    assert "HF_DATASETS_CACHE" not in capsys.readouterr().err
