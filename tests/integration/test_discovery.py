"""LeRobot's plugin discovery in fresh interpreters: what is found, and what is not yet loaded."""

import json
import sys
from dataclasses import fields
from typing import Any

import pytest
from lerobot.configs import PreTrainedConfig
from lerobot.configs.train import TrainPipelineConfig
from lerobot.envs.configs import EnvConfig
from lerobot.utils.import_utils import register_third_party_plugins
from programs import run

from lerobot_bimanual.cli.flags import BadCommandLine
from lerobot_bimanual.cli.lerobot_flags import check_flags

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


@pytest.fixture(scope="module")
def discovery(tmp_path_factory) -> Any:
    printed = run(sys.executable, "-c", DISCOVER, folder=tmp_path_factory.mktemp("fresh"))
    return json.loads(next(line for line in printed.splitlines() if line.startswith("{")))


def test_lerobot_finds_the_environment_and_the_robot(discovery: Any) -> None:
    assert discovery["envs"]["bimanual"].startswith("lerobot_env_bimanual.")
    assert discovery["robots"]["bimanual_sim"].startswith("lerobot_robot_bimanual.")


def test_every_policy_follows_the_naming_by_which_lerobot_finds_its_class(discovery: Any) -> None:
    ours = {name for name, module in discovery["policies"].items() if "lerobot_policy_bimanual" in module}
    assert "peract2" in ours
    for name in ours:
        assert discovery["policies"][name] == f"lerobot_policy_bimanual.{name}.configuration_{name}"


def test_discovery_loads_neither_mujoco_nor_networks(discovery: Any) -> None:
    loaded = discovery["loaded"]
    assert "lerobot_env_bimanual" in loaded
    assert not {"mujoco", "OpenGL", "frankik", "av", "einops"} & {name.partition(".")[0] for name in loaded}
    parts = {"nn", "network", "policy"}
    networks = [name for name in loaded if ".modeling_" in name or parts & set(name.split("."))]
    assert not [name for name in networks if name.startswith("lerobot_policy_bimanual")]


@pytest.mark.slow
@pytest.mark.parametrize(("family", "base"), [("policy", PreTrainedConfig), ("env", EnvConfig)])
def test_the_flags_that_are_read_from_sources_are_those_of_the_configs(family, base) -> None:
    register_third_party_plugins()
    for kind, config in base.get_known_choices().items():
        flags = [f"--{family}.{each.name}=1" for each in fields(config) if each.init]
        flags += [f"--{each.name}=1" for each in fields(TrainPipelineConfig) if each.init]
        check_flags([f"--{family}.type={kind}", *flags], "TrainPipelineConfig")
        with pytest.raises(BadCommandLine, match=f"--{family}.no_such_flag"):
            check_flags([f"--{family}.type={kind}", f"--{family}.no_such_flag=1"], "TrainPipelineConfig")
