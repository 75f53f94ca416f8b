"""LeRobot's own command lines train, resume and evaluate the policies on a generated dataset."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from lerobot.configs import PreTrainedConfig
from lerobot.utils.import_utils import register_third_party_plugins
from safetensors.torch import load_file

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1800)]

SIZE = 32
# So that 2 steps and 2 more are the same as 4. After a resume of `lerobot-train`, dropout and augmentation go on with
# other random numbers, because LeRobot's loader has drawn one more; `lerobot-bimanual-train` takes that back.
CONSTANT = ["--policy.lr_schedule=constant"]
NOTHING_RANDOM = ["--policy.attention_dropout=0", "--policy.augmentation=false"]
CAMERA = {"type": "VISUAL", "shape": [3, SIZE, SIZE]}
TINY_ACT = [
    "--policy.type=act",
    "--policy.pretrained_backbone_weights=null",
    "--policy.dim_model=32",
    "--policy.n_heads=2",
    "--policy.dim_feedforward=64",
    "--policy.n_encoder_layers=1",
    "--policy.chunk_size=5",
    "--policy.n_action_steps=5",
    "--policy.input_features="
    + json.dumps(
        {f"observation.images.{camera}": CAMERA for camera in ("front", "left_wrist", "right_wrist")}
        | {"observation.state": {"type": "STATE", "shape": [16]}}
    ),
]
UNNAMED_ACT = [flag for flag in TINY_ACT if not flag.startswith("--policy.input_features")]


def run(command: str, *flags: str, folder: Path, fails: bool = False) -> str:
    """What a command of this environment prints, offline and on one thread."""
    child = subprocess.run(
        [str(Path(sys.executable).with_name(command)), *flags],
        cwd=folder,
        env=os.environ | {"HF_HUB_OFFLINE": "1", "OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert bool(child.returncode) == fails, child.stdout[-2000:] + child.stderr[-4000:]
    return child.stdout + child.stderr


def train(*flags: str, folder: Path, command: str = "lerobot-train") -> None:
    run(
        command,
        *flags,
        "--policy.device=cpu",
        "--policy.push_to_hub=false",
        "--batch_size=2",
        "--num_workers=0",
        "--env_eval_freq=0",
        folder=folder,
    )


def evaluate(output: str, folder: Path, *flags: str) -> dict:
    run(
        "lerobot-eval",
        f"--policy.path={output}/checkpoints/last/pretrained_model",
        "--policy.device=cpu",
        "--env.type=bimanual",
        "--env.task=push_box",
        f"--env.image_size={SIZE}",
        "--eval.n_episodes=1",
        "--eval.batch_size=1",
        f"--output_dir={output}/eval",
        *flags,
        folder=folder,
    )
    return json.loads((folder / output / "eval" / "eval_info.json").read_text())["overall"]


def weights(folder: Path) -> dict:
    return load_file(folder / "checkpoints" / "last" / "pretrained_model" / "model.safetensors")


def horizons(run_folder: Path, data: Path) -> tuple[int, int]:
    """The keypose horizon in a run's checkpoint, and one more than the most keyposes in its dataset."""
    model = run_folder / "checkpoints" / "last" / "pretrained_model"
    stats = json.loads((data / "meta" / "stats.json").read_text())
    (most,) = stats["observation.keypose_step"]["max"]
    return json.loads((model / "config.json").read_text())["keypose_horizon"], 1 + round(most)


@pytest.fixture(scope="module")
def room(tmp_path_factory) -> Path:
    """A folder with a dataset of two demonstrations in both views."""
    folder = tmp_path_factory.mktemp("room")
    flags = ("--task=push_box", "--episodes=2", f"--image_size={SIZE}", "--workers=1", "--root=data")
    run("lerobot-bimanual", "dataset", "generate", *flags, folder=folder)
    return folder


def keypose_policy_types() -> list[str]:
    """All registered ones."""
    register_third_party_plugins()
    return [
        name
        for name, config in PreTrainedConfig.get_known_choices().items()
        if config.__module__.startswith("lerobot_policy_bimanual.")
    ]


@pytest.mark.parametrize("policy", keypose_policy_types())
def test_keypose_policy_trains_and_is_evaluated(room, tiny_flags, policy):
    data = ("--dataset.repo_id=local/data", f"--dataset.root={room / 'data' / 'keyframes'}")
    flags = (*tiny_flags[policy], *data, f"--output_dir={policy}")
    train(*flags, "--steps=20", "--save_freq=20", folder=room)
    kept, expected = horizons(room / policy, room / "data" / "keyframes")
    assert kept == expected
    assert instructions(room / policy) == ["push the box to the red area"]
    assert evaluate(policy, room)["n_episodes"] == 1


def instructions(run_folder: Path) -> list[str]:
    """What a run's checkpoint says that it was trained to."""
    model = run_folder / "checkpoints" / "last" / "pretrained_model"
    return json.loads((model / "config.json").read_text())["trained_instructions"]


