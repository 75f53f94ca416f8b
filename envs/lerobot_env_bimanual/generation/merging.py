"""Merges finished shards into the dataset that is published."""

from __future__ import annotations

import contextlib
import io
import json
from collections.abc import Sequence
from pathlib import Path

import datasets.config
from lerobot.datasets.aggregate import aggregate_datasets

from lerobot_bimanual.dataset.card import write_card
from lerobot_bimanual.dataset.provenance import Provenance, installed_versions
from lerobot_bimanual.dataset.schema import SCHEMA_VERSION, View
from lerobot_env_bimanual.generation.candidates import ShardReport
from lerobot_env_bimanual.generation.settings import GenerationSettings
from lerobot_env_bimanual.generation.staging import view_folder


def merge_shards(
    settings: GenerationSettings,
    command: str,
    shards: Sequence[tuple[Path, ShardReport]],
    root: Path,
    cache: Path,
) -> None:
    """Merge shards into one dataset per view.

    Every shard keeps its own files, so the time grows with the size of the dataset and not with its square.

    Args:
        settings: what was recorded.
        command: the command line that made it.
        shards: folder and report of each shard, in the order of the episodes.
        root: new folder; holds the view, or a folder per view.
        cache: folder for the copies that reading a table leaves behind.
    """
    full = [folder for folder, report in shards if report.episodes]
    datasets.config.HF_DATASETS_CACHE = cache
    for view in settings.views:
        folder = view_folder(root, settings, view)
        folder.parent.mkdir(parents=True, exist_ok=True)
        with contextlib.redirect_stderr(io.StringIO()):  # two progress bars of its own
            aggregate_datasets(
                [settings.repo_id] * len(full),
                settings.repo_id,
                roots=[shard / view for shard in full],
                aggr_root=folder,
                concatenate_videos=False,
                concatenate_data=False,
            )
        _sort_keys(folder / "meta" / "stats.json")
        _provenance(settings, command, view, [report for _, report in shards]).write(folder)
        write_card(folder, settings.repo_id)


def _provenance(
    settings: GenerationSettings, command: str, view: View, reports: Sequence[ShardReport]
) -> Provenance:
    return Provenance(
        schema_version=SCHEMA_VERSION,
        view=view,
        versions=installed_versions(),
        settings=settings.to_dict(),
        command=command,
        episodes=[episode for report in reports for episode in report.episodes],
        skipped=[seed for report in reports for seed in report.skipped],
    )


def _sort_keys(path: Path) -> None:
    """LeRobot writes the statistics in the order of a set, which differs between processes."""
    content = json.loads(path.read_text(encoding="utf-8"))
    path.write_text(json.dumps(content, indent=4, sort_keys=True) + "\n", encoding="utf-8")
