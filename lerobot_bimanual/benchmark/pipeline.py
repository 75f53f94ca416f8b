"""A resumable chain of stock commands.

Each command is shown as a user would type it. A marker file per command holds its words and whether it finished, so
that running the chain again does only what is missing.
"""

import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import BinaryIO

from rich.console import Console

from lerobot_bimanual.checkpoint_folder import TRAIN_CONFIG_FILE
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.files import check_output_folder, locked, sha256
from lerobot_bimanual.interrupts import end_when_parent_ends, interrupts_ignored
from lerobot_bimanual.resources import usable_cores
from lerobot_bimanual.results.benchmark import INCIDENTAL
from lerobot_bimanual.results.record import Record

IRRELEVANT_FLAGS = r" --(workers|{})=\S+".format("|".join(map(re.escape, INCIDENTAL)))
"""Flags that change no output, so that a command with others is the same."""
TERMINATION_TIMEOUT_S = 5.0
"""Time that an interrupted program has to end its workers."""


@dataclass(frozen=True)
class Command:
    """One command of a chain.

    Attributes:
        name: shown to the user; also names the marker.
        words: program and flags, as a user would type them.
        output: what exists once the command has succeeded.
        inputs: files made by earlier commands; this one counts as done only for their present content.
        training_folder: where a command with the flags of `lerobot-train` keeps its checkpoints, from which it is
            resumed.
        allows_exit_code_1: whether the command exits with 1 after it has measured something insufficient, as `expert evaluate`
            does. Its output is then a result like any other.
    """

    name: str
    words: list[str]
    output: Path
    inputs: tuple[Path, ...] = ()
    training_folder: Path | None = None
    allows_exit_code_1: bool = False

    def __str__(self) -> str:
        return shlex.join(self.words)


class Marker(Record):
    """Progress of a command: its words as a shell has them, SHA-256 of its inputs, and wall time of its runs that were not killed."""

    command: str
    inputs: dict[str, str]
    done: bool
    seconds: float


def start(words: Sequence[str], log: BinaryIO | None = None) -> subprocess.Popen[bytes]:
    """Start a program of this Python environment, which ends when this process does; its output goes into a log, if there is one."""
    defaults = {
        # No command needs the network: a dataset or policy that is missing here must fail, not be downloaded.
        "HF_HUB_OFFLINE": "1",
        # One core is left for environments and the system: on a full machine, threads wait long for others.
        "OMP_NUM_THREADS": str(max(1, usable_cores() - 1)),
    }
    places = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", os.defpath)])
    with interrupts_ignored():  # by the program, so that it is ended below and does not die with a traceback
        return subprocess.Popen(
            words,
            env=defaults | os.environ | {"PATH": places},  # a user's own installation has programs elsewhere
            stdout=log,
            stderr=log,
            preexec_fn=partial(end_when_parent_ends, signal.SIGTERM, os.getpid()),
        )


