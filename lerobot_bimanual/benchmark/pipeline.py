"""A chain of stock commands that goes on where it was interrupted.

Each command is shown as a user would type it. A marker file per stage holds the command that was begun there and
whether it finished, so that running the chain again does only what is missing.
"""

import hashlib
import json
import os
import shlex
import shutil
import subprocess
import sys
import time
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from rich.console import Console

from lerobot_bimanual.errors import BimanualError


@dataclass(frozen=True)
class Stage:
    """One command of a chain.

    Attributes:
        name: Shown to the user; also names the marker.
        command: Program and flags, as a user would type them.
        output: What exists once the command has succeeded; None for a command that leaves nothing behind.
        inputs: Files made by earlier stages; the stage counts as done only for their present content.
        training_folder: Where a command with the flags of `lerobot-train` keeps its checkpoints, from which it is
            resumed.
        judges: Whether the command exits with 1 when it has measured something that it finds not good enough, as
            `certify` does. Its output is then a result like any other.
    """

    name: str
    command: list[str]
    output: Path | None = None
    inputs: tuple[Path, ...] = ()
    training_folder: Path | None = None
    judges: bool = False

    def __str__(self) -> str:
        return shlex.join(self.command)


@dataclass(frozen=True)
class _Marker:
    command: str
    inputs: dict[str, str]
    done: bool
    seconds: float


class Pipeline:
    """Runs stages and remembers in a folder what is done.

    Args:
        folder: Where the markers lie; made if absent.
        console: Where commands and times are shown.
    """

    def __init__(self, folder: Path, console: Console):
        self._folder = folder
        self._console = console
        folder.mkdir(parents=True, exist_ok=True)

    def run(self, stage: Stage) -> None:
        """Run one command with its output shown, unless the same command has already succeeded here.

        An interrupted training goes on from its last checkpoint; other commands begin anew.

        Raises:
            BimanualError: The command failed, or a training with other flags is in its place.
        """
        marker = self._marker(stage)
        if marker.done and (stage.output is None or stage.output.exists()):
            self._console.rule(f"[bold]{stage.name}[/bold] (already done)")
            return
        self._console.rule(f"[bold]{stage.name}[/bold]")
        words, seconds = stage.command, 0.0
        if stage.training_folder is not None and (resume := self._resume(stage, stage.training_folder)):
            words, seconds = resume, marker.seconds
        show_command(self._console, "$ ", words)
        if stage.judges and stage.output is not None:
            stage.output.unlink(missing_ok=True)  # so that afterwards it is known to be new
        marker = replace(marker, done=False, seconds=seconds)
        self._write(stage, marker)
        started = time.monotonic()
        try:
            code = _call(words)
        finally:
            marker = replace(marker, seconds=seconds + time.monotonic() - started)
            self._write(stage, marker)
        measured = stage.judges and stage.output is not None and stage.output.exists()
        if code and not measured:
            raise BimanualError(
                f"stage {stage.name!r} failed with exit code {code}; its output is above. "
                f"The same command continues from here. The failed stage was: {shlex.join(words)}"
            )
        self._write(stage, replace(marker, done=True))
        self._console.print(f"[dim]{stage.name}: {marker.seconds:.0f} s[/dim]")

    def seconds(self, stage: Stage) -> float:
        """Wall time of a stage that is done, with the runs that were interrupted and resumed."""
        return self._marker(stage).seconds

    def _path(self, stage: Stage) -> Path:
        return self._folder / f"{stage.name}.stage.json"

    def _marker(self, stage: Stage) -> _Marker:
        """The marker of this very command and these inputs; a fresh one if they were never begun."""
        inputs = {str(path): sha256(path) for path in stage.inputs}
        path = self._path(stage)
        if path.is_file():
            marker = _Marker(**json.loads(path.read_text()))
            if (marker.command, marker.inputs) == (str(stage), inputs):
                return marker
        return _Marker(str(stage), inputs, done=False, seconds=0.0)

    def _write(self, stage: Stage, marker: _Marker) -> None:
        # In one move: an interruption while writing must not leave half a marker.
        path = self._path(stage)
        temporary = path.with_suffix(".partial")
        temporary.write_text(json.dumps(asdict(marker), indent=1) + "\n")
        temporary.replace(path)

    def _resume(self, stage: Stage, folder: Path) -> list[str] | None:
        """The command that goes on from the last checkpoint; None if there is none to go on from."""
        last = folder / "checkpoints" / "last" / "pretrained_model" / "train_config.json"
        if not last.is_file():
            # lerobot-train refuses an existing folder, and in this one is nothing to keep.
            shutil.rmtree(folder, ignore_errors=True)
            return None
        path = self._path(stage)
        if not path.is_file() or _Marker(**json.loads(path.read_text())).command != str(stage):
            raise BimanualError(
                f"{folder} holds checkpoints of a training with other flags. Choose another --output, or "
                f"remove the folder to train anew with: {stage}"
            )
        return [stage.command[0], f"--config_path={last}", "--resume=true"]


def flag_words(flags: Mapping[str, object]) -> list[str]:
    """`--name=value` for each flag."""
    return [f"--{name}={value}" for name, value in flags.items()]


def show_command(console: Console, prompt: str, words: Iterable[str]) -> None:
    """Print a command in one piece, ready to be copied."""
    console.print(f"{prompt}{shlex.join(words)}", style="cyan", soft_wrap=True, highlight=False, markup=False)


def sha256(path: Path) -> str:
    """SHA-256 of a file's content, in hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _call(words: list[str]) -> int:
    """Exit code of a command of this Python environment."""
    program, *flags = words
    defaults = {
        # No stage needs the network: a dataset or policy that is not found here must fail, not be asked for.
        "HF_HUB_OFFLINE": "1",
        # One core is left to the data loader; threads that wait for each other on a full machine crawl.
        "OMP_NUM_THREADS": str(max(1, (os.cpu_count() or 1) - 1)),
    }
    executable = Path(sys.executable).parent / program
    return subprocess.run([executable, *flags], env=defaults | os.environ, check=False).returncode
