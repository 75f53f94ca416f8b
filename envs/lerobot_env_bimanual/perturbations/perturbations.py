"""The chosen axes at their levels, and the streams of randomness from which they draw."""

import zlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.errors import InvalidChoice
from lerobot_bimanual.perturbation_levels import parse_levels
from lerobot_env_bimanual.episode.progress import EpisodeProgress
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.options import SPLITS
from lerobot_env_bimanual.perturbations.axis import Action, Axis, HookContext, Image, Start
from lerobot_env_bimanual.registry import AXES
from lerobot_env_bimanual.task import Task, TaskSpec
from lerobot_env_bimanual.world.appearance import NOMINAL
from lerobot_env_bimanual.world.scene import Scene


class Perturbations:
    """All differences between the episodes of one environment and nominal ones.

    Every draw comes from a stream of its own, given by axis, hook, split, task and seed: neither another axis nor a level
    nor earlier episodes change it, and the episode's own generator is not used.

    Attributes:
        magnitudes: of each chosen axis, by its name.
        changes_model: whether the world is compiled differently.
        late_ticks: ticks for which the last action of a keypose's motion is repeated.

    Raises:
        BimanualError: an axis does not exist, or cannot be loaded.
    """

    def __init__(self, perturb: str, task: TaskSpec, split: str, cameras: Sequence[str]):
        self._task, self._split, self._cameras = task, split, cameras
        levels: dict[Axis[Any], int] = {
            AXES.get(name): level for name, level in parse_levels(perturb).items()
        }
        magnitudes = {axis: axis.levels[level - 1] for axis, level in levels.items()}
        self.magnitudes = {axis.name: magnitude for axis, magnitude in magnitudes.items()}
        # Bodies first: other axes find out whether the task can be done in the scene that these leave.
        self._magnitudes = dict(sorted(magnitudes.items(), key=lambda each: each[0].group != "bodies"))
        self.changes_model = any(axis.build for axis in self._magnitudes)
        self.late_ticks = max((axis.late_ticks(each) for axis, each in self._magnitudes.items()), default=0)

    def build(self, model: mujoco.MjSpec) -> None:
        """Change a world before it is compiled.

        Raises:
            InvalidChoice: an axis finds nothing to change in the task.
        """
        for axis in self._magnitudes:
            if not axis.applies_to(self._task, model):
                others = [name for name, other in AXES.all().items() if other.applies_to(self._task, model)]
                raise InvalidChoice(f"an axis of perturb for {self._task.name!r}", axis.name, others)
        for axis, magnitude in self._magnitudes.items():
            if axis.build:
                axis.build(model, magnitude)

    def begin(
        self, task: Task, scene: Scene, progress: EpisodeProgress, is_feasible: Callable[[], bool]
    ) -> None:
        """Change the start of an episode whose props have been placed and have not come to rest, and its appearance.

        Args:
            task: the task.
            scene: its scene.
            progress: the episode, which can be done as it is.
            is_feasible: whether both arms can do the task in the present scene, by a rehearsal of the script.
        """

        def start(axis: Axis[Any], hook: str) -> Start[Any]:
            context = self._context(axis, hook, scene, progress)
            return Start(**vars(context), task=task, cameras=self._cameras, is_feasible=is_feasible)

        for axis in self._magnitudes:
            if axis.begin:
                axis.begin(start(axis, "begin"))
        appearance = NOMINAL
        for axis in self._magnitudes:
            if axis.look:
                appearance = axis.look(start(axis, "look"), appearance)
        scene.appearance = appearance

    def see(self, images: Mapping[str, Image], scene: Scene, progress: EpisodeProgress) -> dict[str, Image]:
        """The images that cameras hand out, given what they see now."""
        handed_out = dict(images)
        for axis in self._magnitudes:
            if axis.see:
                for camera in images:
                    when = scene.ticks, CAMERA_NAMES.index(camera)
                    context = self._context(axis, "see", scene, progress, *when)
                    handed_out[camera] = axis.see(context, camera, handed_out[camera])
        return handed_out

    def command(self, action: Action, scene: Scene, progress: EpisodeProgress) -> Action:
        """The joint action (16,) that the arms are given."""
        for axis in self._magnitudes:
            if axis.command:
                action = axis.command(self._context(axis, "command", scene, progress, progress.ticks), action)
        return action

    def disturb(self, scene: Scene, progress: EpisodeProgress) -> None:
        """Change the world after a tick, before the next observation."""
        for axis in self._magnitudes:
            if axis.disturb:
                axis.disturb(self._context(axis, "disturb", scene, progress))

    def _context(
        self, axis: Axis[Any], hook: str, scene: Scene, progress: EpisodeProgress, *when: int
    ) -> HookContext[Any]:
        entropy = [SPLITS[self._split], self._task.id, progress.seed, *when]
        stream = zlib.crc32(f"{axis.name} {hook}".encode())
        rng = np.random.default_rng(np.random.SeedSequence(entropy, spawn_key=(stream,)))
        return HookContext(axis, self._magnitudes[axis], rng, scene, progress)
