"""How fast stored demonstrations are read again, and how long training waits for them.

Reads rows at random, one after the other in one process, of both views as we write them and as LeRobot's plain
writer does. Then trains the small PerAct2 recipe for a few steps with the stock `lerobot-train` and takes from its
log which share of a step it waited for data. Its loader processes start and fill their queues during the first
steps, which are told apart. Prints two tables and, as the last line, the same figures as JSON.

    python benchmarks/loading.py
    python benchmarks/loading.py --demos=100 --runs keyframes          # what the small recipe trains on
    python benchmarks/loading.py --root=data/lift_ball --loaders 0 1   # a dataset that is there, view keyframes
"""

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")  # read when NumPy is loaded

import datasets.config
import numpy as np
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from recording_jobs import PlainWriter, record
from rich.console import Console
from rich.table import Table

from lerobot_bimanual.benchmark.protocol import PROTOCOLS
from lerobot_bimanual.benchmark.recipe import Recipe
from lerobot_bimanual.dataset.writer import ViewWriter
from lerobot_env_bimanual.commands.dataset_generate import DatasetGenerateConfig, settings_of
from lerobot_env_bimanual.generation.shard import quieten_libraries

RUNS = {
    "keyframes": ("keyframes", ViewWriter),
    "keyframes, plain": ("keyframes", PlainWriter),
    "frames": ("frames", ViewWriter),
    "frames, plain": ("frames", PlainWriter),
}
"""View and writer of each dataset that is read; the first is trained on."""

LOADERS = (4, 2, 1)
"""Loader processes: `lerobot-train`'s default, and as many as two cores have to offer in all and beside training."""

WINDOW_STEPS = 20
"""That are skipped, and then that count; more than the 16 batches that four loaders have ready when they start."""

RECIPE = Recipe.find("peract2", "small")
IMAGE_SIZE = PROTOCOLS["small"].image_size


def read(root: Path, reads: int) -> dict[str, Any]:
    """Rows per second, drawn at random."""
    dataset = LeRobotDataset("local/benchmark", root=root)
    rows = np.random.default_rng(0).integers(len(dataset), size=reads).tolist()
    dataset[rows[0]]  # the first read opens the table
    start_cpu, start = time.process_time(), time.perf_counter()
    for row in rows:
        dataset[row]
    cpu_s, wall_s = time.process_time() - start_cpu, time.perf_counter() - start
    return {
        "rows": len(dataset),
        "items_per_cpu_s": round(reads / cpu_s, 1),
        "items_per_s": round(reads / wall_s, 1),
    }


def train(root: Path, loaders: int, folder: Path) -> dict[str, Any]:
    """Seconds per step that `lerobot-train` waited and worked, by its own log."""
    flags = RECIPE.flags(IMAGE_SIZE) | {
        "dataset.root": root,
        "policy.device": "cpu",
        "num_workers": loaders,
        "steps": 2 * WINDOW_STEPS,
        "log_freq": WINDOW_STEPS,
        "save_checkpoint": "false",
        "output_dir": folder / f"train-{loaders}",
    }
    program = Path(sys.executable).with_name("lerobot-train")
    words = [f"--{name}={value}" for name, value in flags.items()]
    all_cores = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    environment = all_cores | {"HF_DATASETS_CACHE": str(folder / "cache"), "HF_HUB_OFFLINE": "1"}
    output = subprocess.run(
        [program, *words],
        check=True,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    ).stdout
    windows = re.findall(r"updt_s:([\d.]+) data_s:([\d.]+)", output)  # averages since the line before
    (_, first_wait_s), (work_s, wait_s) = [tuple(map(float, window)) for window in windows]
    return {
        "loaders": loaders,
        "start_s": round(WINDOW_STEPS * (first_wait_s - wait_s), 1),
        "work_s": work_s,
        "wait_s": wait_s,
        "share_waiting": round(wait_s / (wait_s + work_s), 3),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--task", default="lift_ball")
    parser.add_argument("--demos", type=int, default=3)
    parser.add_argument("--image_size", default=str(IMAGE_SIZE), help="side in pixels, or HEIGHTxWIDTH")
    parser.add_argument(
        "--runs", nargs="+", choices=RUNS, default=list(RUNS), help="datasets; the first trains"
    )
    parser.add_argument("--root", type=Path, help="a dataset that is there, instead of --runs")
    parser.add_argument("--reads", type=int, default=100)
    parser.add_argument("--loaders", nargs="*", type=int, default=LOADERS, help="processes, per training")
    options = parser.parse_args()
    quieten_libraries()
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        datasets.config.HF_DATASETS_CACHE = folder / "cache"
        roots = {str(options.root): options.root} if options.root else make_datasets(options, folder)
        reading = [{"dataset": name, **read(root, options.reads)} for name, root in roots.items()]
        trained = next(iter(roots.values()))
        training = [train(trained, loaders, folder) for loaders in options.loaders]
    console = Console(width=160)
    headings = ("dataset", "rows", "items per CPU s", "items per s")
    console.print(table_of("Random rows through LeRobotDataset, one process", headings, reading))
    headings = ("loader processes", "their start, s", "work, s per step", "wait, s per step", "share waiting")
    console.print(table_of(f"Training on {next(iter(roots))}, batch {RECIPE.batch_size}", headings, training))
    figures = {"cores": os.cpu_count(), "reading": reading, "training": training}
    print(json.dumps(vars(options) | {"root": str(options.root)} | figures))


def make_datasets(options: argparse.Namespace, folder: Path) -> dict[str, Path]:
    """Record each of the runs; folders by name."""
    roots = {}
    for name in options.runs:
        view, writer = RUNS[name]
        config = DatasetGenerateConfig(
            task=options.task,
            episodes=options.demos,
            view=view,
            image_size=options.image_size,
            root=folder / name,
        )
        record(settings_of(config), writer, folder / name)
        roots[name] = folder / name / "merged"
    return roots


def table_of(title: str, headings: tuple[str, ...], rows: list[dict[str, Any]]) -> Table:
    table = Table(*headings, title=title)
    for row in rows:
        table.add_row(*map(str, row.values()))
    return table


if __name__ == "__main__":
    main()