def end(process: subprocess.Popen[bytes]) -> None:
    """End a program that may still run."""
    process.terminate()
    try:
        process.wait(TERMINATION_TIMEOUT_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def call(words: list[str]) -> int:
    """Exit code of a program of this Python environment."""
    process = start(words)
    try:
        return process.wait()
    finally:
        end(process)


class Pipeline:
    """Runs commands by `call`, shows them and their times, and remembers what is done in a folder, which it makes."""

    def __init__(self, folder: Path, console: Console, call: Callable[[list[str]], int] = call):
        self._folder = folder
        self._console = console
        self._call = call
        check_output_folder(folder)

    def run(self, command: Command) -> bool:
        """Run one command with its output shown, unless the same command has already succeeded here; return whether it ran.

        An interrupted training goes on from its last checkpoint; other commands begin anew.

        Raises:
            BimanualError: the command failed or left no output, an input is missing, its folder holds checkpoints of
                another training, its marker is damaged, or another process runs a command in the folder of the markers.
        """
        if not self._is_done(command):
            with locked(self._folder):
                if not self._is_done(command):  # another process may have just finished it
                    self._run(command)
                    return True
        self._console.rule(f"[bold]{command.name}[/bold] (already done)")
        return False

    def _is_done(self, command: Command) -> bool:
        return self._marker(command).done and command.output.exists()

    def _run(self, command: Command) -> None:
        marker = self._marker(command)
        self._console.rule(f"[bold]{command.name}[/bold]")
        words, seconds = command.words, 0.0
        if command.training_folder is not None and (resume := self._resume(command, command.training_folder)):
            words, seconds = resume, marker.seconds
        show_command(self._console, "$ ", words)
        if command.allows_exit_code_1:
            command.output.unlink(missing_ok=True)  # so that afterwards it is known to be new
        marker = marker.model_copy(update={"done": False, "seconds": seconds})
        marker.write(self._path(command))
        started = time.monotonic()
        try:
            code = self._call(words)
        except KeyboardInterrupt:
            raise KeyboardInterrupt("the same command continues where it stopped") from None
        finally:
            marker = marker.model_copy(update={"seconds": seconds + time.monotonic() - started})
            marker.write(self._path(command))
        if code and not (code == 1 and command.allows_exit_code_1 and command.output.exists()):
            raise BimanualError(
                f"{command.name!r} failed with exit code {code}; its output is above. "
                f"The same command line continues from here. What failed was: {shlex.join(words)}"
            )
        if not command.output.exists():
            raise BimanualError(
                f"{command.name!r} ended without an error, but did not write {command.output}. Leave out what prevents it, "
                f"such as --save_checkpoint=false, and repeat the command line. What ran was: {shlex.join(words)}"
            )
        marker.model_copy(update={"done": True}).write(self._path(command))
        self._console.print(f"[dim]{command.name}: {marker.seconds:.0f} s[/dim]")

    def seconds(self, command: Command) -> float:
        """Wall time of a command that is done, with the runs that were interrupted and resumed."""
        return self._marker(command).seconds

    def _marker(self, command: Command) -> Marker:
        """The marker of this command with these inputs; a new one if it was never begun with them."""
        for path in command.inputs:
            if not path.is_file():
                raise BimanualError(
                    f"{path} is missing, but was made by an earlier command; put it back, or choose another --output to "
                    "make it again"
                )
        inputs = {str(path): sha256(path) for path in command.inputs}
        new = Marker(command=str(command), inputs=inputs, done=False, seconds=0.0)
        found = self._found_marker(command)
        return found if found is not None and _has_same_output(found, new) else new

    def _found_marker(self, command: Command) -> Marker | None:
        return Marker.read(path) if (path := self._path(command)).is_file() else None

    def _path(self, command: Command) -> Path:
        return self._folder / f"{command.name}.command.json"

    def _resume(self, command: Command, folder: Path) -> list[str] | None:
        """The command that resumes a training from its last checkpoint; None if there is no checkpoint."""
        # LeRobot's link `last` is sorted after the numbers of steps. If it leads nowhere, take the newest
        # checkpoint that has the state of the optimizer: the writing of a newer one may have been cut off.
        checkpoints = sorted(folder.glob(f"checkpoints/*/pretrained_model/{TRAIN_CONFIG_FILE}"))
        if not (folder / "checkpoints" / "last").exists():
            state = "training_state/**/optimizer_param_groups.json"
            checkpoints = [path for path in checkpoints if any(path.parents[1].glob(state))]
        found = self._found_marker(command)
        is_same = found is not None and _has_same_output(found, self._marker(command))
        is_kept = command.output.exists() and (
            found is None or found.done
        )  # it was finished, perhaps elsewhere
        if not checkpoints and (is_same or not is_kept):
            # lerobot-train refuses an existing folder, and this one holds nothing to keep.
            shutil.rmtree(folder, ignore_errors=True)
            return None
        if not is_same:
            raise BimanualError(
                f"{folder} holds checkpoints of a training with other flags or demonstrations, or was made at another place. "
                f"Choose another --output, or remove the folder to train anew with: {command}"
            )
        # The training's own checkpoint is trusted: the check passes only policies that load nothing by name.
        words = [command.words[0], f"--config_path={checkpoints[-1]}"]
        kept = [word for word in command.words if word.startswith("--keep_last=")]
        return [*words, "--trust_checkpoint=true", "--resume=true", *kept]


def _has_same_output(first: Marker, second: Marker) -> bool:
    """Whether two commands have the same output."""
    commands = (re.sub(IRRELEVANT_FLAGS, "", marker.command) for marker in (first, second))
    return len({*commands}) == 1 and first.inputs == second.inputs


def show_command(console: Console, prompt: str, words: Iterable[str]) -> None:
    """Print a command in one piece, ready to be copied."""
    console.print(f"{prompt}{shlex.join(words)}", style="cyan", soft_wrap=True, highlight=False, markup=False)
