"""The same measurement with the packages of two trees, in turns on the same machine; for `--before=PATH` of others.

Each tree has a process of its own, which runs the measuring script with `--serve`.
"""

import os
import statistics
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

HERE = Path(__file__).parents[1]
DISTRIBUTIONS = (".", "envs", "policies")
AGAIN = "again\n"

type Figures = list[float]


def serve(ready: Callable[[str], Callable[[], Figures]]) -> None:
    """Ready what a line names; then answer every "again" with its figures, until anything else."""
    for line in sys.stdin:
        measure = ready(line.strip())
        while sys.stdin.readline() == AGAIN:
            print(*measure(), flush=True)


def compare(
    script: str, before: Path, names: Sequence[str], rounds: int, flags: Sequence[str] = ()
) -> Iterator[tuple[str, Figures, Figures]]:
    """Each name with the medians of its figures, before and now.

    Args:
        script: the measuring script, which calls `serve` when it is given `--serve`.
        before: the other tree.
        names: what is measured, one after the other.
        rounds: turns of both trees.
        flags: further words for the script.
    """
    children = [_start(tree, script, flags) for tree in (before.resolve(), HERE)]
    for name in names:
        for child in children:
            _tell(child, f"{name}\n")
        answers = [[_ask(child) for child in children] for _ in range(rounds)]
        for child in children:
            _tell(child, "next\n")
        old, new = (
            [
                statistics.median(figures)
                for figures in zip(*(answer[side] for answer in answers), strict=True)
            ]
            for side in range(2)
        )
        yield name, old, new
    for child in children:
        child.communicate()


def _start(tree: Path, script: str, flags: Sequence[str]) -> subprocess.Popen:
    """A process that measures with the packages of a tree, on one core."""
    paths = os.pathsep.join(str(tree / distribution) for distribution in DISTRIBUTIONS)
    return subprocess.Popen(
        [sys.executable, script, "--serve", *flags],
        env={**os.environ, "PYTHONPATH": paths, "LP_NUM_THREADS": "0", "OMP_NUM_THREADS": "1"},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )


def _tell(child: subprocess.Popen, line: str) -> None:
    assert child.stdin is not None
    child.stdin.write(line)
    child.stdin.flush()


def _ask(child: subprocess.Popen) -> Figures:
    _tell(child, AGAIN)
    assert child.stdout is not None
    return [float(number) for number in child.stdout.readline().split()]
