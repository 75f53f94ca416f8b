"""How far trainings of one policy are apart on conditions: how far two policies must be apart for it to mean something."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, combinations, product

from lerobot_bimanual.results.robustness import PolicyCondition, RobustnessResult, short_name

SEED = re.compile(r"_seed\d+$")
"""Results whose names differ in nothing else, beside the task, are trainings of one policy."""


def policy_name(name: str, result: RobustnessResult) -> str:
    """The name of a result without its task and without the seed of the training."""
    return SEED.sub("", short_name(name, result))


def by_policy(results: Mapping[str, RobustnessResult]) -> dict[tuple[str, str], list[RobustnessResult]]:
    """All trainings of each policy on each task, by task and name of the policy.

    Args:
        results: by name.
    """
    found: dict[tuple[str, str], list[RobustnessResult]] = {}
    for name, result in results.items():
        found.setdefault((result.task, policy_name(name, result)), []).append(result)
    return found


@dataclass(frozen=True)
class Distance:
    """How far pairs of results are apart on conditions, as shares of the episodes of a condition.

    Attributes:
        pairs: conditions that were compared; of no pair nothing is known.
        mean: over them, of the absolute difference of what is solved.
        largest: likewise.
    """

    pairs: int
    mean: float
    largest: float


class Trainings:
    """Policies of which several trainings were played on the same episodes of a task.

    Args:
        results: by name.
    """

    def __init__(self, results: Mapping[str, RobustnessResult]):
        once = {key: _of_each_weights(found) for key, found in by_policy(results).items()}
        self._several = {key: trained for key, trained in once.items() if len(trained) > 1}

    @property
    def policies(self) -> list[str]:
        """Names of those that have several trainings on any task."""
        return sorted({policy for _, policy in self._several})

    def apart(self, first: str, second: str, conditions: Sequence[str]) -> Distance:
        """Trainings of two policies on the same task, over all tasks, on the valid ones of some conditions.

        Args:
            first: one of `policies`.
            second: another, or the same: then any two of its trainings.
            conditions: names of conditions.
        """
        tasks = {task for task, _ in self._several}
        pairs = chain.from_iterable(self._pairs(task, first, second) for task in sorted(tasks))
        return _distance(pairs, conditions)

    def _pairs(
        self, task: str, first: str, second: str
    ) -> Iterable[tuple[RobustnessResult, RobustnessResult]]:
        some, others = (self._several.get((task, policy), []) for policy in (first, second))
        return combinations(some, 2) if first == second else product(some, others)


def _of_each_weights(results: Iterable[RobustnessResult]) -> list[RobustnessResult]:
    """One result of equal weights, which are no second training."""
    return [*{result.config.checkpoint_sha256: result for result in results}.values()]


def _distance(pairs: Iterable[tuple[RobustnessResult, RobustnessResult]], names: Sequence[str]) -> Distance:
    apart = [
        abs(first.by_name[name].rates["policy"].rate - second.by_name[name].rates["policy"].rate)
        for first, second in pairs
        for name in names
        if _are_alike(first.by_name.get(name), second.by_name.get(name))
    ]
    return Distance(len(apart), sum(apart) / max(1, len(apart)), max(apart, default=0.0))


def _are_alike(first: PolicyCondition | None, second: PolicyCondition | None) -> bool:
    """Valid, in one world, and of the same episodes."""
    if first is None or second is None:
        return False
    both_valid = first.is_valid and second.is_valid
    return both_valid and first.world == second.world and first.seeds == second.seeds
