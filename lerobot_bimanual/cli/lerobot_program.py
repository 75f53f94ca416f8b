"""Runs a program of LeRobot under our name: checks what it can before LeRobot's import, and reports failures on one line."""

import errno
import logging
import os
import sys
from collections.abc import Callable, Mapping
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any, TextIO

from lerobot_bimanual.checkpoint_folder import require_checkpoint_if_local
from lerobot_bimanual.cli.command_line import TRACEBACK_VARIABLE, run_reporting_errors
from lerobot_bimanual.cli.lerobot_flags import (
    KEEP_FLAG,
    TRUST_FLAG,
    flag_values,
    is_trusted,
    strip_plugin_flags,
)
from lerobot_bimanual.distributions import installed_version
from lerobot_bimanual.errors import BimanualError

MAX_LINES = 3
"""Longer messages are dumps of configs and metrics, or tracebacks of libraries that go on without what they lack."""


DISK_REFUSALS = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES)


class Filtered:
    """A stream that drops dumps and torchcodec's messages, and unless `progress` also LeRobot's bars and reports."""

    def __init__(self, stream: TextIO, progress: bool):
        self.unfiltered, self._progress, self._shows = stream, progress, progress

    def write(self, text: str) -> int:
        """Write a text above the bars, or drop it; a line break by itself is treated as the text before it."""
        from tqdm import tqdm

        is_bar = text.startswith(("\r", "\x1b", "\n"))
        is_dump = text.count("\n") > MAX_LINES or "torchcodec" in text
        if text != "\n":  # which `print` writes by itself
            is_message = not (is_bar or is_dump or text.startswith("INFO"))
            self._shows = is_message or (self._progress and (is_bar or not is_dump))
        if self._shows and is_bar:
            self.unfiltered.write(text)
        elif self._shows:
            with tqdm.external_write_mode(self.unfiltered):
                self.unfiltered.write(text)
        return len(text)

    def __getattr__(self, name: str) -> Any:
        """Anything else is the stream's."""
        return getattr(self.unfiltered, name)


def run_program(
    program: str,
    check: Callable[[Mapping[str, str]], None],
    work: Callable[[Mapping[str, str]], object],
    progress: bool,
) -> int:
    """Run a program with the flags of this process; returns its exit code.

    Args:
        program: its name.
        check: checks the values of flags by name before LeRobot is imported.
        work: imports LeRobot and does the work; it gets the same values.
        progress: whether LeRobot's bars and reports are shown, not only ours.
    """

    def main() -> int:
        if installed_version("lerobot") is None:
            raise BimanualError("LeRobot is not installed: pip install 'lerobot_bimanual[lerobot]'")
        words = sys.argv[1:]
        values = flag_values(words)
        sys.argv[1:] = strip_plugin_flags(words)
        if "help" in values:
            ours = f"--{TRUST_FLAG}=true; in trainings --{KEEP_FLAG}=N"
            print(f"flags of ours: {ours}. All others are LeRobot's:\n")
            filtered: Any = Filtered(sys.stderr, progress)
            with redirect_stderr(filtered):
                work(values)
            return 0
        if path := values.get("policy.path"):
            require_checkpoint_if_local(path)
            if not Path(path).is_dir() and not is_trusted(words):
                raise BimanualError(
                    f"{path} is not a folder, and a checkpoint on the Hub cannot be checked: run `hf download {path} "
                    f"--local-dir=FOLDER` and give that folder, or give --{TRUST_FLAG}=true if you trust its source"
                )
        check(values)
        print(f"{program}: importing LeRobot", file=sys.stderr)
        shown: list[Any] = [Filtered(stream, progress) for stream in (sys.stdout, sys.stderr)]
        if not progress:
            _configure_package_logging(Filtered(sys.stderr, progress=True))
        try:
            with redirect_stdout(shown[0]), redirect_stderr(shown[1]):
                work(values)
        except BimanualError:
            raise
        except Exception as error:
            if os.environ.get(TRACEBACK_VARIABLE) == "1":
                raise
            said = " ".join((str(error) + _refusal_of_cache(error)).split())
            raise BimanualError(
                f"{type(error).__name__}: {said} ({TRACEBACK_VARIABLE}=1 shows where)"
            ) from error
        return 0

    return run_reporting_errors(program, main)


def _refusal_of_cache(error: Exception) -> str:
    """Why the cache of datasets could not be written, if that is behind an error of LeRobot, and the remedy; else ""."""
    cause: BaseException = error
    while cause.__cause__ is not None:
        cause = cause.__cause__
    is_refusal = isinstance(cause, OSError) and cause.errno in DISK_REFUSALS
    if not is_refusal or not (type(error).__module__.startswith("datasets.") or "huggingface" in str(cause)):
        return ""
    reason = "" if cause is error else f": {cause}"
    return f"{reason}; LeRobot copies datasets to HF_DATASETS_CACHE, by default in ~/.cache/huggingface: empty or move it"


def _configure_package_logging(stream: Any) -> None:
    """Write what our packages report as plain lines."""
    handler = logging.StreamHandler(stream)
    for name in ("lerobot_bimanual", "lerobot_env_bimanual", "lerobot_policy_bimanual"):
        logger = logging.getLogger(name)
        logger.handlers, logger.propagate = [handler], False
        logger.setLevel(logging.INFO)
