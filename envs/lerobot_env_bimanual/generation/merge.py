"""Merges finished shards into the dataset that is published."""

from __future__ import annotations

import json
from pathlib import Path

from lerobot_bimanual.dataset.card import write_card
from lerobot_bimanual.dataset.merging import merge_datasets
from lerobot_bimanual.dataset.provenance import Provenance
from lerobot_bimanual.dataset.schema import SCHEMA_VERSION
from lerobot_bimanual.dataset.seal import write_seal
from lerobot_bimanual.versions import installed_versions
from lerobot_env_bimanual.generation.executor import MergeJob
from lerobot_env_bimanual.generation.publication import view_folder


def merge_shards(job: MergeJob) -> None:
    """Merge the shards of a view into one dataset, with its card and its seal.

    Every shard keeps its own files, so the time grows with the size of the dataset and not with its square.
    """
    folder = view_folder(job.root, job.settings, job.view)
    merge_datasets([shard / job.view for shard, report in job.shards if report.episodes], folder)
    _sort_keys(folder / "meta" / "stats.json")
    _provenance(job).write(folder)
    write_card(folder, job.settings.repo_id)
    write_seal(folder)


def _provenance(job: MergeJob) -> Provenance:
    reports = [report for _, report in job.shards]
    return Provenance(
        schema_version=SCHEMA_VERSION,
        view=job.view,
        versions=installed_versions(),
        worlds=job.worlds,
        settings=job.settings.to_dict(),
        command=job.command,
        episodes=[episode for report in reports for episode in report.episodes],
        skipped=[seed for report in reports for seed in report.skipped],
    )


def _sort_keys(path: Path) -> None:
    """LeRobot writes the statistics in the order of a set, which differs between processes."""
    content = json.loads(path.read_text(encoding="utf-8"))
    path.write_text(json.dumps(content, indent=4, sort_keys=True) + "\n", encoding="utf-8")
