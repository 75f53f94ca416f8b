"""The compiled worlds of one environment: one per set of props, made when an episode first has it."""

from __future__ import annotations

from dataclasses import dataclass

from lerobot_env_bimanual.episode.arm_limits import ProtectiveStop, max_force_n
from lerobot_env_bimanual.episode.observations import ObservationRenderer
from lerobot_env_bimanual.episode.reset import EpisodeReset
from lerobot_env_bimanual.motion.planner import KeyposePlanner
from lerobot_env_bimanual.options import EnvOptions
from lerobot_env_bimanual.perturbations.perturbations import Perturbations
from lerobot_env_bimanual.task import Task
from lerobot_env_bimanual.world.scene import Scene


@dataclass(frozen=True, eq=False)
class World:
    """A scene with what plans, resets, draws and, with the option `protective_stop`, ends episodes in it."""

    scene: Scene
    planner: KeyposePlanner
    reset: EpisodeReset
    renderer: ObservationRenderer
    stop: ProtectiveStop | None


class Worlds:
    """The worlds by index of their set of props.

    Args:
        task: whose things they hold.
        options: of the environment.
        changes: differences from the nominal world.
    """

    def __init__(self, task: Task, options: EnvOptions, changes: Perturbations):
        self._task, self._options, self._changes = task, options, changes
        self._compiled: dict[int, World] = {}

    def __getitem__(self, prop_set: int) -> World:
        """That of a set of props; compiled if it is not there yet.

        Raises:
            InvalidChoice: an axis of perturbation finds nothing to change in the task.
        """
        if prop_set not in self._compiled:
            changes, setting = self._changes, self._options.setting
            props = self._task.spec.prop_sets(setting)[prop_set]
            scene = Scene(props, patch=changes.build, setting=setting, prop_set=prop_set)
            self._compiled[prop_set] = World(
                scene,
                KeyposePlanner(scene),
                EpisodeReset(self._task, scene, changes.begin, changes.changes_model),
                ObservationRenderer(scene, self._options, changes.see),
                ProtectiveStop(scene, max_force_n(self._task.spec))
                if self._options.protective_stop
                else None,
            )
        return self._compiled[prop_set]

    def close(self) -> None:
        """Free all worlds; they can be had again."""
        for world in self._compiled.values():
            world.renderer.close()
        self._compiled.clear()
