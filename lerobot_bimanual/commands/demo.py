"""The `demo` verb: from nothing to a trained and evaluated policy with stock commands only."""

import os
import time
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from lerobot_bimanual.benchmark.pipeline import Pipeline, Stage, flag_words
from lerobot_bimanual.benchmark.rates_table import success_table
from lerobot_bimanual.benchmark.recipe import recipe_for
from lerobot_bimanual.benchmark.results import read_certificate, read_evaluation, success_rate


@dataclass
class DemoConfig:
    """Flags of the `demo` verb."""

    task: str = "lift_ball"  # a registered task with one variation
    output: Path = Path("outputs/demo")  # new or resumed folder for everything the demo makes
    episodes: int = 100  # expert demonstrations to generate
    steps: int = 1000  # optimiser steps
    batch_size: int = 8  # keyframes per step
    eval_episodes: int = 20  # unseen placements on which expert, blind control and policy are scored
    seed: int = 1000  # first of these placements' seeds, in the test split
    workers: int = 0  # processes for generation and certification; 0 takes one per core
    videos: bool = True  # write an mp4 of every evaluated episode


def demo(config: DemoConfig) -> None:
    """Generate demonstrations, train a small PerAct2, evaluate it on unseen seeds.

    Runs the stock `lerobot-train` and `lerobot-eval` on expert demonstrations, prints each command so that it
    can be copied, and ends with the success of the policy beside the expert's and that of a blind control,
    which repeats the mean keyposes of the training set. An interrupted demo continues where it stopped.

    Examples:
        lerobot-bimanual demo
        lerobot-bimanual demo --task=push_box --steps=2000 --output=outputs/push_box
    """
    console = Console()
    root = config.output.resolve()
    started = time.monotonic()
    pipeline = Pipeline(root, console)
    for stage in stages(config, root):
        pipeline.run(stage)
    _report(config, root, console)
    console.print(f"[dim]finished in {(time.monotonic() - started) / 60:.1f} minutes[/dim]")


def stages(config: DemoConfig, root: Path) -> list[Stage]:
    """The commands of a demo in their order; `root` is where they write."""
    dataset, train, evaluation = root / "dataset", root / "train", root / "eval"
    policy = train / "checkpoints" / "last" / "pretrained_model"
    recipe = recipe_for("peract2", "small", config.task)
    workers = config.workers or os.cpu_count() or 1
    generate = {
        "task": config.task,
        "episodes": config.episodes,
        "view": "keyframes",
        "intermediate": "0.35,0.7",
        "image_size": 128,
        "root": dataset,
        "repo_id": f"demo/{config.task}",
        "workers": workers,
    }
    certify = {
        "task": config.task,
        "split": "test",
        "seeds": f"{config.seed}:{config.seed + config.eval_episodes}",
        "workers": workers,
    }
    training = {
        "dataset.repo_id": f"demo/{config.task}",
        "dataset.root": dataset,
        "policy.type": "peract2",
        **{f"policy.{name}": value for name, value in recipe.flags.items()},
        "policy.device": "cpu",
        "policy.push_to_hub": "false",
        "steps": config.steps,
        "batch_size": config.batch_size,
        "num_workers": 1,
        "log_freq": 50,
        "save_freq": config.steps,
        "wandb.enable": "false",
        "output_dir": train,
    }
    evaluate = {
        "policy.path": policy,
        "policy.device": "cpu",
        "env.type": "bimanual",
        "env.task": config.task,
        "env.image_size": 128,
        **({"env.video_dir": evaluation / "motion"} if config.videos else {}),
        "eval.n_episodes": config.eval_episodes,
        "eval.batch_size": 2,
        "seed": config.seed,
        "output_dir": evaluation,
    }
    return [
        Stage("doctor", ["lerobot-bimanual", "doctor"]),
        Stage("generate", ["lerobot-bimanual", "generate", *flag_words(generate)], output=dataset),
        *(
            Stage(
                control,
                [
                    "lerobot-bimanual",
                    "certify",
                    *flag_words(certify | {"control": control, "output": root / f"{control}.json"}),
                ],
                output=root / f"{control}.json",
                judges=True,
            )
            for control in ("expert", "blind")
        ),
        Stage("train", ["lerobot-train", *flag_words(training)], output=policy, training_folder=train),
        Stage(
            "evaluate",
            ["lerobot-eval", *flag_words(evaluate)],
            output=evaluation / "eval_info.json",
            inputs=(policy / "model.safetensors",),
        ),
    ]


def _report(config: DemoConfig, root: Path, console: Console) -> None:
    """Print the success rates, where everything lies, and the commands."""
    evaluation = root / "eval" / "eval_info.json"
    rates = {
        "expert": success_rate(read_certificate(root / "expert.json")),
        "PerAct2, trained here": success_rate(read_evaluation(evaluation, config.seed)),
        "blind: mean keyposes of the training split": success_rate(read_certificate(root / "blind.json")),
    }
    console.rule("[bold]result[/bold]")
    console.print(
        success_table(f"{config.task}: {config.eval_episodes} unseen placements (test split)", rates)
    )
    places = {
        "dataset": root / "dataset",
        "checkpoint": root / "train" / "checkpoints" / "last" / "pretrained_model",
        "evaluation": evaluation,
        "videos": root / "eval" / ("motion" if config.videos else "videos"),
    }
    for name, path in places.items():
        console.print(f"{name:<11} {path}", soft_wrap=True, highlight=False)
    console.print("\nThe commands that were run:")
    for stage in stages(config, root):
        console.print(f"  {stage}", soft_wrap=True, highlight=False, markup=False)
