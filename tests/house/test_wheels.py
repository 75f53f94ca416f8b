"""The built wheels, installed into an environment that knows nothing of this checkout.

The environments are made without any download. They borrow dependencies from the environment of the tests: a `.pth`
file names a folder of links to that environment's packages, so that ours can be imported from the wheels only.
"""

import subprocess
import sys
import sysconfig
import venv
import zipfile
from collections.abc import Iterable
from importlib.metadata import distribution, version
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from test_repository import DISTRIBUTIONS

from lerobot_bimanual.cli import main

# Any attempt to reach the network fails the program that begins with these lines.
NO_NETWORK = """
import socket
def refuse(*_): raise OSError("the network was used")
socket.socket.connect = socket.getaddrinfo = refuse
"""
USE = f"""
import sys, {", ".join(DISTRIBUTIONS)}
for module in ({", ".join(DISTRIBUTIONS)}):
    assert module.__file__.startswith(sys.prefix), module.__file__
import gymnasium as gym
assert not gym.make("bimanual/RaiseBlock-v0", obs="state").reset(seed=0)[1]["is_success"]
from lerobot_env_bimanual.env import BimanualEnv
assert not BimanualEnv("lift_ball", obs="state").reset(seed=0)[1]["is_success"]
"""
SLIM_USE = """
import gymnasium as gym, lerobot_env_bimanual
import lerobot_env_bimanual.reports.expert_tables
from lerobot_env_bimanual.world.video import VideoWriter
env = gym.make("bimanual/PushBox-v0", image_size=32)
observation, _ = env.reset(seed=0)
assert observation["pixels"]["front"].any()
env.close()
try:
    lerobot_env_bimanual.BimanualEnvConfig
except ModuleNotFoundError as error:
    print(error)
"""

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1200)]


@pytest.fixture(scope="module")
def wheels(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """One wheel per distribution, each built from its source archive, as a release would be."""
    return {name: built(folder, tmp_path_factory.mktemp(name)) for name, folder in DISTRIBUTIONS.items()}


@pytest.fixture(scope="module")
def python(wheels: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Interpreter of an environment with the four wheels, a task of another distribution, and borrowed dependencies."""
    borrowed = (each.name for each in Path(sysconfig.get_path("purelib")).iterdir() if each.suffix != ".pth")
    source = tmp_path_factory.mktemp("new") / "raise_block"
    assert main(["task", "new", "--name=raise_block", f"--output={source}"]) == 0
    task = built(source, tmp_path_factory.mktemp("task"))
    return environment(tmp_path_factory.mktemp("clean"), borrowed, (*wheels.values(), task))


@pytest.fixture(scope="module")
def slim_python(wheels: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Interpreter with core and environment alone, and what they require without an extra."""
    needed = required_by("lerobot_env_bimanual", set())
    files = (file for name in needed for file in distribution(name).files or ())
    borrowed = {file.parts[0] for file in files if file.parts[0] not in ("..", "__pycache__")}
    chosen = (wheels["lerobot_bimanual"], wheels["lerobot_env_bimanual"])
    return environment(tmp_path_factory.mktemp("slim"), borrowed, chosen)


def required_by(name: str, found: set[str]) -> set[str]:
    """Names of the distributions that one needs, with its own, added to those that were found already."""
    if name not in found:
        found.add(name)
        for requirement in map(Requirement, distribution(name).requires or ()):
            if requirement.marker is None or requirement.marker.evaluate({"extra": ""}):
                required_by(requirement.name, found)
    return found


def environment(home: Path, borrowed: Iterable[str], wheels: Iterable[Path]) -> Path:
    """Make an environment of wheels and this environment's packages without ours; return its interpreter."""
    venv.create(home, with_pip=False, symlinks=True)
    packages = Path(sysconfig.get_path("purelib", vars={"base": str(home), "platbase": str(home)}))
    links = home / "borrowed"
    links.mkdir()
    for name in borrowed:
        if "bimanual" not in name:
            (links / name).symlink_to(Path(sysconfig.get_path("purelib"), name))
    (packages / "borrowed.pth").write_text(f"{links}\n")
    for wheel in wheels:
        zipfile.ZipFile(wheel).extractall(packages)
    return home / "bin/python"


def built(folder: Path, out: Path) -> Path:
    command = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(out), str(folder)]
    subprocess.run(command, check=True, capture_output=True)
    (wheel,) = out.glob("*.whl")
    return wheel


def succeed(python: Path, *words: str, code: int = 0) -> str:
    """What a program prints; it sees neither this checkout nor variables that name it."""
    command = [python, "-I", *words]
    child = subprocess.run(command, cwd=python.parent, capture_output=True, text=True, check=False)
    assert child.returncode == code, child.stdout[-2000:] + child.stderr[-4000:]
    return child.stdout + child.stderr


@pytest.mark.parametrize("name", DISTRIBUTIONS)
def test_a_wheel_holds_exactly_its_package_with_types_and_licence(name: str, wheels: dict[str, Path]) -> None:
    members = set(zipfile.ZipFile(wheels[name]).namelist())
    source = DISTRIBUTIONS[name] / name
    kept = [path for path in source.rglob("*") if path.is_file() and "__pycache__" not in path.parts]
    ours = {f"{name}/{path.relative_to(source)}" for path in kept} | {f"{name}/py.typed"}
    assert ours <= members
    assert {member.partition("/")[0] for member in members - ours} == {f"{name}-{version(name)}.dist-info"}
    assert any(member.endswith("licenses/LICENSE") for member in members)
    assert any(member.endswith("licenses/NOTICE") for member in members)


def test_the_wheels_are_used_without_checkout_and_network(python: Path) -> None:
    succeed(python, "-c", NO_NETWORK + USE)
    shown = succeed(python, "-m", "lerobot_bimanual.cli", "--help")
    assert all(f"\n  {command} " in shown for command in ("doctor", "dataset generate", "policy benchmark"))


def test_environment_experts_films_and_reports_need_neither_lerobot_nor_torch(slim_python, tmp_path):
    without = """
from importlib.util import find_spec
assert not any(map(find_spec, ("lerobot", "torch", "datasets", "pyarrow")))
"""
    played = succeed(slim_python, "-c", without + SLIM_USE)
    assert "pip install 'lerobot_env_bimanual[lerobot]'" in played
    ours = ("-m", "lerobot_bimanual.cli")
    report = tmp_path / "expert.json"
    succeed(slim_python, *ours, "expert", "evaluate", "--task=push_box", "--episodes=1", f"--output={report}")
    assert report.is_file()
    succeed(slim_python, *ours, "doctor")
    datasets = [f"dataset {verb}" for verb in ("from-results", "generate", "verify")]
    for command in (*datasets, "policy robustness", "results verify"):
        told = succeed(slim_python, *ours, *command.split(), code=1)
        assert f"`{command}` needs lerobot, which is not installed: pip install 'lerobot_" in told
        assert len(told.splitlines()) == 1
