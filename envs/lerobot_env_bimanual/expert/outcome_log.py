"""Outcomes on disk while a campaign runs, so that an interrupted one goes on where it stopped."""

from __future__ import annotations

import hashlib
import json
import platform
from dataclasses import asdict
from pathlib import Path

import lerobot_bimanual
import lerobot_env_bimanual
from lerobot_bimanual.dataset.provenance import SIMULATION_PACKAGES, installed_versions
from lerobot_env_bimanual.expert.outcome import Job, Outcome


def versions() -> dict[str, str]:
    """Versions of everything that decides the outcome of an episode."""
    return installed_versions(SIMULATION_PACKAGES) | {"python": platform.python_version()}


class OutcomeLog:
    """A file with one line per finished job, written as they finish.

    Lines of other code or other versions are discarded, and so is a last line that was cut off.

    Args:
        path: the file; its folder is made.
    """

    def __init__(self, path: Path):
        path.parent.mkdir(parents=True, exist_ok=True)
        self._path = path
        header = json.dumps(versions() | {"sources": _source_digest()}, sort_keys=True)
        self._outcomes = _read(path, header)
        with path.open("w") as file:
            print(header, file=file)
            for key, outcome in self._outcomes.items():
                print(_line(key, outcome), file=file)

    def get(self, job: Job) -> Outcome | None:
        """The outcome of a job, if it is known."""
        return self._outcomes.get(_key(job))

    def add(self, job: Job, outcome: Outcome) -> None:
        """Note an outcome."""
        key = _key(job)
        self._outcomes[key] = outcome
        with self._path.open("a") as file:
            print(_line(key, outcome), file=file)

    def remove(self) -> None:
        """Delete the file: the result is safe elsewhere."""
        self._path.unlink(missing_ok=True)


def _source_digest() -> str:
    """Of every file of the code that plays, which may change while a campaign is interrupted."""
    digest = hashlib.sha256()
    for package in (lerobot_bimanual, lerobot_env_bimanual):
        root = Path(str(package.__file__)).parent
        for path in sorted(root.rglob("*.py")):
            digest.update(path.relative_to(root).as_posix().encode() + path.read_bytes())
    return digest.hexdigest()


def _read(path: Path, header: str) -> dict[str, Outcome]:
    outcomes: dict[str, Outcome] = {}
    if not path.is_file():
        return outcomes
    first, *lines = path.read_text().splitlines() or [""]
    if first != header:
        return outcomes
    for line in lines:
        try:
            entry = json.loads(line)
        except json.JSONDecodeError:
            break
        outcomes[entry["job"]] = Outcome.from_dict(entry["outcome"])
    return outcomes


def _line(key: str, outcome: Outcome) -> str:
    return json.dumps({"job": key, "outcome": asdict(outcome)})


def _key(job: Job) -> str:
    return hashlib.sha256(json.dumps(asdict(job), sort_keys=True).encode()).hexdigest()
