"""What a staging folder or a dataset says it was made of: settings, versions and worlds."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Self

from lerobot_bimanual.errors import DatasetError
from lerobot_bimanual.results.record import Record
from lerobot_bimanual.versions import Version, installed_versions
from lerobot_env_bimanual.experts.world_version import world_versions
from lerobot_env_bimanual.generation.settings import GenerationSettings


class Origin(Record):
    """What decides every byte of a dataset.

    Attributes:
        settings: what was asked for.
        versions: package -> version with which it was made.
        worlds: task -> version of the world in which its episodes are played.
    """

    settings: GenerationSettings
    versions: dict[str, Version]
    worlds: dict[str, Version]

    @classmethod
    def here(cls, settings: GenerationSettings) -> Self:
        """That of what is made by this installation; plays one episode per task to know its world."""
        worlds = world_versions(settings.tasks, settings.perturb)
        return cls(settings=settings, versions=installed_versions(), worlds=worlds)

    def refuse_at(self, place: Path, found: Origin) -> None:
        """Refuse a place that holds something of another origin than this.

        Raises:
            DatasetError: it does; the message lists what differs.
        """
        if differences := [*_differences(found.to_dict(), self.to_dict())]:
            raise DatasetError(
                f"{place} holds a dataset of other settings, versions or worlds: {'; '.join(differences)}. Repeat the "
                "command that made it with the versions that made it, choose another --root, or remove the folder"
            )

    def to_dict(self) -> dict[str, dict[str, Any]]:
        """Plain values by name, under `settings`, `versions` and `worlds`."""
        return self.model_dump(mode="json")


def _differences(found: dict[str, dict[str, Any]], wanted: dict[str, dict[str, Any]]) -> list[str]:
    """Each entry that differs, as "it is this, not that"."""
    return [
        f"{name} is {found[part].get(name)!r}, not {wanted[part].get(name)!r}"
        for part in wanted
        for name in sorted(found[part].keys() | wanted[part].keys())
        if found[part].get(name) != wanted[part].get(name)
    ]
