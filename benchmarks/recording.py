"""What a stored demonstration costs, stage by stage, and how many an hour `lerobot-bimanual dataset generate` makes.

Records the same few demonstrations in every form, merges them, and writes them once more with LeRobot's plain
writer and its default settings (whose encoding is part of its writing: it has no stage of its own to stop). Then
times whole runs of the command with one and with two workers. A run takes the longer the more it has to do, after
a start that it does only once: two runs of different length tell the one from the other. CPU times count child
processes. Prints two tables and, as the last line, the same figures as JSON.

    python benchmarks/recording.py
    python benchmarks/recording.py --task=push_box --image_size=128 --demos=10 --workers 2

With `--before` another tree records the same in turns with this one, both views, and the ratios are printed:

    python benchmarks/recording.py --task=lift_ball,push_box --before=/path/to/another/tree
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Literal

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")  # read when NumPy is loaded

import numpy as np
from numpy.typing import NDArray
from recording_jobs import STAGES, PlainWriter, Recording, record
from rich.console import Console
from rich.table import Table
from two_trees import Figures, compare, serve

from lerobot_bimanual.dataset.writer import ViewWriter
from lerobot_env_bimanual.commands.dataset_generate import DatasetGenerateConfig, settings_of
from lerobot_env_bimanual.generation.settings import GenerationSettings
from lerobot_env_bimanual.generation.shard import quieten_libraries

type View = Literal["frames", "keyframes", "both"]

RUNS: dict[str, tuple[View, type[ViewWriter]]] = {
    "both views": ("both", ViewWriter),
    "frames": ("frames", ViewWriter),
    "frames, plain": ("frames", PlainWriter),
    "keyframes": ("keyframes", ViewWriter),
    "keyframes, plain": ("keyframes", PlainWriter),
}
"""View and writer of each run."""

WARM_UP = {"episodes": 1, "image_size": "32"}
"""A recording that does not count: libraries load much of themselves when they are first used."""


def dataset_of(options: argparse.Namespace, view: View, root: Path, **others: Any) -> GenerationSettings:
    values = {"task": options.task, "episodes": options.demos, "image_size": options.image_size}
    return settings_of(DatasetGenerateConfig(**values | others, view=view, root=root))


def ready(task: str, options: argparse.Namespace) -> Callable[[], Figures]:
    """Measures the CPU seconds of every stage of a demonstration in both views, merging included."""
    of_task = argparse.Namespace(**vars(options) | {"task": task})

    def stage_seconds() -> Figures:
        with tempfile.TemporaryDirectory() as temporary:
            folder = Path(temporary)
            recording = record(dataset_of(of_task, "both", folder), ViewWriter, folder / task)
        return [*(recording.seconds[stage][0] for stage in STAGES), recording.merging[0] / options.demos]

    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        record(dataset_of(of_task, "both", folder, **WARM_UP), ViewWriter, folder / "warm-up")
    return stage_seconds


def print_ratios(options: argparse.Namespace) -> None:
    """What a demonstration costs beside another tree, and how many an hour two cores make without anything else."""
    stages = (*STAGES, "merging")
    flags = [f"--demos={options.demos}", f"--image_size={options.image_size}"]
    figures = {}
    print(f"| task | {' | '.join(stages)} | all, CPU s | now / before | per hour of two cores |")
    print(f"|---|{'---:|' * (len(stages) + 3)}")
    for task, old, new in compare(__file__, options.before, options.task.split(","), options.rounds, flags):
        cells = [f"{a:.2f} to {b:.2f}" for a, b in zip([*old, sum(old)], [*new, sum(new)], strict=True)]
        per_hour = [2 * 3600 / sum(side) for side in (old, new)]
        ratio = f"{sum(new) / sum(old):.2f} | {per_hour[0]:.0f} to {per_hour[1]:.0f}"
        print(f"| `{task}` | {' | '.join(cells)} | {ratio} |", flush=True)
        figures[task] = {"stages": stages, "before_s": old, "now_s": new, "per_hour": per_hour}
    print(json.dumps(figures))


def costs_table(recordings: dict[str, Recording], options: argparse.Namespace) -> Table:
    title = f"{options.task}, {options.image_size} px, per demonstration of {options.demos}: CPU s / wall s"
    table = Table("", *recordings, title=title)
    for stage in STAGES:
        table.add_row(stage, *(cell(each.seconds[stage]) for each in recordings.values()))
    totals = (np.sum(list(each.seconds.values()), axis=0) for each in recordings.values())
    table.add_row("total", *map(cell, totals), end_section=True)
    merging = (cell(each.merging) for each in recordings.values())
    table.add_row(f"merging all {options.demos}, once", *merging, end_section=True)
    for what in next(iter(recordings.values())).megabytes:
        table.add_row(f"{what}, MB", *(f"{each.megabytes[what]:.2f}" for each in recordings.values()))
    return table


def cell(times: Sequence[float] | NDArray) -> str:
    cpu_s, wall_s = times
    return f"{cpu_s:.2f} / {wall_s:.2f}" if wall_s else ""


def time_generate(options: argparse.Namespace, workers: int, demos: int, root: Path) -> float:
    """Wall seconds of a whole run, with an equal share of the demonstrations for each worker."""
    start = time.perf_counter()
    flags = {
        "task": options.task,
        "episodes": demos,
        "image_size": options.image_size,
        "workers": workers,
        "episodes_per_shard": demos // workers,
        "root": root,
    }
    program = Path(sys.executable).with_name("lerobot-bimanual")
    words = [f"--{name}={value}" for name, value in flags.items()]
    subprocess.run([program, "dataset", "generate", *words], check=True, capture_output=True)
    return time.perf_counter() - start


def rate(options: argparse.Namespace, workers: int, folder: Path) -> dict[str, float]:
    """Start-up and demonstrations per hour after it, from a run of one per worker and a longer one."""
    few, many = workers, workers * (1 + options.demos)
    short_s, long_s = (time_generate(options, workers, demos, folder / str(demos)) for demos in (few, many))
    demo_s = (long_s - short_s) / (many - few)
    return {
        "workers": workers,
        "demos": many,
        "seconds": round(long_s, 1),
        "start_s": round(short_s - few * demo_s, 1),
        "demos_per_hour": round(3600 / demo_s),
    }


def rates_table(rates: list[dict[str, float]]) -> Table:
    headings = ("workers", "demonstrations", "run, s", "of it start, s", "then per hour")
    table = Table(*headings, title="`lerobot-bimanual dataset generate`, both views, by the clock")
    for each in rates:
        table.add_row(*map(str, each.values()))
    return table


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--task", default="lift_ball")
    parser.add_argument("--demos", type=int, default=3)
    parser.add_argument("--image_size", default="256", help="side in pixels, or HEIGHTxWIDTH")
    parser.add_argument("--runs", nargs="*", choices=RUNS, default=list(RUNS))
    parser.add_argument("--workers", nargs="*", type=int, default=[1, 2], help="of runs of `generate`")
    parser.add_argument("--before", type=Path, help="compare with another tree")
    parser.add_argument("--rounds", type=int, default=2, help="turns of both trees")
    parser.add_argument("--serve", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    quieten_libraries()
    if options.serve:
        serve(lambda task: ready(task, options))
        return
    if options.before is not None:
        print_ratios(options)
        return
    recordings: dict[str, Recording] = {}
    rates: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        record(dataset_of(options, "both", folder, **WARM_UP), ViewWriter, folder / "warm-up")
        for name in options.runs:
            view, writer = RUNS[name]
            recordings[name] = record(dataset_of(options, view, folder), writer, folder / name)
        for workers in options.workers:
            rates.append(rate(options, workers, folder / f"workers-{workers}"))
    console = Console(width=160)
    if recordings:
        console.print(costs_table(recordings, options))
    if rates:
        console.print(rates_table(rates))
    costs = {name: asdict(recording) for name, recording in recordings.items()}
    print(json.dumps(vars(options) | {"cores": os.cpu_count(), "per_demo": costs, "generate": rates}))


if __name__ == "__main__":
    main()
