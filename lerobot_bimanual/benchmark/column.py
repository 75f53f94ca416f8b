"""Benchmarks of several policies on several tasks, in lanes that work at the same time."""

import os
import shlex
import subprocess
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby
from pathlib import Path

from tqdm import tqdm

from lerobot_bimanual.benchmark.config import BenchmarkConfig, command
from lerobot_bimanual.benchmark.pipeline import end, start
from lerobot_bimanual.benchmark.plan import Plan
from lerobot_bimanual.errors import BimanualError, check_range
from lerobot_bimanual.resources import usable_cores, worker_count
from lerobot_bimanual.results.benchmark import BenchmarkResult
from lerobot_bimanual.results.protocols import PROTOCOLS

POLL_INTERVAL_S = 0.2


def cells(config: BenchmarkConfig, tasks: Sequence[str]) -> list[BenchmarkConfig]:
    """One benchmark per policy and per task that the protocol is for; the policies of a task follow each other.

    Raises:
        BimanualError: a flag is not allowed for one of them, or there is no lane.
    """
    check_range("lanes", config.lanes, 1)
    policies = config.policy.split(",")
    protocol_tasks = PROTOCOLS[config.protocol].tasks if config.protocol in PROTOCOLS else ()
    tasks = [task for task in tasks if task in protocol_tasks] or tasks
    found = [
        replace(config, task=task, policy=policy, lanes=1, dry_run=False)
        for task in tasks
        for policy in policies
    ]
    shared_by = {Plan.of(cell).settings.trained_on for cell in found}
    if config.lanes == 1 or config.workers or any(shared_by) or len(found) == 1:  # in one lane
        return found
    return [replace(cell, workers=max(1, worker_count(0) // config.lanes)) for cell in found]


def run_column(column: Sequence[BenchmarkConfig], lanes: int) -> None:
    """Run benchmarks, those of a task after each other; a failure in one does not keep the others from running.

    Policies of a task share its demonstrations, so a lane takes one task at a time. A network for several tasks is
    shared by all, so it has one lane. The output of each benchmark is in a file of the folder `logs`.

    Raises:
        BimanualError: some failed; the message has the files of their output.
    """
    lanes = 1 if any(Plan.of(cell).settings.trained_on for cell in column) else lanes
    # One core is left to environments and the system, as in `pipeline.start`.
    os.environ.setdefault("OMP_NUM_THREADS", str(max(1, (usable_cores() - 1) // lanes)))
    waiting = deque(deque(group) for _, group in groupby(column, lambda cell: cell.task))
    running: dict[subprocess.Popen[bytes], deque[BenchmarkConfig]] = {}
    failed = []
    with tqdm(total=len(column), unit="benchmark", smoothing=0) as bar:
        try:
            while waiting or running:
                while waiting and len(running) < lanes:
                    lane = waiting.popleft()
                    running[_start(lane[0])] = lane
                for process in [process for process in running if process.poll() is not None]:
                    lane = running.pop(process)
                    cell = lane.popleft()
                    bar.write(f"{cell.task}, {cell.policy}: {_outcome(cell, process.returncode)}")
                    bar.update()
                    if process.returncode:
                        failed.append(str(_log(cell)))
                    if lane:
                        running[_start(lane[0])] = lane
                time.sleep(POLL_INTERVAL_S)
        except KeyboardInterrupt:
            raise KeyboardInterrupt("the same command continues where it stopped") from None
        finally:
            for process in running:
                end(process)
    if failed:
        raise BimanualError(
            f"{len(failed)} of {len(column)} failed; the same command runs them again. Read: {', '.join(failed)}"
        )


def _start(cell: BenchmarkConfig) -> subprocess.Popen[bytes]:
    path = _log(cell)
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("ab") as log:  # after what earlier runs have printed
        return start(shlex.split(command(cell)), log)


def _log(cell: BenchmarkConfig) -> Path:
    return cell.output / "logs" / f"{Plan.of(cell).result.stem}.log"


def _outcome(cell: BenchmarkConfig, code: int) -> str:
    if code:
        return f"failed with exit code {code}, see {_log(cell)}"
    rate = BenchmarkResult.read(Plan.of(cell).result).rates["policy"]
    return f"{rate.successes} of {rate.trials}"
