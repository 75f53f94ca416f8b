"""Files of results, and the episodes in them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.files import read_json
from lerobot_bimanual.results.benchmark import BenchmarkResult
from lerobot_bimanual.results.episode import Episode
from lerobot_bimanual.results.evaluation import EvaluationRecord
from lerobot_env_bimanual.experts.world_version import world_version
from lerobot_env_bimanual.tasks.registry import get_task


@dataclass(frozen=True)
class Result:
    """One file of results.

    Attributes:
        path: the file.
        record: the episodes that were played.
        row: what `benchmark` says beside them; None for a record that `lerobot-eval` has left.
    """

    path: Path
    record: EvaluationRecord
    row: BenchmarkResult | None

    @classmethod
    def read(cls, path: Path) -> Result:
        """The result in a file.

        Raises:
            BimanualError: the file is no result, or of a task that is not installed.
        """
        content = read_json(path)
        is_row = isinstance(content, dict) and "config" in content
        row = BenchmarkResult.read(path) if is_row else None
        record = EvaluationRecord.read(path) if row is None else row.evaluation
        get_task(record.task)
        return cls(path, record, row)

    @property
    def problem_of_world(self) -> str | None:
        """In which other world it was played; None if it is this one."""
        record = self.record
        if record.world == (here := world_version(record.task, record.perturb)):
            return None
        return f"world of {record.task} is {record.world}, but {here} here: play it with the versions {record.versions}"

    def check_world(self) -> None:
        """Make sure that episodes come out here as they did there.

        Raises:
            BimanualError: it was played in another world.
        """
        if self.problem_of_world is not None:
            raise BimanualError(f"{self.path}: {self.problem_of_world}")


def result_files(results: Path) -> list[Path]:
    """The file, or the JSON files of a folder, sorted.

    Raises:
        BimanualError: a folder without results.
    """
    if not results.is_dir():
        return [results]
    found = sorted(results.glob("*.json"))
    if not found:
        raise BimanualError(f"{results} holds no results; `lerobot-bimanual policy benchmark` writes them")
    return found


def drawn(episodes: tuple[Episode, ...], count: int, rng: np.random.Generator) -> list[Episode]:
    """So many episodes at random, in their order; all if `count` is 0 or beyond their number."""
    if not 0 < count < len(episodes):
        return list(episodes)
    return [episodes[index] for index in sorted(rng.choice(len(episodes), count, replace=False))]
