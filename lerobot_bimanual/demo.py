"""The `demo` verb: from nothing to a trained and evaluated policy with stock commands only."""

import json
import os
import shlex
import shutil
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.table import Table

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.statistics import SuccessRate

SMALL_PERACT2 = {
    "voxel_size": "25",
    "translation_head": "factorised",
    "decode": "expectation",
    "channels": "16",
    "token_dim": "64",
    "num_latents": "128",
    "latent_dim": "128",
    "depth": "2",
    "heads": "4",
    "attention_dropout": "0",
    "language_tokens": "8",
    "language_dim": "64",
    "keypose_horizon": "8",
    "augmentation_shift_m": "[0.04,0.04,0.02]",
    "augmentation_yaw_deg": "0",
    "optimizer_lr": "2e-3",
}
"""PerAct2 at a size that learns in minutes on a laptop's CPU; docs/learning.md tells what was tried.

With so few steps the paper's augmentation (12.5 cm, 45 degrees) costs more than it gives, and at 4 cm voxels the
centre of the best voxel is too coarse an answer, so the mean over its neighbours is commanded.
"""


@dataclass
class DemoConfig:
    """Flags of the `demo` verb."""

    task: str = "lift_ball"  # a registered task with one variation
    output: Path = Path("outputs/demo")  # new or resumed folder for everything the demo makes
    episodes: int = 60  # expert demonstrations to generate
    steps: int = 800  # optimiser steps
    batch_size: int = 8  # keyframes per step
    eval_episodes: int = 20  # unseen placements on which expert, blind control and policy are scored
    seed: int = 1000  # first of these placements' seeds, in the test split
    workers: int = 0  # processes for generation and certification; 0 takes one per core
    videos: bool = True  # write an mp4 of every evaluated episode


@dataclass(frozen=True)
class Stage:
    """One command of the demo.

    Attributes:
        name: Shown to the user; also the name of the marker that says it is done.
        command: Program and flags, as a user would type them.
    """

    name: str
    command: list[str]

    def __str__(self) -> str:
        return shlex.join(self.command)


def demo(config: DemoConfig) -> None:
    """Generate demonstrations, train a small PerAct2, evaluate it on unseen seeds.

    Runs the stock `lerobot-train` and `lerobot-eval` on expert demonstrations, prints each command so that it
    can be copied, and ends with the success of the policy beside the expert's and that of a blind control,
    which repeats the mean keyposes of the training set. An interrupted demo continues where it stopped.

    Examples:
        lerobot-bimanual demo
        lerobot-bimanual demo --task=push_box --episodes=100 --steps=4000 --output=outputs/push_box
    """
    console = Console()
    root = config.output.resolve()
    root.mkdir(parents=True, exist_ok=True)
    started = time.monotonic()
    for stage in stages(config, root):
        _run(stage, root, console)
    _report(config, root, console)
    console.print(f"[dim]finished in {(time.monotonic() - started) / 60:.1f} minutes[/dim]")


def stages(config: DemoConfig, root: Path) -> list[Stage]:
    """The commands of a demo in their order; `root` is where they write."""
    dataset, train, evaluation = root / "dataset", root / "train", root / "eval"
    test_seeds = f"{config.seed}:{config.seed + config.eval_episodes}"
    workers = config.workers or os.cpu_count() or 1
    certify = [
        "lerobot-bimanual",
        "certify",
        f"--task={config.task}",
        "--split=test",
        f"--seeds={test_seeds}",
        f"--workers={workers}",
    ]
    return [
        Stage("doctor", ["lerobot-bimanual", "doctor"]),
        Stage(
            "generate",
            [
                "lerobot-bimanual",
                "generate",
                f"--task={config.task}",
                f"--episodes={config.episodes}",
                "--view=keyframes",
                "--intermediate=0.35,0.7",
                "--image_size=128",
                f"--root={dataset}",
                f"--repo_id=demo/{config.task}",
                f"--workers={workers}",
            ],
        ),
        Stage("expert", [*certify, "--control=expert", f"--output={root / 'expert.json'}"]),
        Stage("blind", [*certify, "--control=blind", f"--output={root / 'blind.json'}"]),
        Stage(
            "train",
            [
                "lerobot-train",
                f"--dataset.repo_id=demo/{config.task}",
                f"--dataset.root={dataset}",
                "--policy.type=peract2",
                *(f"--policy.{name}={value}" for name, value in SMALL_PERACT2.items()),
                "--policy.device=cpu",
                "--policy.push_to_hub=false",
                f"--steps={config.steps}",
                f"--batch_size={config.batch_size}",
                "--num_workers=1",
                "--log_freq=50",
                f"--save_freq={config.steps}",
                "--wandb.enable=false",
                f"--output_dir={train}",
            ],
        ),
        Stage(
            "evaluate",
            [
                "lerobot-eval",
                f"--policy.path={train / 'checkpoints' / 'last' / 'pretrained_model'}",
                "--policy.device=cpu",
                "--env.type=bimanual",
                f"--env.task={config.task}",
                "--env.image_size=128",
                *([f"--env.video_dir={evaluation / 'motion'}"] if config.videos else []),
                f"--eval.n_episodes={config.eval_episodes}",
                "--eval.batch_size=2",
                f"--seed={config.seed}",
                f"--output_dir={evaluation}",
            ],
        ),
    ]


