"""The built wheels, installed into an environment that knows nothing of this checkout.

The environment is made without any download. Its dependencies are lent by the environment of the tests: a `.pth`
file names a folder of links to that environment's packages, leaving out ours, so that what is imported as ours
can only come from the wheels.
"""

import json
import subprocess
import sys
import sysconfig
import venv
import zipfile
from importlib.metadata import version
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FOLDERS = {
    "lerobot_bimanual": ".",
    "lerobot_env_bimanual": "envs",
    "lerobot_policy_bimanual": "policies",
    "lerobot_robot_bimanual": "robots",
}
# Any attempt to reach the network fails the program that begins with these lines.
NO_NETWORK = """
import socket
def refuse(*_): raise OSError("the network was used")
socket.socket.connect = socket.getaddrinfo = refuse
"""

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def wheels(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """One wheel per distribution, each built from its source archive, as a release would be."""
    built = {}
    for name, folder in FOLDERS.items():
        out = tmp_path_factory.mktemp(name)
        command = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(out), str(ROOT / folder)]
        subprocess.run(command, check=True, capture_output=True)
        (built[name],) = out.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def clean_python(wheels: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Interpreter of an environment with the four wheels and borrowed dependencies."""
    home = tmp_path_factory.mktemp("clean")
    venv.create(home, with_pip=False, symlinks=True)
    python = home / "bin/python"
    packages = Path(sysconfig.get_path("purelib", vars={"base": str(home), "platbase": str(home)}))
    borrowed = home / "borrowed"
    borrowed.mkdir()
    for entry in Path(sysconfig.get_path("purelib")).iterdir():
        if "bimanual" not in entry.name and entry.suffix != ".pth":
            (borrowed / entry.name).symlink_to(entry)
    (packages / "borrowed.pth").write_text(f"{borrowed}\n")
    for wheel in wheels.values():
        zipfile.ZipFile(wheel).extractall(packages)
    return python


def run_clean(python: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [python, "-I", *words], cwd=python.parent, capture_output=True, text=True, check=False
    )


@pytest.mark.parametrize("name", FOLDERS)
def test_a_wheel_holds_exactly_its_package_with_types_and_licence(name: str, wheels: dict[str, Path]) -> None:
    members = set(zipfile.ZipFile(wheels[name]).namelist())
    source = ROOT / FOLDERS[name] / name
    kept = [path for path in source.rglob("*") if path.is_file() and "__pycache__" not in path.parts]
    ours = {f"{name}/{path.relative_to(source)}" for path in kept} | {f"{name}/py.typed"}
    assert ours <= members
    assert {member.partition("/")[0] for member in members - ours} == {f"{name}-{version(name)}.dist-info"}
    assert any(member.endswith("licenses/LICENSE") for member in members)
    assert any(member.endswith("licenses/NOTICE") for member in members)


def test_the_wheels_are_imported_without_checkout_and_network(clean_python: Path) -> None:
    program = (
        f"import sys, {', '.join(FOLDERS)}\n"
        f"for module in ({', '.join(FOLDERS)}):\n"
        "    assert module.__file__.startswith(sys.prefix), module.__file__\n"
    )
    child = run_clean(clean_python, "-c", NO_NETWORK + program)
    assert child.returncode == 0, child.stderr


def test_the_command_line_of_the_wheels_finds_every_verb(clean_python: Path) -> None:
    child = run_clean(clean_python, "-m", "lerobot_bimanual.cli", "--help")
    assert child.returncode == 0, child.stderr
    for verb in ("expert evaluate", "demo", "doctor", "dataset generate", "dataset replay", "task list"):
        assert f"\n  {verb} " in child.stdout


def test_the_wheels_start_an_episode_without_network(clean_python: Path) -> None:
    program = (
        "from lerobot_env_bimanual.env import BimanualEnv\n"
        "_, info = BimanualEnv('lift_ball', obs='state').reset(seed=0)\n"
        "assert not info['is_success']\n"
    )
    child = run_clean(clean_python, "-c", NO_NETWORK + program)
    assert child.returncode == 0, child.stderr


def test_stock_replay_finds_the_robot_of_the_wheels_and_plays_an_episode_generated_by_them(
    clean_python: Path, tmp_path: Path
) -> None:
    root = tmp_path / "dataset"
    made = ("--task=lift_ball", "--episodes=1", "--view=frames", "--image_size=32", "--workers=1")
    succeed(clean_python, "-m", "lerobot_bimanual.cli", "dataset", "generate", *made, f"--root={root}")
    robot = ("--robot.type=bimanual_sim", "--robot.task=lift_ball", "--robot.obs=state")
    dataset = ("--dataset.repo_id=local/one", f"--dataset.root={root}", "--dataset.episode=0")
    flags = (*robot, f"--robot.calibration_dir={tmp_path}", *dataset, "--play_sounds=false")
    child = run_clean(clean_python, "-m", "lerobot.scripts.lerobot_replay", *flags)
    assert child.returncode == 0, child.stderr[-4000:]
    assert "lift_ball, variation 0, train seed 0: solved" in child.stderr


# -- a task in a distribution of somebody else's ------------------------------------------------------------

TASK_PACKAGE = ROOT / "examples/07_own_task"


@pytest.fixture(scope="module")
def python_with_a_task(clean_python: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The clean interpreter, with the wheel of one more task installed."""
    out = tmp_path_factory.mktemp("task")
    command = [
        sys.executable,
        "-m",
        "build",
        "--no-isolation",
        "--wheel",
        "--outdir",
        str(out),
        str(TASK_PACKAGE),
    ]
    subprocess.run(command, check=True, capture_output=True)
    (wheel,) = out.glob("*.whl")
    packages = sysconfig.get_path(
        "purelib", vars=dict.fromkeys(("base", "platbase"), str(clean_python.parents[1]))
    )
    zipfile.ZipFile(wheel).extractall(packages)
    return clean_python


def succeed(python: Path, *words: str) -> str:
    child = run_clean(python, *words)
    assert child.returncode == 0, child.stdout[-2000:] + child.stderr[-4000:]
    return child.stdout


def test_an_installed_task_is_listed_certified_and_generated(
    python_with_a_task: Path, tmp_path: Path
) -> None:
    verbs = ("-m", "lerobot_bimanual.cli")
    rows = json.loads(
        succeed(python_with_a_task, *verbs, "task", "list", "--task=prehensile", "--format=json")
    )
    assert "raise_block" in {row["name"] for row in rows}
    certificate = tmp_path / "expert.json"
    flags = ("--task=raise_block", "--workers=1")
    measure = ("expert", "evaluate", *flags, "--seeds=0:3", "--replay=joint", f"--output={certificate}")
    succeed(python_with_a_task, *verbs, *measure)
    assert list(json.loads(certificate.read_text())["worlds"]) == ["raise_block"]
    assert "`raise_block`" in succeed(
        python_with_a_task, *verbs, "expert", "report", f"--certificates={tmp_path}"
    )
    rounded = ("--seeds=0:3", "--discretise=100")
    succeed(python_with_a_task, *verbs, "expert", "evaluate", *flags, *rounded)
    root = tmp_path / "dataset"
    size = ("--episodes=2", "--view=keyframes", "--image_size=32")
    succeed(python_with_a_task, *verbs, "dataset", "generate", *flags, *size, f"--root={root}")
    succeed(python_with_a_task, *verbs, "dataset", "verify", f"--root={root}", "--render=2", "--workers=1")


def test_an_installed_task_has_a_gymnasium_id(python_with_a_task: Path) -> None:
    program = (
        "import gymnasium as gym, lerobot_env_bimanual\n"
        "env = gym.make('bimanual/RaiseBlock-v0', obs='state')\n"
        "assert not env.reset(seed=0)[1]['is_success']\n"
    )
    succeed(python_with_a_task, "-c", NO_NETWORK + program)


def test_stock_evaluation_plays_an_installed_task_in_worker_processes(
    python_with_a_task: Path, tmp_path: Path
) -> None:
    checkpoint = ROOT / "results/checkpoints/peract2_on_all"
    flags = (
        f"--policy.path={checkpoint}",
        "--policy.device=cpu",
        "--env.type=bimanual",
        "--env.task=raise_block",
        "--env.image_size=128",
        "--env.max_keyposes=2",
        "--eval.n_episodes=2",
        "--eval.batch_size=2",
        "--eval.use_async_envs=true",
        f"--output_dir={tmp_path}",
    )
    succeed(python_with_a_task, "-m", "lerobot.scripts.lerobot_eval", *flags)
    evaluated = json.loads((tmp_path / "eval_info.json").read_text())
    assert [task["task_group"] for task in evaluated["per_task"]] == ["raise_block"]


def test_a_module_that_does_not_register_its_task_is_named(python_with_a_task: Path, tmp_path: Path) -> None:
    program = (
        "import lerobot_env_bimanual.tasks.registry as registry\n"
        "registry.TASKS.modules['juggle'] = 'json'\n"
        "registry.get_task('juggle')\n"
    )
    child = run_clean(python_with_a_task, "-c", program)
    assert "BimanualError: module 'json' registers no task called 'juggle'" in child.stderr
