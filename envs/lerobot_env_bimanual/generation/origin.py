"""What a staging folder, a shard or a dataset says it was made of: settings and versions, side by side in a file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from lerobot_bimanual.dataset.provenance import check_versions
from lerobot_bimanual.errors import DatasetError
from lerobot_bimanual.versions import installed_versions
from lerobot_env_bimanual.generation.settings import GenerationSettings


@dataclass(frozen=True)
class Origin:
    """What decides every byte of a dataset.

    Attributes:
        settings: what was asked for.
        versions: package -> version with which it was made.
    """

    settings: GenerationSettings
    versions: Mapping[str, str]

    @classmethod
    def here(cls, settings: GenerationSettings) -> Self:
        """That of what is made by this installation."""
        return cls(settings, installed_versions())

    @classmethod
    def from_dict(cls, content: object) -> Self:
        """From the content of a file, which may hold more.

        Raises:
            BimanualError: it does not say it, or names settings of no dataset.
        """
        if not isinstance(content, dict) or not {"settings", "versions"} <= content.keys():
            raise DatasetError("it must be an object with settings and versions")
        check_versions(content["versions"])
        return cls(GenerationSettings.from_dict(content["settings"]), content["versions"])

    def to_dict(self) -> dict[str, Any]:
        """Plain values under the names `settings` and `versions`."""
        return {"settings": self.settings.to_dict(), "versions": dict(self.versions)}

    def differences(self, other: Origin) -> list[str]:
        """Each setting and version that differs, as "it is here, not there"."""
        packages = sorted(self.versions.keys() | other.versions.keys())
        versions = [(name, *(of.versions.get(name, "none") for of in (self, other))) for name in packages]
        return [
            *self.settings.differences(other.settings),
            *(f"{name} is {mine}, not {theirs}" for name, mine, theirs in versions if mine != theirs),
        ]

    def refuse_at(self, place: Path, found: Origin) -> None:
        """Refuse a place that holds something of another origin than this.

        Raises:
            DatasetError: it does; the message lists what differs.
        """
        if differences := found.differences(self):
            raise DatasetError(
                f"{place} holds a dataset of other settings or versions: {'; '.join(differences)}. Repeat the command "
                "that made it with the versions that made it, choose another --root, or remove the folder"
            )
