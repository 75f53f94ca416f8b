"""Result files whose episodes can be replayed: benchmark results and evaluation records."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.results.benchmark import read_scored
from lerobot_bimanual.results.episode import Episode
from lerobot_bimanual.results.evaluation import EvaluationRecord
from lerobot_env_bimanual.experts.world_version import world_version
from lerobot_env_bimanual.tasks.registry import get_task


@dataclass(frozen=True)
class ResultFile:
    """One result file.

    Attributes:
        path: the file.
        record: the episodes that were played.
        policy_id: the policy and what it learned from; the file's name where that is unknown.
        expert_ticks: control ticks that the expert took, by seed, as far as they are known.
    """

    path: Path
    record: EvaluationRecord
    policy_id: str
    expert_ticks: Mapping[int, int]

    @classmethod
    def read(cls, path: Path) -> Self:
        """The result in a file.

        Raises:
            BimanualError: the file is not a result, or its task is not installed.
        """
        scored = read_scored(path)
        is_record = isinstance(scored, EvaluationRecord)
        record, is_unnamed = scored if is_record else scored.evaluation, is_record and not scored.policy
        get_task(record.task)
        expert = () if is_record else scored.expert
        ticks = {episode.seed: episode.ticks for episode in expert if episode.ticks is not None}
        return cls(path, record, path.stem if is_unnamed else scored.policy_id, ticks)

    @property
    def name(self) -> str:
        """What was evaluated and the policy; several trainings of one policy share a name."""
        return f"{self.record.eval_key} {self.policy_id}"

    @property
    def world_problem(self) -> str:
        """How the result's world differs from the installed one; "" if it does not."""
        record = self.record
        if record.world == (installed := world_version(record.task, record.perturb, record.setting)):
            return ""
        difference = f"world of {record.task} is {record.world}, but {installed} here, where the same seeds mean other episodes"
        return f"{difference}: replay it with the code of that day and the versions {record.versions}"

    def check_world(self) -> None:
        """Make sure that episodes replay here as they were recorded.

        Raises:
            BimanualError: the result is of another world.
        """
        if problem := self.world_problem:
            raise BimanualError(f"{self.path}: {problem}")


def sample_episodes(episodes: Sequence[Episode], count: int, seed: int) -> list[Episode]:
    """A random subset of episodes in their order; all of them if `count` is 0 or at least their number."""
    if not 0 < count < len(episodes):
        return list(episodes)
    indices = np.random.default_rng(seed).choice(len(episodes), count, replace=False)
    return [episodes[index] for index in sorted(indices)]
