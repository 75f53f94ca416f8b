"""The plan: which seeds are tried, and in which shards.

The seeds of a task, `first_seed` and those after it, take its variations in turn; with several plans, each seed is a candidate
for every plan. A dataset holds the first successes of every variation and plan, in the order of the seeds, so its content
depends only on the settings, however many processes tried the seeds. Candidates come in rounds: the first round has as many
as episodes are wanted; each further round replaces the failures of the rounds before.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import count, islice, product

from lerobot_bimanual.dataset.provenance import EpisodeKey, SkippedSeed
from lerobot_bimanual.errors import DatasetError
from lerobot_bimanual.results.record import Record
from lerobot_env_bimanual.generation.settings import GenerationSettings
from lerobot_env_bimanual.tasks.registry import get_task

MAX_FAILURES_PER_EPISODE = {"one": 1.0, "several": 4.0}
"""Half to all of the scenes allow all plans of their task."""
MIN_FAILURES_ALLOWED = 20
"""A task whose expert fails on more seeds than this is broken, and generation stops."""


@dataclass(frozen=True)
class Shard:
    """Candidates of one task that one process tries in turn; its folder's name is in the order of the episodes."""

    name: str
    candidates: tuple[EpisodeKey, ...]


class ShardReport(Record):
    """What became of a shard's candidates: those that the expert solved, in order, and the others with the reason."""

    episodes: tuple[EpisodeKey, ...]
    skipped: tuple[SkippedSeed, ...]


def next_round(settings: GenerationSettings, reports: Sequence[ShardReport]) -> list[Shard]:
    """Shards of the next round, given the reports of all rounds before; empty when every episode is there.

    Raises:
        DatasetError: an expert failed too often; the message lists the reasons.
    """
    found = Counter(map(_kind, (key for report in reports for key in report.episodes)))
    skipped = [seed for report in reports for seed in report.skipped]
    tried = found + Counter(map(_kind, skipped))
    allowed = max(MIN_FAILURES_ALLOWED, MAX_FAILURES_PER_EPISODE[settings.plans] * settings.episodes)
    shards: list[Shard] = []
    for task in settings.tasks:
        failures = [f"seed {seed.seed}: {seed.reason}" for seed in skipped if seed.task == task]
        if len(failures) > allowed:
            raise DatasetError(
                f"the expert of {task!r} failed on {len(failures)} seeds, more than the {allowed:.0f} allowed for "
                f"{settings.episodes} episodes. Last failures: {'; '.join(failures[-3:])}"
            )
        candidates = sorted(
            _candidates(settings, task, found, tried), key=lambda each: (each.seed, each.plan)
        )
        for start in range(0, len(candidates), settings.episodes_per_shard):
            name = f"{len(reports) + len(shards):06d}"
            shards.append(Shard(name, tuple(candidates[start : start + settings.episodes_per_shard])))
    return shards


def _candidates(
    settings: GenerationSettings, task: str, found: Counter, tried: Counter
) -> Iterator[EpisodeKey]:
    """Untried candidates: for each variation and plan, as many as its missing episodes."""
    variations = settings.variations_of(task)
    plans = len(get_task(task).spec.plans) if settings.plans == "several" else 1
    for (plan, variation), nth in zip(product(range(plans), variations), count()):
        kind, place = (task, variation, plan), nth % len(variations)
        missing = len(range(nth, settings.episodes, plans * len(variations))) - found[kind]
        seeds = count(settings.first_seed + place, len(variations))
        for seed in islice(seeds, tried[kind], tried[kind] + missing):
            yield EpisodeKey(task=task, variation=variation, split=settings.split, seed=seed, plan=plan)


def _kind(key: EpisodeKey) -> tuple[str, int, int]:
    """Task, variation and plan of a candidate; episodes are divided equally among those of a task."""
    return key.task, key.variation, key.plan