def test_a_checkpoint_elsewhere_warns_and_without_depth_stops_with_the_flag(room, tiny_flags):
    data = ("--dataset.repo_id=local/data", f"--dataset.root={room / 'data' / 'keyframes'}")
    train(*tiny_flags["peract2"], *data, "--output_dir=away", "--steps=1", "--save_freq=1", folder=room)
    flags = (
        "--policy.path=away/checkpoints/last/pretrained_model",
        "--policy.device=cpu",
        "--env.type=bimanual",
        "--env.task=lift_ball",
        "--env.image_size=48",
        "--eval.n_episodes=2",
        "--eval.batch_size=1",
    )
    said = run("lerobot-eval", *flags, "--output_dir=away/eval", folder=room)
    assert said.count("never trained to 'lift the ball'") == 1
    assert said.count("--env.image_size=32") == 1
    said = run("lerobot-eval", *flags, "--env.obs=rgb", "--output_dir=away/rgb", folder=room, fails=True)
    (line,) = [line for line in said.splitlines() if "BadObservation: " in line]
    assert "--env.obs=rgbd" in line
    assert "KeyError" not in said


def test_the_folder_above_the_views_is_answered_in_one_line(room, tiny_flags):
    said = run(
        "lerobot-bimanual-train",
        *tiny_flags["peract2"],
        "--dataset.repo_id=local/data",
        "--dataset.root=data",
        "--policy.device=cpu",
        "--policy.push_to_hub=false",
        "--output_dir=above",
        folder=room,
        fails=True,
    )
    assert "--dataset.root=data/keyframes" in said.splitlines()[-1]
    assert "DatasetError" not in said  # as a trace would end


@pytest.mark.parametrize(
    ("command", "randomness"),
    [
        ("lerobot-train", NOTHING_RANDOM),
        ("lerobot-bimanual-train", ["--policy.attention_dropout=0.5", "--policy.augmentation=true"]),
    ],
)
def test_training_resumes_exactly(room, tiny_flags, command, randomness):
    data = ("--dataset.repo_id=local/data", f"--dataset.root={room / 'data' / 'keyframes'}")
    flags = (*tiny_flags["peract2"], *CONSTANT, *randomness, *data)
    whole, parts = f"{command}-straight", f"{command}-resumed"
    train(*flags, f"--output_dir={whole}", "--steps=4", "--save_freq=4", folder=room, command=command)
    train(*flags, f"--output_dir={parts}", "--steps=2", "--save_freq=2", folder=room, command=command)
    config = room / parts / "checkpoints" / "last" / "pretrained_model" / "train_config.json"
    run(command, f"--config_path={config}", "--resume=true", "--steps=4", folder=room)
    straight, resumed = weights(room / whole), weights(room / parts)
    assert straight.keys() == resumed.keys()
    assert all(straight[name].equal(resumed[name]) for name in straight)


@pytest.mark.parametrize(("view", "policy"), [("keyframes", "peract2"), ("frames", "act")])
def test_training_from_memory_gives_the_same_weights(room, tiny_flags, view, policy):
    data = ("--dataset.repo_id=local/data", f"--dataset.root={room / 'data' / view}")
    kind = TINY_ACT if policy == "act" else tiny_flags[policy]
    for command in ("lerobot-train", "lerobot-bimanual-train"):
        output = f"--output_dir={command}-{policy}"
        train(*kind, *data, output, "--steps=3", "--save_freq=3", folder=room, command=command)
    stock, resident = (
        weights(room / f"{name}-{policy}") for name in ("lerobot-train", "lerobot-bimanual-train")
    )
    assert stock.keys() == resident.keys()
    assert all(stock[name].equal(resident[name]) for name in stock)


@pytest.mark.parametrize("command", ["lerobot-train", "lerobot-bimanual-train"])
def test_the_horizon_is_that_of_the_longest_task(room, tiny_flags, command):
    if not (room / "tasks").exists():
        flags = ("--task=push_box,lift_tray", "--episodes=1", f"--image_size={SIZE}", "--workers=1")
        run(
            "lerobot-bimanual", "dataset", "generate", *flags, "--view=keyframes", "--root=tasks", folder=room
        )
    data = ("--dataset.repo_id=local/tasks", "--dataset.root=tasks")
    output = f"--output_dir=tasks-{command}"
    train(*tiny_flags["peract2"], *data, output, "--steps=1", "--save_freq=1", folder=room, command=command)
    kept, expected = horizons(room / f"tasks-{command}", room / "tasks")
    assert kept == expected


def test_act_trains_on_named_cameras_and_is_evaluated(room):
    data = ("--dataset.repo_id=local/data", f"--dataset.root={room / 'data' / 'frames'}")
    train(*TINY_ACT, *data, "--output_dir=act", "--steps=2", "--save_freq=2", folder=room)
    assert evaluate("act", room)["n_episodes"] == 1


def test_act_trains_on_a_dataset_without_depth_as_it_is(room):
    flags = ("--task=push_box", "--episodes=1", f"--image_size={SIZE}", "--workers=1", "--view=frames")
    run("lerobot-bimanual", "dataset", "generate", *flags, "--depth=false", "--root=colours", folder=room)
    data = ("--dataset.repo_id=local/colours", "--dataset.root=colours")
    train(*UNNAMED_ACT, *data, "--output_dir=unnamed", "--steps=2", "--save_freq=2", folder=room)
    assert evaluate("unnamed", room, "--env.obs=rgb")["n_episodes"] == 1
