"""What the benchmarks share: CPU times, a table for people, and the same figures as one line of JSON."""

import argparse
import json
import os
import time
from collections.abc import Callable, Sequence

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")  # read when NumPy is loaded

import pandas as pd

from lerobot_bimanual.terminal import print_table
from lerobot_env_bimanual.tasks.registry import resolve_tasks

type Figures = dict[str, float]


def parser(description: str | None) -> argparse.ArgumentParser:
    """A parser with the flags that all benchmarks have."""
    arguments = argparse.ArgumentParser(description=(description or "").partition("\n")[0])
    arguments.add_argument(
        "--task", default="lift_ball", help="task and suite names, comma separated, or all"
    )
    arguments.add_argument("--rounds", type=int, default=5, help="repetitions; the fastest counts")
    return arguments


def tasks_of(options: argparse.Namespace) -> list[str]:
    return list(resolve_tasks(options.task))


def cpu_s(work: Callable[[], object], calls: int = 1) -> float:
    """CPU seconds of this process, with all its threads, per call."""
    start = time.process_time()
    for _ in range(calls):
        work()
    return (time.process_time() - start) / calls


def interleaved_cpu_s(works: Sequence[Callable[[], object]], rounds: int) -> list[float]:
    """The least CPU seconds of each of several pieces of work, measured in turns so that they meet the same machine."""
    turns = [[cpu_s(work) for work in works] for _ in range(rounds)]
    return [min(times) for times in zip(*turns, strict=True)]


def report(title: str, rows: dict[str, Figures]) -> None:
    """Print a table of named rows that have the same columns, and as the last line all figures as JSON."""
    cells = pd.DataFrame(rows).T.map("{:.4g}".format)
    print_table(cells.rename_axis("").reset_index(), title)
    print(json.dumps({"benchmark": title, "figures": rows}))
