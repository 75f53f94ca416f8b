"""Paired comparison of two policies on the same episodes, and what results must share to be compared."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import sqrt
from pathlib import Path

import numpy as np
import pandas as pd

from lerobot_bimanual.distributions import SIMULATION_PACKAGES
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.results.benchmark import INCIDENTAL, BenchmarkResult, Scored
from lerobot_bimanual.results.episode import Episode
from lerobot_bimanual.results.evaluation import EvaluationRecord
from lerobot_bimanual.results.protocols import OWN, RULES
from lerobot_bimanual.results.statistics import SuccessRate, paired_p_value

type Results = Mapping[Path, Scored]

OWN_DEMONSTRATIONS = ("repo_id", "first_seed")
"""Settings of demonstrations in which trainings of one policy may differ."""


@dataclass(frozen=True)
class Comparison:
    """Two policies on one task, each trained once or several times.

    Raises:
        BimanualError: the results differ in task, variation, world or simulation, or share no seed.
    """

    first: tuple[Scored, ...]
    second: tuple[Scored, ...]

    def __post_init__(self) -> None:
        results = (*self.first, *self.second)
        _check_equal(((f"{each.eval_key}_{each.policy_id}", each) for each in results), _facts_of_episodes)
        if self.solved[0].empty:
            raise BimanualError("the results share no seed; evaluate both on the same --first_seed")

    @cached_property
    def solved(self) -> tuple[pd.DataFrame, pd.DataFrame]:
        """Success of the first and of the second: a line per seed that all were tested on, a column per training."""
        table = pd.concat(
            [
                pd.Series({episode.seed: int(episode.success) for episode in result.episodes})
                for result in (*self.first, *self.second)
            ],
            axis=1,
            join="inner",
        ).sort_index()
        return table.iloc[:, : len(self.first)], table.iloc[:, len(self.first) :]

    @property
    def rates(self) -> tuple[list[SuccessRate], list[SuccessRate]]:
        """Success of every training on those seeds."""
        first, second = (
            [SuccessRate(int(successes), len(table)) for successes in table.sum()] for table in self.solved
        )
        return first, second

    @property
    def better(self) -> tuple[int, int]:
        """Number of episodes that the first solves more often than the second, in shares of its trainings, and the reverse."""
        return int((self._differences > 0).sum()), int((self._differences < 0).sum())

    @property
    def p_value(self) -> float:
        """Two-sided p-value of the episodes' successes; see `paired_p_value`."""
        first, second = (table.sum(axis=1).tolist() for table in self.solved)
        return paired_p_value(first, second, (len(self.first), len(self.second)))

    @property
    def difference(self) -> float:
        """Mean success of the first less that of the second."""
        return float(self._differences.mean())

    @property
    def episode_error(self) -> float:
        """Standard error of the difference from the draw of the episodes, for these trainings.

        With one more episode won and one more lost, it is not 0 where both solve all (Bonett and Price 2012).
        """
        differences = [*self._differences, 1, -1]
        return float(np.std(differences) / sqrt(len(differences)))

    @property
    def training_error(self) -> float | None:
        """Standard error of the difference from the draw of the trainings; None if either has only one."""
        if min(len(self.first), len(self.second)) < 2:
            return None
        first, second = (pd.Series(table.mean()).sem() for table in self.solved)
        return float(np.hypot(first, second))

    @cached_property
    def _differences(self) -> pd.Series:
        """By episode, mean success of the first less that of the second."""
        first, second = self.solved
        return first.mean(axis=1) - second.mean(axis=1)


def check_comparable(results: Results) -> None:
    """Refuse results that do not belong into one table, as `check_trainings` does; the error names both files.

    Results of a table share recipe and simulation; those of a line also world, expert and baseline.
    """
    _check_equal(results.items(), _facts_of_table)
    check_trainings(results)


def check_trainings(results: Results) -> None:
    """Refuse trainings of one policy by several recipes.

    Those for one line may differ in seeds alone, and must differ in their weights.
    """
    _check_equal(results.items(), _facts_of_training)
    first: dict[tuple[str, str, str], Path] = {}
    for path, result in results.items():
        is_record = isinstance(result, EvaluationRecord)
        weights = result.policy.get("sha256", "") if is_record else result.checkpoint_sha256
        what = "weights" if weights else "episodes"
        identity = weights or " ".join(each.proof.end for each in result.episodes if each.proof)
        key = (result.eval_key, result.policy_id, str(identity))
        if (other := first.setdefault(key, path)) != path:
            raise BimanualError(
                f"{path} has the {what} of {other}, so it is not another training; remove one of the files"
            )


def _check_equal(
    results: Iterable[tuple[object, Scored]],
    facts: Callable[[Scored], Mapping[str, object]],
) -> None:
    """Refuse results, each with its name or file, if facts of the same name have different values."""
    first: dict[str, tuple[object, object]] = {}
    for place, result in results:
        for name, value in facts(result).items():
            elsewhere, other = first.setdefault(name, (place, value))
            if value != other:
                raise BimanualError(
                    f"{place}: {name} is {value!r:.200}, but {other!r:.200} in {elsewhere}; results are not comparable; "
                    "remove one of the files"
                )


def _facts_of_episodes(result: Scored) -> dict[str, object]:
    versions = {package: result.versions.get(package) for package in SIMULATION_PACKAGES}
    facts: dict[str, object] = {
        "what is played": result.eval_key,
        "world": result.world,
        "versions": versions,
    }
    return facts | {f"option {name}": result.options.get(name) for name in ("split", *RULES)}


def table_key(result: Scored) -> tuple[str, str]:
    """The line of the tables of results: the protocol, which chooses the table, and what is played."""
    return OWN if isinstance(result, EvaluationRecord) else result.config.protocol, result.eval_key


def _facts_of_table(result: Scored) -> dict[str, object]:
    protocol, key = table_key(result)
    shared, place = _facts_of_episodes(result), f"on {key}, protocol {protocol}"
    shared[f"world of {result.task}, {key}"] = shared.pop("world")
    del shared["what is played"]
    if isinstance(result, BenchmarkResult):
        shared |= {
            "recipe": result.config.recipe,
            f"expert {place}": _outcomes(result.expert),
            f"open-loop baseline {place}": _outcomes(result.open_loop),
        }
    return shared | {f"seeds {place}": [episode.seed for episode in result.episodes]}


def _facts_of_training(result: Scored) -> dict[str, object]:
    of = f"of {result.policy_id} on {result.eval_key}"
    if isinstance(result, EvaluationRecord):
        return {f"kind of file {of}": "a record of an evaluation", f"options {of}": result.options}
    config, settings = result.config, result.demonstrations.settings
    training = {name: value for name, value in config.training.items() if name not in INCIDENTAL}
    measured = config.model_dump(exclude={"seed", "first_demo_seed", "training"}) | training
    demonstrated = {name: value for name, value in settings.items() if name not in OWN_DEMONSTRATIONS}
    named = {"setting": measured, "demonstrations' setting": demonstrated, "test's option": result.options}
    facts: dict[str, object] = {
        f"kind of file {of}": "a result of a benchmark",
        f"recipe of {config.policy_id}": config.recipe,
    }
    for kind, options in named.items():
        facts[f"{kind}s {of}"] = sorted(options)
        facts |= {f"{kind} {name} {of}": value for name, value in options.items()}
    return facts


def _outcomes(episodes: Sequence[Episode]) -> list[tuple[int, int | None, bool]]:
    """What does not depend on the processor."""
    return [(episode.seed, episode.variation, episode.success) for episode in episodes]
