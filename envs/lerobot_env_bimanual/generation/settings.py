"""What decides the content of a dataset: equal settings and versions give equal datasets."""

from __future__ import annotations

import re
import shlex
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any, Self

from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.dataset.schema import VIEWS, View
from lerobot_bimanual.errors import DatasetError, InvalidChoice, UnknownCamera
from lerobot_env_bimanual.options import ANY_VARIATION, MAX_IMAGE_SIDE, MIN_IMAGE_SIDE, SPLITS
from lerobot_env_bimanual.perturbations.registry import checked_perturbation
from lerobot_env_bimanual.tasks.registry import get_task

LIMITS = {
    "episodes": (1, 100_000),
    "first_seed": (0, 2**48),
    "discretise": (0, 1000),
    "episodes_per_shard": (1, 10_000),
}
"""Options that are whole numbers, with the least and the most that each may be: a slip of the finger should not fill
memory and disk."""

REPO_ID = re.compile(r"\w[\w. -]*(/\w[\w. -]*)?")


@dataclass(frozen=True)
class GenerationSettings:
    """Options of one dataset, valid by construction.

    Attributes:
        tasks: task names, in the order of the episodes.
        variation: index, or "any" for equal shares of all variations.
        episodes: number of episodes per task.
        split: split of the seeds.
        first_seed: seed of each task's first episode.
        views: views to store.
        cameras: cameras whose images are stored.
        height: image height in pixels.
        width: image width in pixels.
        depth: whether every camera's depth is stored beside its colours.
        intermediate: fractions of each stage's motion at which the view `keyframes` has another row.
        discretise: voxels per axis to which keyposes are rounded before they are executed; 0 leaves them exact.
        episodes_per_shard: episodes per file of the dataset.
        repo_id: LeRobot's name of the dataset.
        perturb: what is different from the world as it is, `AXIS:LEVEL,...`.

    Raises:
        BimanualError: an option is outside its choices; the message lists them.
    """

    tasks: tuple[str, ...]
    variation: str
    episodes: int
    split: str
    first_seed: int
    views: tuple[View, ...]
    cameras: tuple[str, ...]
    height: int
    width: int
    depth: bool
    intermediate: tuple[float, ...]
    discretise: int
    episodes_per_shard: int
    repo_id: str
    perturb: str = ""

    def __post_init__(self) -> None:
        """Refuse what is outside its choices."""
        for option in ("height", "width"):
            pixels = getattr(self, option)
            if type(pixels) is not int or not MIN_IMAGE_SIDE <= pixels <= MAX_IMAGE_SIDE:
                raise InvalidChoice(option, pixels, f"{MIN_IMAGE_SIDE} to {MAX_IMAGE_SIDE} pixels")
        for option, (least, most) in LIMITS.items():
            value = getattr(self, option)
            if type(value) is not int or not least <= value <= most:
                raise InvalidChoice(option, value, f"{least} to {most}")
        if type(self.depth) is not bool:
            raise InvalidChoice("depth", self.depth, ["true", "false"])
        for option in ("tasks", "views", "cameras"):
            _check_names(option, getattr(self, option))
        for task in self.tasks:
            get_task(task).spec.variation_index(self.variation)
        if not isinstance(self.variation, str):
            raise InvalidChoice("variation", self.variation, ["the text 'any'", "an index as text"])
        if self.split not in (splits := tuple(SPLITS)):
            raise InvalidChoice("split", self.split, splits)
        for camera in self.cameras:
            if camera not in CAMERA_NAMES:
                raise UnknownCamera(camera, CAMERA_NAMES)
        if self.views not in (VIEWS, *((view,) for view in VIEWS)):
            raise InvalidChoice("views", self.views, [*VIEWS, "both in this order"])
        if not isinstance(self.intermediate, tuple) or not all(map(_is_fraction, self.intermediate)):
            raise InvalidChoice(
                "intermediate", self.intermediate, "fractions between 0 and 1, such as 0.35,0.7"
            )
        if self.perturb != (canonical := checked_perturbation(self.perturb)):
            raise InvalidChoice("perturb", self.perturb, [canonical])
        if not (isinstance(self.repo_id, str) and REPO_ID.fullmatch(self.repo_id)):
            raise InvalidChoice("repo_id", self.repo_id, "OWNER/NAME of letters, digits, '_', '-' and '.'")

    @classmethod
    def from_dict(cls, options: object) -> Self:
        """Settings as `to_dict` gave them, after a passage through JSON.

        Raises:
            DatasetError: an option is missing or unknown.
            BimanualError: an option is outside its choices, or of another type.
        """
        names = [field.name for field in fields(cls)]
        if not isinstance(options, Mapping):
            raise DatasetError(
                f"settings of a dataset are an object with {', '.join(names)}, not {options!r}"
            )
        if wrong := [*(name for name in names if name not in options), *(options.keys() - set(names))]:
            raise DatasetError(
                f"settings of a dataset have {', '.join(names)}; missing or unknown: {', '.join(map(str, wrong))}"
            )
        values: dict[str, Any] = {
            name: tuple(value) if isinstance(value, list) else value for name, value in options.items()
        }
        return cls(**values)

    def to_dict(self) -> dict[str, Any]:
        """Plain values by option name."""
        return asdict(self)

    def command(self, root: str) -> str:
        """The command line that makes this dataset in the folder `root`, with every option that decides its content.

        It is for people to read: programs make a dataset again from the settings themselves.
        """
        flags = {
            "task": ",".join(self.tasks),
            "variation": self.variation,
            "episodes": self.episodes,
            "split": self.split,
            "first_seed": self.first_seed,
            "view": "both" if self.views == VIEWS else self.views[0],
            "image_size": f"{self.height}x{self.width}",
            "cameras": ",".join(self.cameras),
            "depth": str(self.depth).lower(),
            "intermediate": ",".join(map(str, self.intermediate)),
            "discretise": self.discretise,
            "perturb": self.perturb,
            "episodes_per_shard": self.episodes_per_shard,
            "root": root,
            "repo_id": self.repo_id,
        }
        words = [f"--{name}={value}" for name, value in flags.items() if value != ""]
        return shlex.join(["lerobot-bimanual", "dataset", "generate", *words])

    @property
    def total_episodes(self) -> int:
        """Number of episodes of the whole dataset."""
        return self.episodes * len(self.tasks)

    def variations_of(self, task: str) -> tuple[int, ...]:
        """Variations of a task among which its episodes are divided."""
        if self.variation == ANY_VARIATION:
            return tuple(range(len(get_task(task).spec.variations)))
        return (int(self.variation),)

    def differences(self, other: GenerationSettings) -> list[str]:
        """Each option that differs, as "option is here, there"."""
        mine, theirs = self.to_dict(), other.to_dict()
        return [
            f"{name} is {mine[name]!r}, not {theirs[name]!r}" for name in mine if mine[name] != theirs[name]
        ]


def _check_names(option: str, names: Any) -> None:
    are_texts = isinstance(names, tuple) and all(isinstance(name, str) for name in names)
    if not (are_texts and 0 < len(names) == len(set(names))):
        raise InvalidChoice(option, names, "a list of one or more different names")


def _is_fraction(value: object) -> bool:
    return isinstance(value, float) and 0 < value < 1
