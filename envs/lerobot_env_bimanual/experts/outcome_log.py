"""Outcomes on disk while a campaign runs, so that an interrupted one goes on where it stopped."""

from __future__ import annotations

import hashlib
import json
import platform
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from pathlib import Path

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.json_file import parse_json
from lerobot_bimanual.json_record import decode
from lerobot_bimanual.output_file import UnwritableOutput, write_file
from lerobot_bimanual.versions import SIMULATION_PACKAGES, installed_versions
from lerobot_env_bimanual.experts.outcome import Job, Outcome
from lerobot_env_bimanual.perturbations.registry import AXES
from lerobot_env_bimanual.tasks.registry import TASKS


def versions() -> dict[str, str]:
    """Versions of everything that decides the outcome of an episode."""
    return installed_versions(SIMULATION_PACKAGES) | {"python": platform.python_version()}


class OutcomeLog:
    """A file with one line per finished job, written as they finish.

    Lines of other code or other versions are discarded, and so is a last line that was cut off, whose episode is played
    again.

    Args:
        path: the file; its folder is made.

    Raises:
        BimanualError: the file is damaged before its end, and stays as it is.
        UnwritableOutput: it cannot be written.
    """

    def __init__(self, path: Path):
        self._path = path
        header = json.dumps(versions() | {"sources": _source_digest()}, sort_keys=True)
        self._outcomes = _read(path, header)
        lines = [header, *(_line(key, outcome) for key, outcome in self._outcomes.items())]
        write_file(path, "\n".join(lines) + "\n")

    def get(self, job: Job) -> Outcome | None:
        """The outcome of a job, if it is known."""
        return self._outcomes.get(_key(job))

    def add(self, job: Job, outcome: Outcome) -> None:
        """Note an outcome.

        Raises:
            UnwritableOutput: it cannot be written.
        """
        key = _key(job)
        self._outcomes[key] = outcome
        try:
            with self._path.open("a", encoding="utf-8") as file:
                print(_line(key, outcome), file=file)
        except OSError as error:
            raise UnwritableOutput(self._path, error.strerror or str(error)) from error

    def remove(self) -> None:
        """Delete the file: the result is safe elsewhere."""
        self._path.unlink(missing_ok=True)


def _source_digest() -> str:
    """Of every file of the code that plays, which may change while a campaign is interrupted.

    That is our packages and whatever else brings tasks or axes: the whole package, or the one file.
    """
    modules = (*TASKS.modules.values(), *AXES.modules.values())
    digest = hashlib.sha256()
    for name in sorted({"lerobot_bimanual", *(module.partition(".")[0] for module in modules)}):
        spec = find_spec(name)
        if spec is None or spec.origin is None:
            continue  # whoever plays the task says that it cannot be imported
        origin = Path(spec.origin)
        root = origin.parent
        for path in sorted(root.rglob("*.py")) if spec.submodule_search_locations else [origin]:
            digest.update(f"{name}/{path.relative_to(root).as_posix()}".encode() + path.read_bytes())
    return digest.hexdigest()


@dataclass(frozen=True)
class _Entry:
    """A line: a job's key, and its outcome."""

    job: str
    outcome: Outcome


def _read(path: Path, header: str) -> dict[str, Outcome]:
    if not path.exists():
        return {}
    try:
        first, *lines = path.read_bytes().split(b"\n")
    except OSError as error:
        raise BimanualError(f"{path}: {error}") from error
    if first != header.encode():
        return {}
    entries = []
    for number, line in enumerate(lines[:-1], start=2):  # what stands behind the last newline was cut off
        try:
            entries.append(decode(_Entry, parse_json(line), f"line {number}"))
        except BimanualError as error:
            raise BimanualError(
                f"{path}, line {number}: {error}; the episodes of an interrupted run are in this file, so mend it, or "
                "remove it to play them again"
            ) from error
    return {entry.job: entry.outcome for entry in entries}


def _line(key: str, outcome: Outcome) -> str:
    return json.dumps({"job": key, "outcome": asdict(outcome)})


def _key(job: Job) -> str:
    return hashlib.sha256(json.dumps(asdict(job), sort_keys=True).encode()).hexdigest()
