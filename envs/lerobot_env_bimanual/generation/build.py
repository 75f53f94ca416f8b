"""Builds a dataset: plans, has shards recorded until every episode is there, has them merged, publishes."""

from __future__ import annotations

from collections.abc import Sequence

from tqdm import tqdm

from lerobot_env_bimanual.generation.executor import Executor, MergeJob
from lerobot_env_bimanual.generation.plan import Shard, ShardReport, next_round
from lerobot_env_bimanual.generation.progress import Progress
from lerobot_env_bimanual.generation.settings import GenerationSettings
from lerobot_env_bimanual.generation.shard_report import DamagedShard
from lerobot_env_bimanual.generation.staging import Staging, new_folder


def build_dataset(settings: GenerationSettings, staging: Staging, executor: Executor) -> list[ShardReport]:
    """Record what is missing, merge everything, and publish the dataset.

    Args:
        settings: what the dataset holds.
        staging: where it grows; shards of an earlier run are taken over.
        executor: who does the work.

    Returns:
        The reports of all shards, in the order of the episodes.

    Raises:
        DatasetError: something cannot be written, an expert fails too often, workers died, or shards are damaged
            again and again. What is finished stays for the next run.
    """
    finished = _record(settings, staging, executor)
    folders = [(staging.shard_folder(shard.name), report) for shard, report in finished]
    command = settings.command(staging.root.name)
    with new_folder(staging.folder) as temporary:
        merged = temporary / "dataset"
        jobs = [MergeJob(settings, view, command, staging.worlds, folders, merged) for view in settings.views]
        shards = f"{len(folders)} shard{'s' if len(folders) > 1 else ''}"
        with tqdm(bar_format=f"merging {shards}, {{elapsed}}") as bar:
            for _ in executor.merge(jobs):
                bar.refresh()
        staging.publish(merged)
    return [report for _, report in finished]


def _record(
    settings: GenerationSettings, staging: Staging, executor: Executor
) -> list[tuple[Shard, ShardReport]]:
    """Look what is there and record what is missing, until a look at everything finds nothing missing."""
    rebuilt: set[str] = set()
    with Progress(settings.total_episodes) as progress:
        while True:
            finished, missing = _survey(settings, staging, rebuilt)
            progress.start_from(sum(len(report.episodes) for _, report in finished), executor.successes)
            if not missing:
                return finished
            for _ in executor.record(settings, missing, staging.shard_folder):
                progress.show(executor.successes)


def _survey(
    settings: GenerationSettings, staging: Staging, rebuilt: set[str]
) -> tuple[list[tuple[Shard, ShardReport]], Sequence[Shard]]:
    """Finished shards and, of the first round that lacks some, the missing ones; every file is checked."""
    finished: list[tuple[Shard, ShardReport]] = []
    planned_before = 0
    missing: list[Shard] = []
    while not missing and (planned := next_round(settings, [r for _, r in finished], planned_before)):
        planned_before += len(planned)
        for shard in planned:
            report = _take_over(shard, staging, rebuilt)
            if report is None:
                missing.append(shard)
            else:
                finished.append((shard, report))
    return finished, missing


def _take_over(shard: Shard, staging: Staging, rebuilt: set[str]) -> ShardReport | None:
    try:
        return staging.report(shard)
    except DamagedShard as damaged:
        if shard.name in rebuilt:
            raise  # twice in one run: recording it a third time would not help
        rebuilt.add(shard.name)
        tqdm.write(f"{damaged}; it is recorded again")
        staging.discard(shard)
        return None
