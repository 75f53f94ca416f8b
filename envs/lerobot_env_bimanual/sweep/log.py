"""Outcomes on disk while a sweep runs, so that an interrupted one continues where it stopped."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict
from importlib.util import find_spec
from pathlib import Path

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.files import UnwritableOutput, write_file
from lerobot_bimanual.results.expert_report import EpisodeOutcome
from lerobot_bimanual.results.record import Record
from lerobot_env_bimanual.experts.world_version import simulation_versions
from lerobot_env_bimanual.perturbations.registry import AXES
from lerobot_env_bimanual.sweep.spec import EpisodeSpec
from lerobot_env_bimanual.tasks.registry import TASKS


class _Line(Record):
    """One line of a log.

    Attributes:
        spec: SHA-256 of the episode's spec.
        outcome: its outcome.
    """

    spec: str
    outcome: EpisodeOutcome


class EpisodeLog:
    """A file with one line per finished episode, written as they finish.

    Lines of other code or other versions are discarded, and so is a last line that was cut off, whose episode is played
    again.

    Args:
        path: the file; its folder is made.

    Raises:
        BimanualError: the file is damaged before its end, and is left unchanged.
        UnwritableOutput: it cannot be written.
    """

    def __init__(self, path: Path):
        self._path = path
        header = json.dumps(simulation_versions() | {"sources": _source_digest()}, sort_keys=True)
        self._lines = _read(path, header)
        write_file(
            path, "\n".join([header, *(line.model_dump_json() for line in self._lines.values())]) + "\n"
        )

    def get(self, spec: EpisodeSpec) -> EpisodeOutcome | None:
        """The outcome of an episode, if it is known."""
        line = self._lines.get(_key(spec))
        return line and line.outcome

    def add(self, spec: EpisodeSpec, outcome: EpisodeOutcome) -> None:
        """Keep an outcome.

        Raises:
            UnwritableOutput: it cannot be written.
        """
        line = _Line(spec=_key(spec), outcome=outcome)
        self._lines[line.spec] = line
        try:
            with self._path.open("a", encoding="utf-8") as file:
                print(line.model_dump_json(), file=file)
        except OSError as error:
            raise UnwritableOutput(self._path, error.strerror or str(error)) from error

    def remove(self) -> None:
        """Delete the file: the result is safe elsewhere."""
        self._path.unlink(missing_ok=True)


def _source_digest() -> str:
    """SHA-256 of all code and data that decides the outcome of an episode, which may change while a sweep is interrupted.

    That is this project's packages, and the package or file of every other task and axis.
    """
    modules = (*TASKS.modules.values(), *AXES.modules.values())
    digest = hashlib.sha256()
    for name in sorted({"lerobot_bimanual", *(module.partition(".")[0] for module in modules)}):
        spec = find_spec(name)
        if spec is None or spec.origin is None:
            continue  # playing the task reports that it cannot be imported
        origin = Path(spec.origin)
        root = origin.parent
        files = (path for path in root.rglob("*") if path.suffix in (".py", ".toml"))
        for path in sorted(files) if spec.submodule_search_locations else [origin]:
            digest.update(f"{name}/{path.relative_to(root).as_posix()}".encode() + path.read_bytes())
    return digest.hexdigest()


def _read(path: Path, header: str) -> dict[str, _Line]:
    if not path.exists():
        return {}
    try:
        first, *lines = path.read_bytes().split(b"\n")
    except OSError as error:
        raise BimanualError(f"{path}: {error}") from error
    if first != header.encode():
        return {}
    found = {}
    for number, text in enumerate(lines[:-1], start=2):  # text after the last newline was cut off
        try:
            line = _Line.from_json(text)
        except BimanualError as error:
            raise BimanualError(
                f"{path}, line {number}: {error}; the file holds the episodes of an interrupted run: repair it, or remove "
                "it to play them again"
            ) from error
        found[line.spec] = line
    return found


def _key(spec: EpisodeSpec) -> str:
    return hashlib.sha256(json.dumps(asdict(spec), sort_keys=True).encode()).hexdigest()
