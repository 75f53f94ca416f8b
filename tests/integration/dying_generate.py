"""`lerobot-bimanual dataset generate` that kills itself in the middle of a stage; run by test_crash_safety.py.

    python dying_generate.py STAGE SIGHT LATEST_S FLAG...

STAGE is the method of the executor that is under way, `record` or `merge`. Once SIGHT, a pattern of paths in the
staging folder, has appeared, the process is let go on for at most LATEST_S seconds, and never beyond the stage: whoever
kills it from outside comes too late on a busy machine, after the dataset is published.
"""

import os
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from lerobot_bimanual.cli.command_line import main

POLL_S = 0.01
"""How often an executor lets this process look; its own half second is longer than some stages are."""


def die_in(stage: str, sight: str, latest_s: float, partial: Path) -> None:
    """Have generation's own executor end this process, and leave its workers to themselves."""
    from lerobot_env_bimanual.generation import process_executor

    undisturbed = getattr(process_executor.ProcessExecutor, stage)

    def stage_that_ends_deadly(*arguments) -> Iterator[None]:
        left_s = np.random.default_rng().uniform(0, latest_s)  # at another moment in every run of the test
        deadline: float | None = None
        for _ in undisturbed(*arguments):
            if deadline is None and any(partial.glob(sight)):
                deadline = time.monotonic() + left_s
            if deadline is not None and time.monotonic() >= deadline:
                break
            yield
        if deadline is None:
            sys.exit(f"{stage} is over, and {sight} did not appear")
        os.kill(os.getpid(), signal.SIGKILL)

    process_executor.POLL_S = POLL_S
    setattr(process_executor.ProcessExecutor, stage, stage_that_ends_deadly)


if __name__ == "__main__":
    stage, sight, latest_s, *flags = sys.argv[1:]
    root = next(Path(flag.removeprefix("--root=")) for flag in flags if flag.startswith("--root="))
    die_in(stage, sight, float(latest_s), root.with_name(f"{root.name}.partial"))
    sys.exit(main(["dataset", "generate", *flags]))
