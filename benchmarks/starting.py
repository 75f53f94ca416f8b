"""What programs cost before they do anything, here and in another tree, in turns on the same machine.

Runs command lines that end early, those of LeRobot also with our distributions hidden from its discovery of plugins, which
tells our share. With a dataset of view `keyframes`, trains one step of the small PerAct2 by the stock `lerobot-train` with
several numbers of loader processes. Times are medians of CPU seconds, child processes included; the first word is by
the clock. Prints one line of JSON per command.

    python benchmarks/starting.py --before=/path/to/another/tree
    python benchmarks/starting.py --dataset=data/lift_ball/keyframes --loaders 4 1 0
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).parents[1]
CHECKPOINT = HERE / "results/checkpoints/peract2_on_all"

CLI = ["-m", "lerobot_bimanual.cli"]
HIDE_OURS = """
import importlib.metadata as metadata
found = metadata.distributions
metadata.distributions = lambda **options: (
    each for each in found(**options) if not each.metadata["Name"].startswith("lerobot_")
)
"""
LEROBOT_HELP = """
import sys
from lerobot.scripts.{name} import main
sys.argv = ["program", "--help"]
main()
"""

COMMANDS = {
    "python": ["-c", "pass"],
    "import lerobot_bimanual": ["-c", "import lerobot_bimanual"],
    "import gymnasium": ["-c", "import gymnasium"],
    "import lerobot_env_bimanual": ["-c", "import lerobot_env_bimanual"],
    "import lerobot_policy_bimanual": ["-c", "import lerobot_policy_bimanual"],
    "lerobot-bimanual --help": [*CLI, "--help"],
    "lerobot-bimanual policy inspect --help": [*CLI, "policy", "inspect", "--help"],
    "lerobot-bimanual policy inspect, no checkpoint": [
        *CLI,
        "policy",
        "inspect",
        "--checkpoint=/none",
        "--dataset=/none",
    ],
    "lerobot-bimanual task list": [*CLI, "task", "list"],
    "lerobot-bimanual demo --help": [*CLI, "demo", "--help"],
    "lerobot-bimanual doctor": [*CLI, "doctor"],
    "lerobot-train --help": ["-c", LEROBOT_HELP.format(name="lerobot_train")],
    "lerobot-train --help, without ours": ["-c", HIDE_OURS + LEROBOT_HELP.format(name="lerobot_train")],
    "lerobot-eval --help": ["-c", LEROBOT_HELP.format(name="lerobot_eval")],
    "lerobot-eval --help, without ours": ["-c", HIDE_OURS + LEROBOT_HELP.format(name="lerobot_eval")],
}
"""What is run with Python, by its name in the table."""


def commands_on(dataset: Path, loaders: list[int], folder: Path) -> dict[str, list[str]]:
    """Commands that need a dataset: a row that it has not, and the first step of a training."""
    recipe = HERE / "policies/lerobot_policy_bimanual/peract2/recipes/small.yaml"
    flags = [f"--config_path={recipe}", f"--dataset.root={dataset}", "--policy.device=cpu", "--steps=1"]
    train = ["-m", "lerobot.scripts.lerobot_train", *flags, "--save_checkpoint=false"]
    absent = [f"--checkpoint={CHECKPOINT}", f"--dataset={dataset}", "--index=1000000000"]
    return {"lerobot-bimanual policy inspect, no such row": [*CLI, "policy", "inspect", *absent]} | {
        f"lerobot-train, first step, {count} loaders": [
            *train,
            f"--num_workers={count}",
            f"--output_dir={folder}/{count}",
        ]
        for count in loaders
    }


def run(tree: Path, words: list[str]) -> tuple[float, float]:
    """CPU seconds of a command with a tree's packages, and seconds until its first word on either stream."""
    paths = os.pathsep.join(str(tree / folder) for folder in ("", "envs", "policies"))
    environment = os.environ | {"PYTHONPATH": paths, "OMP_NUM_THREADS": "1", "HF_HUB_OFFLINE": "1"}
    before, start = os.times(), time.perf_counter()
    with subprocess.Popen(
        [sys.executable, *words],
        cwd=tree,  # which Python puts before all other places
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        stdin=subprocess.DEVNULL,
    ) as process:
        assert process.stdout is not None
        process.stdout.read(1)
        first_word_s = time.perf_counter() - start
        process.stdout.read()
    after = os.times()
    spent = after.children_user + after.children_system - before.children_user - before.children_system
    return spent, first_word_s


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--before", type=Path, help="another tree; without it, only this one is measured")
    parser.add_argument("--only", default="", help="part of the names of the commands to run; without it all")
    parser.add_argument("--dataset", type=Path, help="a dataset of view keyframes, for what needs one")
    parser.add_argument("--loaders", type=int, nargs="*", default=[4, 1, 0], help="processes, per training")
    parser.add_argument("--turns", type=int, default=3)
    options = parser.parse_args()
    trees = {"after": HERE} if options.before is None else {"before": options.before.resolve(), "after": HERE}
    for name, words in COMMANDS.items():
        if options.only in name:
            report(name, words, trees, options.turns)
    if options.dataset is not None:
        with tempfile.TemporaryDirectory() as temporary:
            root = options.dataset.resolve()
            for name, words in commands_on(root, options.loaders, Path(temporary)).items():
                trained_by = {"after": HERE} if "loaders" in name else trees  # LeRobot's own work, once
                report(name, words, trained_by, 1 if "loaders" in name else options.turns)


def report(name: str, words: list[str], trees: dict[str, Path], turns: int) -> None:
    """Measure one command and print its line."""
    measured = [{tree: run(path, words) for tree, path in trees.items()} for _ in range(turns)]
    figures: dict[str, object] = {"command": name}
    for tree in trees:
        cpu_s = statistics.median(turn[tree][0] for turn in measured)
        first_word_s = statistics.median(turn[tree][1] for turn in measured)
        figures[tree] = {"cpu_s": round(cpu_s, 2), "first_word_s": round(first_word_s, 1)}
    if "before" in trees:
        ratios = [turn["after"][0] / turn["before"][0] for turn in measured]
        figures["after_to_before"] = round(statistics.median(ratios), 3)
    print(json.dumps(figures), flush=True)


if __name__ == "__main__":
    main()
