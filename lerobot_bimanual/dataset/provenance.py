"""Where a dataset comes from: `meta/bimanual.json`, beside LeRobot's own metadata."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Self

from lerobot_bimanual.dataset.schema import SCHEMA_VERSION, View
from lerobot_bimanual.errors import BimanualError, SchemaMismatch
from lerobot_bimanual.json_file import read_json

PROVENANCE_FILE = Path("meta", "bimanual.json")
SIMULATION_PACKAGES = ("lerobot_bimanual", "lerobot_env_bimanual", "mujoco", "frankik", "numpy")
"""Packages whose versions decide which episode a seed means."""

STAMPED_PACKAGES = (*SIMULATION_PACKAGES, "lerobot")


@dataclass(frozen=True, order=True)
class EpisodeKey:
    """What identifies one episode, and regenerates it, given the versions."""

    task: str
    variation: int
    split: str
    seed: int


@dataclass(frozen=True)
class SkippedSeed(EpisodeKey):
    """A seed that was tried and gave no episode."""

    reason: str

    @property
    def key(self) -> EpisodeKey:
        """The episode that it did not give."""
        return EpisodeKey(self.task, self.variation, self.split, self.seed)


@dataclass(frozen=True)
class Provenance:
    """Everything needed to make a dataset again.

    Attributes:
        schema_version: version of the feature table.
        view: which rows and images are stored.
        versions: package -> version, of `STAMPED_PACKAGES`.
        settings: what was asked for, by option name; equal settings and versions give an equal dataset.
        command: the command line that regenerates it.
        episodes: key of each episode, in order of the episode index.
        skipped: seeds that failed, with the reason.
    """

    schema_version: int
    view: View
    versions: Mapping[str, str]
    settings: Mapping[str, Any]
    command: str
    episodes: Sequence[EpisodeKey]
    skipped: Sequence[SkippedSeed]

    @classmethod
    def read(cls, root: Path) -> Self | None:
        """Provenance of a dataset; `None` where there is none, as after a merge by LeRobot's own tools.

        Raises:
            SchemaMismatch: the file has another form than this version writes.
        """
        path = root / PROVENANCE_FILE
        return cls.load(path) if path.is_file() else None

    @classmethod
    def load(cls, path: Path) -> Self:
        """Provenance from its file, wherever it lies.

        Raises:
            SchemaMismatch: the file has another form than this version writes, or cannot be read.
        """
        try:
            content = read_json(path)
            if not all(isinstance(content[name], dict) for name in ("versions", "settings")):
                raise TypeError("versions and settings must be objects")
            episodes = [EpisodeKey(**key) for key in content.pop("episodes")]
            skipped = [SkippedSeed(**seed) for seed in content.pop("skipped")]
            return cls(**content, episodes=episodes, skipped=skipped)
        except (BimanualError, ValueError, KeyError, TypeError, AttributeError) as error:
            raise SchemaMismatch(
                f"{path} is not what schema version {SCHEMA_VERSION} of lerobot_bimanual writes: {error}"
            ) from error

    def other_versions(self) -> dict[str, tuple[str, str]]:
        """Packages that decide what a seed means and differ here: package -> (recorded, installed) version."""
        installed = installed_versions()
        return {
            package: (recorded, installed[package])
            for package in SIMULATION_PACKAGES
            if (recorded := self.versions.get(package, "none")) != installed[package]
        }

    def write(self, root: Path) -> None:
        """Store it in a dataset's folder."""
        path = root / PROVENANCE_FILE
        path.write_text(json.dumps(asdict(self), indent=2) + "\n", encoding="utf-8")


def installed_versions(packages: Sequence[str] = STAMPED_PACKAGES) -> dict[str, str]:
    """Versions of packages in this process; "none" for one that is not installed."""
    versions = {}
    for package in packages:
        try:
            versions[package] = version(package)
        except PackageNotFoundError:
            versions[package] = "none"
    return versions
