"""Whether the installed environment knows the task of a benchmark."""

import json
import subprocess
import sys

from lerobot_bimanual.benchmark.plan import BenchmarkConfig
from lerobot_bimanual.errors import BimanualError, UnknownVariation


def check_task(config: BenchmarkConfig) -> None:
    """Ask the environment, before anything runs that takes minutes.

    Through its command `task list` in a process of its own: core knows the environment by its commands only.

    Raises:
        BimanualError: no environment is installed, or what is asked for is no task, a suite, or a variation that the
            task does not have.
    """
    tasks = _variations(config.task)
    if tasks.keys() != {config.task}:
        raise BimanualError(
            f"task is {config.task!r}, a suite, but a benchmark is of one task; run one for each of: {', '.join(tasks)}"
        )
    if config.variation != "any" and int(config.variation) >= tasks[config.task]:
        raise UnknownVariation(config.task, config.variation, tasks[config.task])
    if config.trained_on and config.task not in (learned := _variations(config.trained_on)):
        raise BimanualError(
            f"trained_on is {config.trained_on!r}, of which {config.task!r} is none, so that nothing of it would be learned; "
            f"score one of: {', '.join(learned)}"
        )


def _variations(tasks: str) -> dict[str, int]:
    """How many each task has, of tasks and suites separated by commas."""
    words = ["task", "list", f"--task={tasks}", "--format=json"]
    program = [sys.executable, "-m", "lerobot_bimanual.cli"]
    answer = subprocess.run([*program, *words], capture_output=True, text=True, check=False)
    if answer.returncode:
        raise BimanualError(answer.stderr.strip().removeprefix("lerobot-bimanual: "))
    return {task["name"]: len(task["variations"]) for task in json.loads(answer.stdout)}
