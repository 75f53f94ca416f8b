"""What whole commands cost: starting, recording, decoding and scoring, in CPU seconds of all their processes.

What a command pays once is told from what each episode costs by two runs of different length.

    python benchmarks/commands.py starting
    python benchmarks/commands.py recording --task=all
    python benchmarks/commands.py decoding
    python benchmarks/commands.py scoring --task=handover_item_easy
"""

import argparse
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path

from harness import Figures, command_cpu_s, cpu_s, parser, report, tasks_of

CHECKPOINT = Path(__file__).parents[1] / "results/checkpoints/peract2_on_all"
HIDE_OURS = """
import importlib.metadata as metadata
found = metadata.distributions
metadata.distributions = lambda **options: (
    each for each in found(**options) if not each.metadata["Name"].startswith("lerobot_")
)
"""
TRAIN_HELP = """
import sys
from lerobot.scripts.lerobot_train import main
sys.argv = ["lerobot-train", "--help"]
main()
"""
STARTS = {
    "import lerobot_env_bimanual": ["python", "-c", "import lerobot_env_bimanual"],
    "lerobot-bimanual --help": ["lerobot-bimanual", "--help"],
    "lerobot-train --help": ["python", "-c", TRAIN_HELP],
    "lerobot-train --help, without our plugins": ["python", "-c", HIDE_OURS + TRAIN_HELP],
}


def starting(options: argparse.Namespace, folder: Path) -> dict[str, Figures]:
    """CPU seconds of commands that end early."""
    return {
        name: {"CPU s": min(command_cpu_s(words, folder) for _ in range(options.rounds))}
        for name, words in STARTS.items()
    }


def per_episode(run: Callable[[int], float], options: argparse.Namespace) -> Figures:
    """CPU seconds of one more episode, and of everything that does not depend on their number."""
    few, many = options.episodes, 3 * options.episodes
    few_s, many_s = run(few), run(many)
    episode_s = (many_s - few_s) / (many - few)
    return {"CPU s per episode": episode_s, "CPU s once": few_s - few * episode_s}


def generate(task: str, episodes: int, options: argparse.Namespace, root: Path, view: str = "both") -> float:
    """Record a dataset with one worker."""
    sizes = (f"--episodes={episodes}", f"--image_size={options.image_size}", f"--view={view}", "--workers=1")
    return command_cpu_s(
        ["lerobot-bimanual", "dataset", "generate", f"--task={task}", *sizes, f"--root={root}"]
    )


def recording(options: argparse.Namespace, folder: Path) -> dict[str, Figures]:
    """Generate both views, shards merged."""
    rows = {}
    for task in tasks_of(options):
        run = lambda count, task=task: generate(task, count, options, folder / f"{task}-{count}")  # noqa: E731
        figures = per_episode(run, options)
        rows[task] = figures | {"per hour of two cores": 2 * 3600 / figures["CPU s per episode"]}
    return rows


def decoding(options: argparse.Namespace, folder: Path) -> dict[str, Figures]:
    """Decode a dataset into memory, as `lerobot-bimanual-train` does before its first step."""
    import torch
    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    from lerobot_policy_bimanual.training.resident_dataset import ResidentDataset

    rows = {}
    for task in tasks_of(options):
        generate(task, options.episodes, options, folder / task, view="keyframes")
        dataset = LeRobotDataset("local/benchmark", root=folder / task, return_uint8=True)
        decode = partial(ResidentDataset, dataset, torch.device("cpu"))
        seconds = min(cpu_s(decode) for _ in range(options.rounds))
        rows[task] = {"rows per CPU s": len(dataset) / seconds}
    return rows


def scoring(options: argparse.Namespace, folder: Path) -> dict[str, Figures]:
    """Score the committed checkpoint by LeRobot's own command; it films the first ten episodes."""

    def run(task: str, episodes: int) -> float:
        flags = {
            "policy.path": CHECKPOINT,
            "policy.device": "cpu",
            "env.type": "bimanual",
            "env.task": task,
            "env.image_size": 128,
            "eval.batch_size": 1,
            "eval.n_episodes": 10 + episodes,
            "output_dir": folder / f"{task}-{episodes}",
        }
        return command_cpu_s(["lerobot-eval", *(f"--{name}={value}" for name, value in flags.items())])

    return {
        task: per_episode(lambda count, task=task: run(task, count), options) for task in tasks_of(options)
    }


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("what", choices=("starting", "recording", "decoding", "scoring"))
    arguments.add_argument(
        "--episodes", type=int, default=2, help="of the shorter run; the longer has three times as many"
    )
    arguments.add_argument("--image_size", type=int, default=256, help="of what is recorded")
    options = arguments.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        rows = globals()[options.what](options, Path(folder))
    report(f"{options.what}, CPU time", rows)


if __name__ == "__main__":
    main()
