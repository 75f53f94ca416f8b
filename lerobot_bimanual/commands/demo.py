"""The command `demo`."""

import time
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from lerobot_bimanual.benchmark.config import BenchmarkConfig
from lerobot_bimanual.benchmark.pipeline import Command, Pipeline
from lerobot_bimanual.benchmark.plan import Plan
from lerobot_bimanual.benchmark.run import check_task, report, run
from lerobot_bimanual.terminal import show_next


@dataclass
class DemoConfig:
    """Flags of the command `demo`."""

    # One registered task, with all its variations; `lerobot-bimanual task list` lists them.
    task: str = "lift_ball"
    output: Path = Path("outputs/demo")  # new or resumed folder for everything the demo makes
    steps: int = 1000  # optimiser steps
    workers: int = 0  # processes for generation and for expert and baseline; 0 takes one per core
    video: bool = True  # write an mp4 of every evaluated episode

    @property
    def video_folder(self) -> Path:
        """Folder of the videos."""
        return self.output.resolve() / "videos"

    def benchmark(self) -> BenchmarkConfig:
        """The same as a benchmark: on the CPU, with one checkpoint, so that nothing is to be chosen."""
        return BenchmarkConfig(
            task=self.task,
            steps=self.steps,
            save_freq=self.steps,
            val_episodes=0,
            test_episodes=20,
            first_seed=1000,
            device="cpu",
            workers=self.workers,
            output=self.output,
            video_dir=self.video_folder if self.video else None,
        )


def demo(config: DemoConfig) -> None:
    """Generate demonstrations, train a small PerAct2, evaluate it on unseen seeds.

    A short `lerobot-bimanual policy benchmark`: runs `lerobot-bimanual-train` and `lerobot-eval` on expert demonstrations,
    prints each command so that it can be copied, and ends with the success of the policy beside the expert's and that of
    the open-loop baseline, which repeats the mean keyposes of the training set. An interrupted demo continues where it
    stopped.

    Examples:
        lerobot-bimanual demo
        lerobot-bimanual demo --task=push_box --steps=2000 --output=outputs/push_box
    """
    console, started = Console(), time.monotonic()
    plan = Plan.of(config.benchmark())
    check_task(plan.settings)
    Pipeline(plan.folder, console).run(Command("doctor", ["lerobot-bimanual", "doctor"]))
    result = run(plan, console)
    report(result, plan, console)
    if config.video:
        console.print(f"{'videos':<11} {config.video_folder}", soft_wrap=True, highlight=False)
    console.print(f"[dim]finished in {(time.monotonic() - started) / 60:.1f} minutes[/dim]")
    show_next("lerobot-bimanual", "policy", "benchmark", f"--task={config.task}")
