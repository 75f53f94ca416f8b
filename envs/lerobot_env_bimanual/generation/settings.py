"""What decides the content of a dataset: equal settings and versions give equal datasets."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, Self

from lerobot_bimanual.dataset.schema import VIEWS, View
from lerobot_bimanual.errors import InvalidChoice
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.options import ANY_VARIATION, EnvOptions
from lerobot_env_bimanual.tasks.registry import get_task, resolve_tasks

if TYPE_CHECKING:
    from lerobot_env_bimanual.commands.generate import GenerateConfig

BOTH_VIEWS = "both"


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
        intermediate: fractions of each stage's motion at which the view `keyframes` has another row.
        discretise: voxels per axis to which keyposes are rounded before they are executed; 0 leaves them exact.
        episodes_per_shard: episodes per file of the dataset.
        repo_id: LeRobot's name of the dataset.
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
    intermediate: tuple[float, ...]
    discretise: int
    episodes_per_shard: int
    repo_id: str

    @classmethod
    def parse(cls, config: GenerateConfig) -> Self:
        """Read and check the options of the command line.

        Raises:
            BimanualError: an option is outside its choices; the message lists them.
        """
        tasks = resolve_tasks(config.task)
        camera_settings = [_environment_settings(task, config) for task in tasks].pop()
        for option, least in (
            ("episodes", 1),
            ("episodes_per_shard", 1),
            ("first_seed", 0),
            ("discretise", 0),
        ):
            if getattr(config, option) < least:
                raise InvalidChoice(option, getattr(config, option), [f"an integer of at least {least}"])
        if config.view not in (*VIEWS, BOTH_VIEWS):
            raise InvalidChoice("view", config.view, (*VIEWS, BOTH_VIEWS))
        return cls(
            tasks=tasks,
            variation=config.variation,
            episodes=config.episodes,
            split=config.split,
            first_seed=config.first_seed,
            views=tuple(view for view in VIEWS if config.view in (view, BOTH_VIEWS)),
            cameras=camera_settings.camera_names,
            height=camera_settings.height,
            width=camera_settings.width,
            intermediate=tuple(map(_parse_fraction, config.intermediate)),
            discretise=config.discretise,
            episodes_per_shard=config.episodes_per_shard,
            repo_id=config.repo_id or f"local/{config.root.name}",
        )

    @classmethod
    def from_dict(cls, options: Mapping[str, Any]) -> Self:
        """Settings as `to_dict` gave them, after a passage through JSON."""
        values: dict[str, Any] = {
            name: tuple(value) if isinstance(value, list) else value for name, value in options.items()
        }
        return cls(**values)

    def to_dict(self) -> dict[str, Any]:
        """Plain values by option name."""
        return asdict(self)

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


def _environment_settings(task: str, config: GenerateConfig) -> EnvOptions:
    """Options of a task's environment, checked by the environment itself."""
    return BimanualEnv(
        task,
        variation=config.variation,
        split=config.split,
        cameras=config.cameras,
        image_size=config.image_size,
    ).options


def _parse_fraction(text: str) -> float:
    try:
        fraction = float(text)
    except ValueError:
        fraction = 0.0
    if not 0.0 < fraction < 1.0:
        raise InvalidChoice("intermediate", text, ["fractions between 0 and 1, such as 0.35,0.7"])
    return fraction
