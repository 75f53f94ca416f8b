"""What an axis of perturbation is: a row of data, and one or two hooks by which it changes an episode."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from lerobot_env_bimanual.episode.progress import EpisodeProgress
from lerobot_env_bimanual.episode.reset import EpisodeStart
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.task import TaskSpec
from lerobot_env_bimanual.world.appearance import Appearance
from lerobot_env_bimanual.world.scene import Scene

type Image = tuple[NDArray[np.uint8], NDArray[np.float32]]
"""RGB (height, width, 3) and depth (height, width) in metres along the optical axis; 0 where none was measured."""


class Group(StrEnum):
    """What kind of difference an axis makes."""

    SEEN = "seen"
    CLUTTER = "clutter"
    BODIES = "bodies"
    ARMS = "arms"
    WORDS = "words"
    TIME = "time"


class Axis:
    """One dial: everything but it stays what it was, and so do placement, variation and instruction of every seed.

    An axis overrides the hooks of what it changes. Each is given the level's magnitude and a generator of the axis's own,
    the same at every level, so that a higher level is more of the same.

    Attributes:
        name: snake_case, also the module's name.
        group: what kind of difference it makes.
        levels: magnitudes of the levels 1, 2 and 3.
        unit: of the magnitudes.
        summary: what is done, in a sentence.
        source: where the magnitudes come from.
    """

    name: ClassVar[str]
    group: ClassVar[Group]
    levels: ClassVar[tuple[float, float, float]]
    unit: ClassVar[str]
    summary: ClassVar[str]
    source: ClassVar[str]

    @property
    def touches(self) -> tuple[str, ...]:
        """Names of the hooks that it overrides."""
        return tuple(name for name in HOOKS if getattr(type(self), name) is not getattr(Axis, name))

    @property
    def is_seen_only(self) -> bool:
        """Whether it changes nothing but what is seen and said, and so no state."""
        return self.group in (Group.SEEN, Group.WORDS)

    @property
    def moves_things_later(self) -> bool:
        """Whether things may be moved while an episode runs, so that who does not look again is led astray."""
        return "disturb" in self.touches

    def applies_to(self, task: TaskSpec, model: mujoco.MjSpec) -> bool:
        """Whether a task has what is changed here.

        Args:
            task: as data.
            model: its world, which is not compiled yet.
        """
        return True

    def build(self, model: mujoco.MjSpec, magnitude: float) -> None:
        """Change the world before it is compiled."""

    def begin(self, start: EpisodeStart, magnitude: float, rng: np.random.Generator) -> None:
        """Change the start of an episode, by the scene's methods or in its progress."""

    def look(
        self, start: EpisodeStart, appearance: Appearance, magnitude: float, rng: np.random.Generator
    ) -> Appearance:
        """How an episode looks.

        Args:
            start: of the episode; to be read only.
            appearance: that of the axes before.
            magnitude: of the level.
            rng: of the axis and the episode.
        """
        return appearance

    def see(
        self,
        camera: str,
        image: Image,
        progress: EpisodeProgress,
        magnitude: float,
        rng: np.random.Generator,
    ) -> Image:
        """What a camera hands out of what it sees.

        Args:
            camera: its name.
            image: may be changed in place.
            progress: the episode; `memory` keeps what `begin` has drawn for it.
            magnitude: of the level.
            rng: of the axis, the episode, the tick and the camera.
        """
        return image

    def command(
        self,
        action: NDArray[np.float32],
        progress: EpisodeProgress,
        magnitude: float,
        rng: np.random.Generator,
    ) -> NDArray[np.float32]:
        """What the arms are told of a joint action (16,).

        Args:
            action: as it was meant; not to be changed in place.
            progress: the episode; `memory` keeps what the axis has to remember.
            magnitude: of the level.
            rng: of the axis, the episode and the tick.
        """
        return action

    def late_ticks(self, magnitude: float) -> int:
        """Ticks by which a command of a keypose's motion arrives later than meant; the motion's end is waited for."""
        return 0

    def disturb(
        self, scene: Scene, progress: EpisodeProgress, magnitude: float, rng: np.random.Generator
    ) -> None:
        """Change the world after a tick, before anybody looks again.

        Keyposes and the joint actions that execute them so meet the same changes.

        Args:
            scene: the world.
            progress: the episode; `memory` keeps what the axis has to remember.
            magnitude: of the level.
            rng: of the axis and the episode, the same at every call.
        """


HOOKS: Mapping[str, str] = {
    "build": "model at compile",
    "begin": "start of the episode",
    "look": "appearance",
    "see": "observation",
    "command": "command",
    "disturb": "between ticks",
}
"""Name of each hook, and what it touches."""
