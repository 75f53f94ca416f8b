"""The report and the checksums of a finished shard, and whether its files still agree with them.

A finished shard holds, beside its datasets, `report.json` (what was asked for, with which versions, and what became
of it) and `SHA256SUMS`, the hash of every other file in the form that `sha256sum --check` reads. A folder that does
not agree with both in everything is not merged, wherever it comes from.
"""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

from lerobot_bimanual.checksums import sums_problems, write_sums
from lerobot_bimanual.dataset.provenance import EpisodeKey, SkippedSeed, installed_versions
from lerobot_bimanual.errors import BimanualError, DatasetError
from lerobot_env_bimanual.generation.plan import Shard, ShardReport
from lerobot_env_bimanual.generation.settings import GenerationSettings

REPORT_FILE = "report.json"


class DamagedShard(DatasetError):
    """A shard that is damaged, or that belongs to another dataset."""

    def __init__(self, folder: Path, reason: str):
        super().__init__(f"shard {folder.name} in {folder.parent}: {reason}")


def write_report(folder: Path, settings: GenerationSettings, report: ShardReport) -> None:
    """Write report and checksums of a shard whose other files are all written."""
    content = {"settings": settings.to_dict(), "versions": installed_versions(), **asdict(report)}
    (folder / REPORT_FILE).write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    write_sums(folder)


def read_report(folder: Path, settings: GenerationSettings, shard: Shard) -> ShardReport:
    """Report of a finished shard, after a look at every file.

    Args:
        folder: of the shard.
        settings: what should have been recorded.
        shard: candidates that should have been tried.

    Raises:
        DamagedShard: a file is missing, new or changed, or the shard was recorded with other settings, versions or
            candidates.
    """
    if problem := next(sums_problems(folder), None):
        raise DamagedShard(folder, problem)
    try:
        content = json.loads((folder / REPORT_FILE).read_text(encoding="utf-8"))
        report = ShardReport(
            tuple(EpisodeKey(**key) for key in content["episodes"]),
            tuple(SkippedSeed(**seed) for seed in content["skipped"]),
        )
        recorded = GenerationSettings.from_dict(content["settings"])
        versions = content["versions"]
    except (ValueError, KeyError, TypeError, BimanualError) as error:
        raise DamagedShard(
            folder, f"{REPORT_FILE} has another form than this version writes ({error})"
        ) from None
    if differences := recorded.differences(settings):
        raise DamagedShard(folder, f"recorded with other settings: {'; '.join(differences)}")
    if versions != installed_versions():
        raise DamagedShard(folder, f"recorded with {versions}, but installed are {installed_versions()}")
    tried = sorted([*report.episodes, *(seed.key for seed in report.skipped)])
    if tried != sorted(shard.candidates):
        raise DamagedShard(folder, f"it holds the candidates {tried}, not {sorted(shard.candidates)}")
    return report