def _run(stage: Stage, root: Path, console: Console) -> None:
    """Run one command with its output shown, unless the same command has already succeeded here."""
    marker = root / f"{stage.name}.done"
    if marker.is_file() and marker.read_text() == str(stage):
        console.rule(f"[bold]{stage.name}[/bold] (already done)")
        return
    console.rule(f"[bold]{stage.name}[/bold]")
    console.print(f"$ {stage}", style="cyan", soft_wrap=True, highlight=False)
    if stage.name == "train":
        # lerobot-train refuses an existing folder; a killed run of a few minutes is simply run again.
        shutil.rmtree(root / "train", ignore_errors=True)
    program, *flags = stage.command
    environment = {
        **os.environ,
        # The demo needs no network: a dataset or policy that is not found here must fail, not be asked for.
        "HF_HUB_OFFLINE": "1",
        # One core is left to the data loader; threads that wait for each other on a full machine crawl.
        "OMP_NUM_THREADS": str(max(1, (os.cpu_count() or 1) - 1)),
    }
    started = time.monotonic()
    done = subprocess.run([Path(sys.executable).parent / program, *flags], env=environment, check=False)
    if done.returncode:
        raise BimanualError(
            f"stage {stage.name!r} of the demo failed with exit code {done.returncode}; its output is above. "
            f"The same demo command continues from here. The failed command was: {stage}"
        )
    console.print(f"[dim]{stage.name}: {time.monotonic() - started:.0f} s[/dim]")
    marker.write_text(str(stage))


def _report(config: DemoConfig, root: Path, console: Console) -> None:
    """Print the success rates, where everything lies, and the commands."""
    table = Table(title=f"{config.task}: {config.eval_episodes} unseen placements (test split)")
    table.add_column("who acts")
    table.add_column("solved", justify="right")
    table.add_column("95 % interval (Wilson)", justify="right")
    for who, rate in (
        ("expert", _certified_rate(root / "expert.json")),
        ("PerAct2, trained here", _evaluated_rate(root / "eval" / "eval_info.json")),
        ("blind: mean keyposes of the training split", _certified_rate(root / "blind.json")),
    ):
        low, high = rate.interval
        table.add_row(who, f"{rate.successes} of {rate.trials}", f"{low:.0%} to {high:.0%}")
    console.rule("[bold]result[/bold]")
    console.print(table)
    places = {
        "dataset": root / "dataset",
        "checkpoint": root / "train" / "checkpoints" / "last" / "pretrained_model",
        "evaluation": root / "eval" / "eval_info.json",
        "videos": root / "eval" / ("motion" if config.videos else "videos"),
    }
    for name, path in places.items():
        console.print(f"{name:<11} {path}", soft_wrap=True, highlight=False)
    console.print("\nThe commands that were run:")
    for stage in stages(config, root):
        console.print(f"  {stage}", soft_wrap=True, highlight=False)


def _certified_rate(path: Path) -> SuccessRate:
    """Success of a `certify` result."""
    episodes = json.loads(path.read_text())["episodes"]
    return SuccessRate(sum(bool(episode["success"]) for episode in episodes), len(episodes))


def _evaluated_rate(path: Path) -> SuccessRate:
    """Success of a `lerobot-eval` result."""
    outcomes = [
        bool(success)
        for task in json.loads(path.read_text())["per_task"]
        for success in task["metrics"]["successes"]
    ]
    return SuccessRate(sum(outcomes), len(outcomes))
