"""Seals a finished shard, and tells whether a seal is whole.

A sealed folder holds, beside its datasets, `report.json` (what was asked for, with which versions, and what became
of it) and `SHA256SUMS`, the hash of every other file in the form that `sha256sum --check` reads. A folder that does
not agree with both in everything is not merged, wherever it comes from.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict
from pathlib import Path

from lerobot_bimanual.dataset.provenance import Recipe, SkippedSeed, installed_versions
from lerobot_bimanual.errors import DatasetError
from lerobot_env_bimanual.generation.candidates import Shard, ShardReport
from lerobot_env_bimanual.generation.settings import GenerationSettings

REPORT_FILE = "report.json"
SUMS_FILE = "SHA256SUMS"


class BrokenSeal(DatasetError):
    """A shard that is damaged, or that belongs to another dataset."""

    def __init__(self, folder: Path, reason: str):
        super().__init__(f"shard {folder.name} in {folder.parent}: {reason}")


def seal(folder: Path, settings: GenerationSettings, report: ShardReport) -> None:
    """Close a shard whose files are all written."""
    content = {"settings": settings.to_dict(), "versions": installed_versions(), **asdict(report)}
    (folder / REPORT_FILE).write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    sums = _sums(folder)
    (folder / SUMS_FILE).write_text("".join(f"{sums[name]}  {name}\n" for name in sums), encoding="utf-8")


def read_sealed(folder: Path, settings: GenerationSettings, shard: Shard) -> ShardReport:
    """Report of a sealed shard.

    Args:
        folder: of the shard.
        settings: what should have been recorded.
        shard: candidates that should have been tried.

    Raises:
        BrokenSeal: a file is missing, new or changed, or the shard was recorded with other settings, versions or
            candidates.
    """
    _check_files(folder)
    try:
        content = json.loads((folder / REPORT_FILE).read_text(encoding="utf-8"))
        report = ShardReport(
            tuple(Recipe(**recipe) for recipe in content["episodes"]),
            tuple(SkippedSeed(**seed) for seed in content["skipped"]),
        )
        recorded = GenerationSettings.from_dict(content["settings"])
        versions = content["versions"]
    except (ValueError, KeyError, TypeError) as error:
        raise BrokenSeal(
            folder, f"{REPORT_FILE} has another form than this version writes ({error})"
        ) from None
    if differences := recorded.differences(settings):
        raise BrokenSeal(folder, f"recorded with other settings: {'; '.join(differences)}")
    if versions != installed_versions():
        raise BrokenSeal(folder, f"recorded with {versions}, but installed are {installed_versions()}")
    tried = sorted((recipe.task, recipe.variation, recipe.split, recipe.seed) for recipe in _recipes(report))
    planned = sorted(
        (recipe.task, recipe.variation, recipe.split, recipe.seed) for recipe in shard.candidates
    )
    if tried != planned:
        raise BrokenSeal(folder, f"it holds the candidates {tried}, not {planned}")
    return report


def _recipes(report: ShardReport) -> tuple[Recipe | SkippedSeed, ...]:
    return (*report.episodes, *report.skipped)


def _check_files(folder: Path) -> None:
    try:
        lines = (folder / SUMS_FILE).read_text(encoding="utf-8").splitlines()
        expected = {name: digest for digest, name in (line.split("  ", 1) for line in lines)}
    except (OSError, ValueError) as error:
        raise BrokenSeal(folder, f"{SUMS_FILE} cannot be read ({error})") from None
    try:
        found = _sums(folder)
    except OSError as error:
        raise BrokenSeal(folder, f"a file cannot be read ({error})") from None
    for name in sorted(expected.keys() | found.keys()):
        if name not in found:
            raise BrokenSeal(folder, f"{name} is missing")
        if name not in expected:
            raise BrokenSeal(folder, f"{name} does not belong to it")
        if found[name] != expected[name]:
            raise BrokenSeal(folder, f"{name} has changed since it was written")


def _sums(folder: Path) -> dict[str, str]:
    """Hash of every file but the list of hashes, by its path in the folder, in order."""
    files = sorted(path for path in folder.rglob("*") if path.is_file() and path.name != SUMS_FILE)
    return {path.relative_to(folder).as_posix(): _sha256(path) for path in files}


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
