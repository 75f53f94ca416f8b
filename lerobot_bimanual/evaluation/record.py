"""All episodes of one evaluation of one task, as a JSON file."""

import json
import platform
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Self

from lerobot_bimanual.evaluation.played_episode import PlayedEpisode
from lerobot_bimanual.json_record import read
from lerobot_bimanual.output_file import write_file
from lerobot_bimanual.versions import STAMPED_PACKAGES, installed_versions

RECORD_SCHEMA_VERSION = 1
RESULT_PACKAGES = (*STAMPED_PACKAGES, "lerobot_policy_bimanual", "torch")


@dataclass(frozen=True)
class EvaluationRecord:
    """One evaluation.

    Attributes:
        schema_version: version of this table of fields.
        task: name of the task.
        world: version of what the task's world does.
        options: options of the environment that decide what is played and seen, by name.
        batch_size: environments side by side; a network's answers differ in their last bits between batch sizes, so a
            policy gives the same episodes again only with the same one.
        versions: package -> version.
        episodes: sorted by seed.

    Raises:
        ValueError: a value is impossible.
    """

    schema_version: int
    task: str
    world: str
    options: dict[str, str]
    batch_size: int
    versions: dict[str, str]
    episodes: tuple[PlayedEpisode, ...]

    def __post_init__(self) -> None:
        if self.schema_version != RECORD_SCHEMA_VERSION:
            raise ValueError(f"schema_version is {self.schema_version}, but must be {RECORD_SCHEMA_VERSION}")
        if self.batch_size < 1:
            raise ValueError(f"batch_size is {self.batch_size}, but must be at least 1")
        seeds = [episode.seed for episode in self.episodes]
        if not seeds or seeds != sorted(set(seeds)):
            raise ValueError("episodes must be there, and their seeds rise")

    @property
    def perturb(self) -> str:
        """What was different from the world as it is, `AXIS:LEVEL,...`."""
        return self.options.get("perturb", "")

    def write(self, path: Path) -> None:
        """Write a JSON file with one episode per line.

        Raises:
            UnwritableOutput: it cannot be written.
        """
        content = asdict(self)
        lines = ",\n  ".join(json.dumps(episode) for episode in content.pop("episodes"))
        head = json.dumps(content, indent=1).removesuffix("\n}")
        write_file(path, f'{head},\n "episodes": [\n  {lines}\n ]\n}}\n')

    @classmethod
    def read(cls, path: Path) -> Self:
        """The evaluation in a file.

        Raises:
            BimanualError: the file cannot be read, or is no such record; the message names it.
        """
        return read(cls, path, "evaluation")


def result_versions() -> dict[str, str]:
    """Versions of the installed packages that a result depends on, and of Python."""
    found = installed_versions(RESULT_PACKAGES)
    # LeRobot's own policies do without ours.
    present = {package: version for package, version in found.items() if version != "none"}
    return {"python": platform.python_version()} | present
