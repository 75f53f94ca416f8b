"""Where a dataset comes from: `meta/bimanual.json`, beside LeRobot's own metadata."""

import json
import re
import reprlib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, Self

from lerobot_bimanual.dataset.schema import SCHEMA_VERSION, VIEWS, View
from lerobot_bimanual.errors import BimanualError, SchemaMismatch
from lerobot_bimanual.json_file import read_json
from lerobot_bimanual.versions import SIMULATION_PACKAGES, installed_versions

VERSION = r"[\w.+!-]{1,40}"
"""Regular expression of a version; error messages put it into commands, so it can hold nothing else."""

PROVENANCE_FILE = Path("meta", "bimanual.json")
MAX_INT = 2**63
"""Seeds and variations are stored as 64-bit integers."""


@dataclass(frozen=True, order=True)
class EpisodeKey:
    """What identifies one episode, and regenerates it, given the versions."""

    task: str
    variation: int
    split: str
    seed: int

    @classmethod
    def from_dict(cls, content: object) -> Self:
        """The value that `dataclasses.asdict` gave, after a passage through JSON.

        Raises:
            SchemaMismatch: a field is missing, unknown, or of another type.
        """
        kinds = {field.name: int if field.name in ("variation", "seed") else str for field in fields(cls)}
        if not isinstance(content, dict) or content.keys() != kinds.keys():
            raise SchemaMismatch(f"an episode or seed has {', '.join(kinds)}, not {_shortened(content)}")
        for name, kind in kinds.items():
            value = content[name]
            if type(value) is not kind or (isinstance(value, int) and not 0 <= value < MAX_INT):
                raise SchemaMismatch(f"{name} of an episode or seed is {_shortened(value)}")
        return cls(**content)


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
        worlds: task -> version of the world in which it was played.
        settings: what was asked for, by option name; equal settings and versions give an equal dataset.
        command: the command line that regenerates it.
        episodes: key of each episode, in order of the episode index.
        skipped: seeds that failed, with the reason.
    """

    schema_version: int
    view: View
    versions: Mapping[str, str]
    worlds: Mapping[str, str]
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
            return cls._from_dict(read_json(path))
        except BimanualError as error:
            raise SchemaMismatch(
                f"{path} is not what schema version {SCHEMA_VERSION} of lerobot_bimanual writes: {error}"
            ) from error

    @classmethod
    def _from_dict(cls, content: object) -> Self:
        names = [field.name for field in fields(cls)]
        if not isinstance(content, dict) or content.keys() != {*names}:
            raise SchemaMismatch(f"it must have {', '.join(names)} and nothing else")
        if content["schema_version"] != SCHEMA_VERSION:
            raise SchemaMismatch(f"schema_version is {_shortened(content['schema_version'])}")
        if content["view"] not in VIEWS:
            raise SchemaMismatch(f"view is {_shortened(content['view'])}, not one of {', '.join(VIEWS)}")
        check_versions(content["versions"])
        check_versions(content["worlds"])
        for name, kind in (("settings", dict), ("command", str), ("episodes", list), ("skipped", list)):
            if not isinstance(content[name], kind):
                raise SchemaMismatch(f"{name} is {_shortened(content[name])}")
        if not content["episodes"]:
            raise SchemaMismatch("there are no episodes")
        episodes = [EpisodeKey.from_dict(key) for key in content["episodes"]]
        skipped = [SkippedSeed.from_dict(seed) for seed in content["skipped"]]
        return cls(**content | {"episodes": episodes, "skipped": skipped})

    @property
    def perturb(self) -> str:
        """What was different from the world as it is, `AXIS:LEVEL,...`."""
        return str(self.settings.get("perturb", ""))

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


def check_versions(versions: object) -> None:
    """Refuse what are no versions of packages or worlds.

    Raises:
        SchemaMismatch: it is not a version by name.
    """
    if not isinstance(versions, dict) or not all(
        isinstance(version, str) and re.fullmatch(VERSION, version) for version in versions.values()
    ):
        raise SchemaMismatch(f"versions are {_shortened(versions)}, not a version such as 3.2.1 by name")


def _shortened(value: object) -> str:
    return reprlib.repr(value)
