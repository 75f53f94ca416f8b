"""The report of a finished shard, and whether the shard still agrees with it.

A finished shard holds, beside its datasets, `report.json` (what was asked for, with which versions, and what became
of it) and `SHA256SUMS`, the hash of every other file. A folder that does not agree with both in everything is not
merged, wherever it comes from.
"""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from lerobot_bimanual.checksums import sums_problems, write_sums
from lerobot_bimanual.dataset.provenance import EpisodeKey, SkippedSeed
from lerobot_bimanual.errors import BimanualError, DatasetError
from lerobot_bimanual.json_file import read_json
from lerobot_env_bimanual.generation.origin import Origin
from lerobot_env_bimanual.generation.plan import Shard, ShardReport
from lerobot_env_bimanual.generation.settings import GenerationSettings

REPORT_FILE = "report.json"


class DamagedShard(DatasetError):
    """A shard that is damaged, or that belongs to another dataset."""

    def __init__(self, folder: Path, reason: str):
        super().__init__(f"shard {folder.name} in {folder.parent}: {reason}")


def write_report(folder: Path, settings: GenerationSettings, report: ShardReport) -> None:
    """Write report and checksums of a shard whose other files are all written."""
    content = Origin.here(settings).to_dict() | asdict(report)
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
    origin, report = _read(folder)
    if differences := origin.differences(Origin.here(settings)):
        raise DamagedShard(folder, f"recorded with other settings or versions: {'; '.join(differences)}")
    tried = sorted([*report.episodes, *(seed.key for seed in report.skipped)])
    if tried != sorted(shard.candidates):
        raise DamagedShard(folder, f"it holds the candidates {tried}, not {sorted(shard.candidates)}")
    return report


def shard_origin(folder: Path) -> Origin:
    """What a finished shard was made of, after a look at every file.

    Raises:
        DamagedShard: a file is missing, new or changed.
    """
    return _read(folder)[0]


def _read(folder: Path) -> tuple[Origin, ShardReport]:
    if problem := next(sums_problems(folder), None):
        raise DamagedShard(folder, problem)
    try:
        content = read_json(folder / REPORT_FILE)
        origin = Origin.from_dict(content)
        report = ShardReport(
            tuple(map(EpisodeKey.from_dict, _list(content, "episodes"))),
            tuple(map(SkippedSeed.from_dict, _list(content, "skipped"))),
        )
    except BimanualError as error:
        raise DamagedShard(
            folder, f"{REPORT_FILE} has another form than this version writes ({error})"
        ) from None
    return origin, report


def _list(content: dict[str, Any], name: str) -> list[Any]:
    if not isinstance(values := content.get(name), list):
        raise DatasetError(f"{name} must be a list")
    return values
