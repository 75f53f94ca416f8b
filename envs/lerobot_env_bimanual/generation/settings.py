"""What decides the content of a dataset: equal settings and versions give equal datasets."""

from __future__ import annotations

import re
import shlex
from collections.abc import Collection
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from lerobot_bimanual.dataset.provenance import Provenance, Version
from lerobot_bimanual.dataset.schema import SCHEMA_VERSION, VIEWS, View
from lerobot_bimanual.distributions import installed_versions
from lerobot_bimanual.errors import DatasetError, InvalidChoice
from lerobot_bimanual.results.record import Record
from lerobot_env_bimanual.experts.recorder import recording_options
from lerobot_env_bimanual.experts.world_version import world_versions
from lerobot_env_bimanual.options import ANY_VARIATION, EnvOptions
from lerobot_env_bimanual.tasks.registry import get_task

MIN_VIDEO_SIDE = 16
"""In pixels; the encoder of depth takes no image of 8 by 8."""
Fraction = Annotated[float, Field(gt=0, lt=1)]


class GenerationSettings(Record):
    """Options of one dataset, valid by construction; `DatasetGenerateConfig` explains those of the same name.

    Attributes:
        tasks: task names, in the order of the episodes.
        views: views to store.
        height: image height in pixels.
        width: image width in pixels.
        depth: whether every camera's depth is stored beside its colours; None for the view `keyframes` alone.

    Raises:
        BimanualError: a task or variation does not exist; the message lists the choices.
    """

    tasks: Annotated[tuple[str, ...], Field(min_length=1)]
    variation: str
    episodes: Annotated[int, Field(ge=1, le=100_000)]
    split: Literal["train", "val", "test"]
    first_seed: Annotated[int, Field(ge=0, le=2**48)]
    views: tuple[View, ...]
    cameras: Annotated[tuple[str, ...], Field(min_length=1)]
    height: int
    width: int
    depth: bool | None
    intermediate: tuple[Fraction, ...]
    discretise: Annotated[int, Field(ge=0, le=1000)]
    episodes_per_shard: Annotated[int, Field(ge=1, le=10_000)]
    repo_id: Annotated[str, Field(pattern=r"^\w[\w. -]*(/\w[\w. -]*)?$")]
    perturb: str = ""
    setting: Literal["standard", "varied"] = "standard"
    plans: Annotated[Literal["one", "several"], Field(exclude_if=lambda plans: plans == "one")] = "one"

    @model_validator(mode="after")
    def _exist(self) -> Self:
        check_video_size((self.height, self.width), self.views)
        listed = self.variation.split(",")
        for task in self.tasks:
            spec = get_task(task).spec
            indices = [spec.variation_index(variation) for variation in listed]
            if len(indices) > len(set(indices)) or (len(indices) > 1 and None in indices):
                choices = "any, an index, or different ones separated by commas"
                raise InvalidChoice("variation", self.variation, choices)
            if self.plans == "several" and len(spec.plans) == 1:
                raise InvalidChoice(f"plans of {task}", self.plans, ["one"])
        return self

    def command(self, root: str) -> str:
        """The command line that makes this dataset in the folder `root`, with every option that decides its content."""
        flags = {
            "task": ",".join(self.tasks),
            "variation": self.variation,
            "episodes": self.episodes,
            "split": self.split,
            "first_seed": self.first_seed,
            "view": "both" if self.views == VIEWS else self.views[0],
            "image_size": f"{self.height}x{self.width}",
            "cameras": ",".join(self.cameras),
            "depth": "" if self.depth is None else str(self.depth).lower(),
            "intermediate": ",".join(map(str, self.intermediate)),
            "discretise": self.discretise,
            "perturb": self.perturb,
            "setting": self.setting,
            "plans": "" if self.plans == "one" else self.plans,
            "episodes_per_shard": self.episodes_per_shard,
            "root": root,
            "repo_id": self.repo_id,
        }
        words = [f"--{name}={value}" for name, value in flags.items() if value != ""]
        return shlex.join(["lerobot-bimanual", "dataset", "generate", *words])

    @property
    def options(self) -> EnvOptions:
        """Options of the environments in which the episodes are recorded."""
        size = (self.height, self.width)
        return recording_options(self.split, self.cameras, size, self.perturb, self.setting)

    @property
    def total_episodes(self) -> int:
        """Number of episodes of the whole dataset."""
        return self.episodes * len(self.tasks)

    def variations_of(self, task: str) -> tuple[int, ...]:
        """Variations of a task among which its episodes are divided."""
        if self.variation == ANY_VARIATION:
            return tuple(range(len(get_task(task).spec.variations)))
        return tuple(map(int, self.variation.split(",")))


def check_video_size(size: tuple[int, int], views: Collection[View]) -> None:
    """Refuse heights and widths of images that the videos of the view `frames` cannot have.

    Raises:
        InvalidChoice: a side is odd or too short.
    """
    if "frames" in views and any(side % 2 or side < MIN_VIDEO_SIDE for side in size):
        sides = f"even sides of at least {MIN_VIDEO_SIDE} pixels"
        raise InvalidChoice("image_size of the view frames", "x".join(map(str, size)), sides)


def repo_id_of(given: str | None, root: Path) -> str:
    """LeRobot's name of a dataset: what is given, or `local/` and the name of its folder.

    Raises:
        BimanualError: no repository of the Hub can have the given one.
    """
    from lerobot_bimanual.dataset.hub import check_repo_id

    if given is None:
        name = re.sub(r"[.-]{2,}|[^A-Za-z0-9_.-]", "_", root.absolute().name)
        name = re.sub(r"\.git$", "_git", name[:80].strip(".-"))
        return f"local/{name or 'dataset'}"
    check_repo_id(given)
    return given


class Origin(Record):
    """What decides every byte of a dataset; `Provenance` has it, too, and explains it."""

    schema_version: int
    settings: dict[str, Any]
    versions: dict[str, Version]
    worlds: dict[str, Version]

    @classmethod
    def here(cls, settings: GenerationSettings) -> Self:
        """The origin of a dataset made by this installation; plays one episode per task to find its world version."""
        return cls(
            schema_version=SCHEMA_VERSION,
            settings=settings.model_dump(mode="json"),
            versions=installed_versions(),
            worlds=world_versions(settings.tasks, settings.perturb, settings.setting),
        )

    def refuse_at(self, place: Path, found: Origin | Provenance) -> None:
        """Refuse the folder `place` if what it holds has another origin.

        Raises:
            DatasetError: the origins differ; the message lists the differences.
        """
        pairs = [(getattr(found, part), getattr(self, part)) for part in ("settings", "versions", "worlds")]
        pairs.append(({"schema_version": found.schema_version}, {"schema_version": self.schema_version}))
        differences = [
            f"{name} is {theirs.get(name)!r}, not {ours.get(name)!r}"
            for theirs, ours in pairs
            for name in sorted(theirs.keys() | ours.keys())
            if theirs.get(name) != ours.get(name)
        ]
        if differences:
            raise DatasetError(
                f"{place} holds a dataset of other settings, versions or worlds: {'; '.join(differences)}. Repeat the "
                "command that made it with the versions that made it, choose another --root, or remove the folder"
            )
