"""How far trainings of one policy are apart on conditions: how far two policies must be apart for it to mean something."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, combinations, product

from lerobot_bimanual.ladder.result import LadderResult, Rung, short_name

SEED = re.compile(r"_seed\d+$")
"""Ladders whose names differ in nothing else, beside the task, are trainings of one policy."""


def policy_name(name: str, ladder: LadderResult) -> str:
    """The name of a ladder without its task and without the seed of the training."""
    return SEED.sub("", short_name(name, ladder))


def by_policy(ladders: Mapping[str, LadderResult]) -> dict[tuple[str, str], list[LadderResult]]:
    """All trainings of each policy on each task, by task and name of the policy.

    Args:
        ladders: by name.
    """
    found: dict[tuple[str, str], list[LadderResult]] = {}
    for name, ladder in ladders.items():
        found.setdefault((ladder.task, policy_name(name, ladder)), []).append(ladder)
    return found


@dataclass(frozen=True)
class Distance:
    """How far pairs of ladders are apart on rungs, as shares of the episodes of a rung.

    Attributes:
        pairs: rungs that were compared; of no pair nothing is known.
        mean: over them, of the absolute difference of what is solved.
        largest: likewise.
    """

    pairs: int
    mean: float
    largest: float


class Trainings:
    """Policies of which several trainings were played on the same episodes of a task.

    Args:
        ladders: by name.
    """

    def __init__(self, ladders: Mapping[str, LadderResult]):
        once = {key: _of_each_weights(found) for key, found in by_policy(ladders).items()}
        self._several = {key: trained for key, trained in once.items() if len(trained) > 1}

    @property
    def policies(self) -> list[str]:
        """Names of those that have several trainings on any task."""
        return sorted({policy for _, policy in self._several})

    def apart(self, first: str, second: str, rungs: Sequence[str]) -> Distance:
        """Trainings of two policies on the same task, over all tasks, on the certified of some rungs.

        Args:
            first: one of `policies`.
            second: another, or the same: then any two of its trainings.
            rungs: names of rungs.
        """
        tasks = {task for task, _ in self._several}
        pairs = chain.from_iterable(self._pairs(task, first, second) for task in sorted(tasks))
        return _distance(pairs, rungs)

    def _pairs(self, task: str, first: str, second: str) -> Iterable[tuple[LadderResult, LadderResult]]:
        some, others = (self._several.get((task, policy), []) for policy in (first, second))
        return combinations(some, 2) if first == second else product(some, others)


def _of_each_weights(ladders: Iterable[LadderResult]) -> list[LadderResult]:
    """One ladder of equal weights, which are no second training."""
    return [*{ladder.checkpoint_sha256: ladder for ladder in ladders}.values()]


def _distance(pairs: Iterable[tuple[LadderResult, LadderResult]], names: Sequence[str]) -> Distance:
    apart = [
        abs(first.by_name[name].rates["policy"].rate - second.by_name[name].rates["policy"].rate)
        for first, second in pairs
        for name in names
        if _are_alike(first.by_name.get(name), second.by_name.get(name))
    ]
    return Distance(len(apart), sum(apart) / max(1, len(apart)), max(apart, default=0.0))


def _are_alike(first: Rung | None, second: Rung | None) -> bool:
    """Certified, in one world, and of the same episodes."""
    if first is None or second is None:
        return False
    certified = first.is_certified and second.is_certified
    return certified and first.world == second.world and first.seeds == second.seeds
