"""LeRobot's plugin discovery in fresh interpreters: what is found, and what is not yet loaded."""

import json
import subprocess
import sys
from typing import Any

import pytest

DISCOVER = """
import json, sys
import lerobot.envs.configs, lerobot.configs.policies
from lerobot.utils.import_utils import register_third_party_plugins
before = set(sys.modules)
register_third_party_plugins()
from lerobot.configs.policies import PreTrainedConfig
from lerobot.envs.configs import EnvConfig
from lerobot.robots.config import RobotConfig
from lerobot.teleoperators.config import TeleoperatorConfig
print(json.dumps({
    "envs": {name: config.__module__ for name, config in EnvConfig.get_known_choices().items()},
    "policies": {name: config.__module__ for name, config in PreTrainedConfig.get_known_choices().items()},
    "robots": {name: config.__module__ for name, config in RobotConfig.get_known_choices().items()},
    "teleoperators": {
        name: config.__module__ for name, config in TeleoperatorConfig.get_known_choices().items()
    },
    "loaded": sorted(set(sys.modules) - before),
}))
"""


def run(program: str) -> Any:
    """The object that a program prints as JSON on its last line, in a fresh interpreter."""
    child = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert child.returncode == 0, child.stderr
    return json.loads(child.stdout.splitlines()[-1])


@pytest.fixture(scope="module")
def discovery() -> Any:
    return run(DISCOVER)


def test_lerobot_finds_the_environment_and_the_policies(discovery: Any) -> None:
    assert discovery["envs"]["bimanual"].startswith("lerobot_env_bimanual.")
    assert discovery["policies"]["peract2"].startswith("lerobot_policy_bimanual.")


def test_lerobot_finds_the_robot_the_keyboard_and_the_gamepad(discovery: Any) -> None:
    assert discovery["robots"]["bimanual_sim"].startswith("lerobot_robot_bimanual.")
    for name in ("bimanual_keyboard", "bimanual_gamepad"):
        assert discovery["teleoperators"][name].startswith("lerobot_robot_bimanual.")


def test_every_policy_follows_the_naming_by_which_lerobot_finds_its_class(discovery: Any) -> None:
    ours = {
        name: module for name, module in discovery["policies"].items() if "lerobot_policy_bimanual" in module
    }
    assert ours
    for name, module in ours.items():
        assert module == f"lerobot_policy_bimanual.{name}.configuration_{name}"


def test_discovery_loads_neither_mujoco_nor_networks(discovery: Any) -> None:
    loaded = discovery["loaded"]
    assert "lerobot_env_bimanual" in loaded
    heavy = [
        name for name in loaded if name.partition(".")[0] in {"mujoco", "OpenGL", "frankik", "av", "einops"}
    ]
    parts = {"nn", "network", "policy"}
    networks = [name for name in loaded if ".modeling_" in name or parts & set(name.split("."))]
    assert not heavy + [name for name in networks if name.startswith("lerobot_policy_bimanual")]


def test_the_environment_is_built_in_a_worker_without_lerobot_or_torch() -> None:
    loaded = run(
        "import json, sys\nimport lerobot_env_bimanual.env, lerobot_env_bimanual.vector.lazy_vector_env\n"
        "print(json.dumps(sorted({name.partition('.')[0] for name in sys.modules})))"
    )
    assert "lerobot_env_bimanual" in loaded
    assert not {"lerobot", "torch", "datasets"} & set(loaded)


def test_core_alone_loads_no_heavy_library() -> None:
    loaded = run("import json, sys, lerobot_bimanual\nprint(json.dumps(sorted(sys.modules)))")
    assert not {"lerobot", "torch", "mujoco", "gymnasium", "datasets", "draccus"} & set(loaded)
