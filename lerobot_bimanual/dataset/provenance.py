"""Where a dataset comes from: `meta/bimanual.json`, beside LeRobot's own metadata."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import Field, PositiveInt

from lerobot_bimanual.dataset.schema import PROVENANCE_FILE, SCHEMA_VERSION, TASK_NAME, VERSION_INFO, View
from lerobot_bimanual.distributions import SIMULATION_PACKAGES, installed_versions
from lerobot_bimanual.errors import DatasetError
from lerobot_bimanual.results.record import Record

Version = Annotated[str, Field(pattern=r"^[\w.+!-]{1,40}$")]
"""A version; error messages put it into commands, so it can hold nothing else."""

MAX_INT = 2**63
"""Seeds and variations are stored as 64-bit integers."""


class EpisodeKey(Record):
    """What identifies one episode, and regenerates it, given the versions; plan 0 is the usual one."""

    task: str
    variation: Annotated[int, Field(ge=0, lt=MAX_INT)]
    split: str
    seed: Annotated[int, Field(ge=0, lt=MAX_INT)]
    plan: Annotated[int, Field(ge=0, lt=MAX_INT, exclude_if=lambda plan: plan == 0)] = 0

    def __str__(self) -> str:
        """The episode in words, such as `lift_ball 0 train 7`."""
        return f"{self.task} {self.variation} {self.split} {self.seed}"


class SkippedSeed(EpisodeKey):
    """A seed that was tried and gave no episode, and why."""

    reason: str


class Provenance(Record):
    """Everything needed to make a dataset again.

    Attributes:
        schema_version: version of the feature table; a dataset that is made again has the present one.
        view: which rows and images are stored.
        versions: package -> version, of `distributions.STAMPED_PACKAGES`.
        worlds: task -> version of the world in which it was played.
        settings: options of the generation, by name; equal settings and versions give an equal dataset.
        command: the command line that regenerates it.
        episodes: key of each episode, in order of the episode index.
        skipped: seeds that failed, with the reason.
    """

    schema_version: PositiveInt
    view: View
    versions: dict[str, Version]
    worlds: dict[str, Version]
    settings: dict[str, Any]
    command: str
    episodes: Annotated[tuple[EpisodeKey, ...], Field(min_length=1)]
    skipped: tuple[SkippedSeed, ...]

    @classmethod
    def of_dataset(cls, root: Path) -> Self | None:
        """Provenance of a dataset, as `Record.read`; None where there is none, as after a merge by LeRobot's own tools."""
        path = root / PROVENANCE_FILE
        return cls.read(path) if path.is_file() else None

    @property
    def perturb(self) -> str:
        """What was perturbed, `AXIS:LEVEL,...`; empty for nominal episodes."""
        return str(self.settings.get("perturb", ""))

    @property
    def setting(self) -> str:
        """Setting of the episodes."""
        return str(self.settings.get("setting", "standard"))

    @property
    def is_for_keypose_policies(self) -> bool:
        """Whether the dataset has keyposes and depth, from which policies with a voxel grid learn."""
        return self.view == "keyframes" and self.settings.get("depth") is not False

    def other_versions(self) -> dict[str, tuple[str, str]]:
        """Packages that decide what a seed means and differ here: package -> (recorded, installed) version."""
        installed = installed_versions()
        return {
            package: (recorded, installed[package])
            for package in SIMULATION_PACKAGES
            if (recorded := self.versions.get(package, "none")) != installed[package]
        }


def check_version(features: Mapping[str, Any], root: Path) -> None:
    """Refuse a dataset of another version of the schema; one without a version, not ours or edited, is not refused."""
    info = (features.get(TASK_NAME) or {}).get("info") or {}
    found = info.get(VERSION_INFO, SCHEMA_VERSION)
    if found != SCHEMA_VERSION:
        raise DatasetError(
            f"{root} has schema version {found}, but this version of lerobot_bimanual reads {SCHEMA_VERSION}: generate "
            f"it again with `lerobot-bimanual dataset generate`; its card and {PROVENANCE_FILE} list the options"
        )
