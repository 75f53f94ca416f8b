"""Whether a dataset's episodes are those that its settings lead to, seed by seed."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from pathlib import Path

from lerobot_bimanual.dataset.provenance import EpisodeKey, Provenance
from lerobot_bimanual.errors import BimanualError, DatasetError
from lerobot_env_bimanual.generation.plan import ShardReport, next_round
from lerobot_env_bimanual.generation.settings import GenerationSettings
from lerobot_env_bimanual.verification.fault import Fault

ROOT = "--root="
"""The one word of the command that does not follow from the settings."""


def planned_shards(provenance: Provenance) -> list[ShardReport]:
    """What became of each shard, if the seeds failed that the provenance says failed.

    Raises:
        BimanualError: the settings are none, or more seeds fail than generation allows.
    """
    settings = GenerationSettings.of(**provenance.settings)
    if settings.total_episodes != len(provenance.episodes):
        raise DatasetError(
            f"the settings ask for {settings.total_episodes} episodes, but {len(provenance.episodes)} are listed"
        )
    failed = {seed.key: seed for seed in provenance.skipped}
    reports: list[ShardReport] = []
    while planned := next_round(settings, reports, len(reports)):
        for shard in planned:
            solved = tuple(candidate for candidate in shard.candidates if candidate not in failed)
            skipped = tuple(failed[candidate] for candidate in shard.candidates if candidate in failed)
            reports.append(ShardReport(episodes=solved, skipped=skipped))
    return reports


def shard_sizes(provenance: Provenance) -> list[int]:
    """Number of episodes that each shard gave, in their order; one shard of all where the settings make no sense."""
    try:
        return [len(report.episodes) for report in planned_shards(provenance)]
    except BimanualError:
        return [len(provenance.episodes)]


def check_plan(root: Path) -> Iterator[Fault]:
    """The settings, with the seeds that failed, give the listed episodes, and the command gives the settings."""
    provenance = Provenance.of_dataset(root)
    if provenance is None:
        return  # the check of the provenance says so
    reports = planned_shards(provenance)
    episodes: list[EpisodeKey] = [key for report in reports for key in report.episodes]
    for index, (listed, planned) in enumerate(zip(provenance.episodes, episodes, strict=True)):
        if listed != planned:
            yield Fault(f"episode {index} is {listed}, but the settings lead to {planned}")
            break
    skipped = [seed for report in reports for seed in report.skipped]
    if tuple(skipped) != provenance.skipped:
        yield Fault(
            f"{len(provenance.skipped)} seeds are listed as failed, of which the settings reach {len(skipped)}"
        )
    settings = GenerationSettings.of(**provenance.settings)
    roots = [word.removeprefix(ROOT) for word in shlex.split(provenance.command) if word.startswith(ROOT)]
    wanted = settings.command(roots[0] if roots else "")
    if provenance.command != wanted:
        yield Fault(f"the command is {provenance.command!r}, but the settings are those of {wanted!r}")
