"""The chosen axes at their levels, and the streams of randomness from which they draw."""

from __future__ import annotations

import zlib
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.errors import InvalidChoice
from lerobot_env_bimanual.episode.progress import EpisodeProgress
from lerobot_env_bimanual.episode.reset import EpisodeStart
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.options import SPLITS
from lerobot_env_bimanual.perturbations.axis import Axis, Image
from lerobot_env_bimanual.perturbations.registry import get_axis, list_axes
from lerobot_env_bimanual.task import TaskSpec
from lerobot_env_bimanual.world.appearance import AS_IT_IS
from lerobot_env_bimanual.world.scene import Scene

type Dial = tuple[Axis, float]
"""An axis and the magnitude of its level."""


class Perturbations:
    """What makes the episodes of one environment different from those of the world as it is.

    Every draw comes from a stream of its own, given by axis, split, task and seed: neither another axis nor a level nor
    whatever was played before changes it, and the episode's own generator is not touched.

    Args:
        levels: axis -> level; may be empty.
        task: whose episodes they are.
        split: of their seeds.

    Attributes:
        amends: whether the world is compiled otherwise than the task has it.

    Raises:
        BimanualError: an axis that is not there, or cannot be loaded.
    """

    def __init__(self, levels: Mapping[str, int], task: TaskSpec, split: str):
        self._task, self._split = task, split
        axes = {name: get_axis(name) for name in sorted(levels)}
        self._dials = [(axis, axis.levels[levels[name] - 1]) for name, axis in axes.items() if levels[name]]
        self._seeing, self._commanding, self._disturbing = map(self._with, ("see", "command", "disturb"))
        self.amends = bool(self._with("build"))

    @property
    def magnitudes(self) -> dict[str, float]:
        """Magnitude of each chosen axis."""
        return {axis.name: magnitude for axis, magnitude in self._dials}

    @property
    def late_ticks(self) -> int:
        """Ticks for which the end of a motion is waited for."""
        return max((axis.late_ticks(magnitude) for axis, magnitude in self._dials), default=0)

    def build(self, model: mujoco.MjSpec) -> None:
        """Change a world before it is compiled.

        Raises:
            InvalidChoice: an axis finds nothing to change in the task.
        """
        for axis, _ in self._dials:
            if not axis.applies_to(self._task, model):
                others = [name for name in list_axes() if get_axis(name).applies_to(self._task, model)]
                raise InvalidChoice(f"an axis of perturb for {self._task.name!r}", axis.name, others)
        for axis, magnitude in self._dials:
            axis.build(model, magnitude)

    def begin(self, start: EpisodeStart) -> None:
        """Change the start of an episode whose props have been placed, and how it looks."""
        scene, seed = start.scene, start.progress.seed
        for axis, magnitude in self._dials:
            axis.begin(start, magnitude, self._rng(axis, "begin", seed))
        appearance = AS_IT_IS
        for axis, magnitude in self._dials:
            appearance = axis.look(start, appearance, magnitude, self._rng(axis, "look", seed))
        scene.appearance = appearance

    def see(self, images: Mapping[str, Image], progress: EpisodeProgress, tick: int) -> dict[str, Image]:
        """What cameras hand out of what they see.

        Args:
            images: camera -> what it sees.
            progress: the episode.
            tick: at which they see it.
        """
        handed_out = dict(images)
        for axis, magnitude in self._seeing:
            for camera in images:
                rng = self._rng(axis, "see", progress.seed, tick, CAMERA_NAMES.index(camera))
                handed_out[camera] = axis.see(camera, handed_out[camera], progress, magnitude, rng)
        return handed_out

    def command(self, action: NDArray[np.float32], progress: EpisodeProgress) -> NDArray[np.float32]:
        """What the arms are told of a joint action (16,)."""
        for axis, magnitude in self._commanding:
            rng = self._rng(axis, "command", progress.seed, progress.ticks)
            action = axis.command(action, progress, magnitude, rng)
        return action

    def disturb(self, scene: Scene, progress: EpisodeProgress) -> None:
        """Change the world after a tick, before it is looked at again."""
        for axis, magnitude in self._disturbing:
            axis.disturb(scene, progress, magnitude, self._rng(axis, "disturb", progress.seed))

    def _with(self, hook: str) -> list[Dial]:
        return [dial for dial in self._dials if hook in dial[0].touches]

    def _rng(self, axis: Axis, hook: str, *moment: int) -> np.random.Generator:
        stream = zlib.crc32(f"{axis.name} {hook}".encode())
        return np.random.default_rng(
            np.random.SeedSequence([SPLITS[self._split], self._task.id, *moment], spawn_key=(stream,))
        )
