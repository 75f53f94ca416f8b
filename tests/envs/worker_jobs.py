"""What the tests of workers have them do; a module of its own, so that workers can import it."""

import contextlib
import os
import signal
import time
from pathlib import Path

from lerobot_env_bimanual import BimanualEnv

OBSTINATE = "obstinate"


class Unportable(Exception):
    """Cannot be made again from its message."""

    def __init__(self, first: int, second: int):
        super().__init__("two numbers")


def double_or_die(word: str) -> str:
    """Twice the word; `obstinate` kills its process each time, a path only the first time, when it makes the file."""
    if word == OBSTINATE:
        os.kill(os.getpid(), signal.SIGKILL)
    if word.startswith("/") and not Path(word).exists():
        Path(word).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    time.sleep(0.05)
    return 2 * word


def raise_unportable(_: str) -> None:
    raise Unportable(1, 2)


def misspell_a_prop(_: str) -> None:
    BimanualEnv("lift_ball").scene.pose("bal")


def result_without_a_pickle(_: str) -> object:
    return lambda: None


def processes_of(session: int) -> list[int]:
    """Processes of a session, as of a command that was started in a new one."""
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(ProcessLookupError):
            if os.getsid(int(entry.name)) == session:
                found.append(int(entry.name))
    return found
