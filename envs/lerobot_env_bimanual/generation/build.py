"""Builds a dataset: plans, has shards recorded until every episode is there, merges them, publishes."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

from tqdm import tqdm

from lerobot_bimanual.dataset.provenance import Provenance
from lerobot_bimanual.dataset.schema import PROVENANCE_FILE, View
from lerobot_env_bimanual.generation.plan import Shard, ShardReport, next_round
from lerobot_env_bimanual.generation.shard import Job, record_shard
from lerobot_env_bimanual.generation.staging import Staging, new_folder, plain_write_errors, view_folder
from lerobot_env_bimanual.workers import WorkerPool

PRELOADED = ("lerobot_bimanual.dataset.writer",)
"""Seven seconds of LeRobot and torch, which workers import once for all of them."""

type RecordShards = Callable[[Sequence[Job], Callable[[int], object]], None]
"""Records shards in any order; calls the given function with the number of episodes recorded since its last call."""

type Executor = AbstractContextManager[RecordShards]
"""Context in which shards are recorded; at its end it stops everything that it has started."""


@contextmanager
def process_executor(workers: int) -> Iterator[RecordShards]:
    """Record shards with worker processes of this machine, 0 for one per core; an `Executor`."""
    with WorkerPool(workers, preload=PRELOADED) as pool:

        def record(jobs: Sequence[Job], note: Callable[[int], object]) -> None:
            for episodes in pool.map(record_shard, jobs, "", "", name=lambda job: f"shard {job[1].name}"):
                note(episodes)

        yield record


def build_dataset(staging: Staging, record: RecordShards) -> list[ShardReport]:
    """Record what is missing, merge everything, and publish the dataset; shards of an earlier run are taken over.

    Returns:
        The reports of all shards, in the order of the episodes.

    Raises:
        DatasetError: something cannot be written, an expert fails too often, or workers died. What is finished stays
            for the next run.
    """
    settings = staging.settings
    finished: list[tuple[Shard, ShardReport]] = []
    with tqdm(total=settings.total_episodes, unit="demo", smoothing=0) as bar:
        while shards := next_round(settings, [report for _, report in finished]):
            missing = [
                (settings, shard, staging.shard_folder(shard)) for shard in shards if not staging.has(shard)
            ]
            bar.update(sum(len(staging.report(shard).episodes) for shard in shards if staging.has(shard)))
            record(missing, bar.update)
            finished += [(shard, staging.report(shard)) for shard in shards]
    reports = [report for _, report in finished]
    recorded = [staging.shard_folder(shard) for shard, report in finished if report.episodes]
    with new_folder(staging.folder) as temporary:
        merged = temporary / "dataset"
        jobs = [
            (recorded, view_folder(merged, settings, view), _provenance(staging, view, reports))
            for view in settings.views
        ]
        with WorkerPool(len(jobs), preload=PRELOADED) as pool:
            for _ in pool.map(merge_view, jobs, "merging", "view", name=lambda job: job[2].view):
                pass
        staging.publish(merged)
    return reports


def merge_view(job: tuple[Sequence[Path], Path, Provenance]) -> None:
    """Merge a view of finished shards into one dataset, with its card and its checksums.

    Every shard keeps its own files, so the time grows with the size of the dataset and not with its square. A job is the
    folders of the shards, the new folder of the dataset, and its provenance.
    """
    from lerobot_bimanual.dataset.card import write_card
    from lerobot_bimanual.dataset.checksums import write_checksums
    from lerobot_bimanual.dataset.merging import merge_datasets

    shards, folder, provenance = job
    with plain_write_errors(folder):
        merge_datasets([shard / provenance.view for shard in shards], folder)
        provenance.write(folder / PROVENANCE_FILE)
        write_card(folder, provenance.settings["repo_id"])
        write_checksums(folder)


def _provenance(staging: Staging, view: View, reports: Sequence[ShardReport]) -> Provenance:
    return Provenance(
        **dict(staging.origin),
        view=view,
        command=staging.settings.command(staging.settings.repo_id.rpartition("/")[2]),
        episodes=tuple(episode for report in reports for episode in report.episodes),
        skipped=tuple(seed for report in reports for seed in report.skipped),
    )
