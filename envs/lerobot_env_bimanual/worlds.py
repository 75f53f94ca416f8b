"""The compiled worlds of one environment, one per set of props, and how episodes begin and are stopped in them."""

from collections import Counter
from dataclasses import dataclass

import numpy as np

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.codec import KeyposeCodec
from lerobot_bimanual.errors import BimanualError, PlacementFailure
from lerobot_env_bimanual.episode.observations import ObservationRenderer
from lerobot_env_bimanual.episode.progress import EpisodeProgress
from lerobot_env_bimanual.episode.rehearsal import Rehearsal
from lerobot_env_bimanual.motion.planner import KeyposePlanner
from lerobot_env_bimanual.options import EnvOptions
from lerobot_env_bimanual.perturbations.perturbations import Perturbations
from lerobot_env_bimanual.task import Task, TaskSpec
from lerobot_env_bimanual.world.arena import PHYSICS_STEP_S
from lerobot_env_bimanual.world.contact_forces import ContactForces, low_pass_filter
from lerobot_env_bimanual.world.scene import Scene
from lerobot_env_bimanual.world.scene_view import SceneView
from lerobot_env_bimanual.world.servo_commands import STEPS_PER_TICK

MAX_DRAWS = 200
CODECS = (None, KeyposeCodec())
PROTECTIVE_STOP = "protective stop"
"""Prefix of the failure of an episode that ended by a protective stop."""
MAX_FORCE_N = 100.0
"""Force with which an arm may press, unless the task has a bound of its own."""
MAX_PRESS_S = 0.1
"""Time for which an arm may press harder."""


class EpisodeReset:
    """Starts episodes of one task in one scene, and perturbs them.

    If the changes patch the model of `scene`, placements are drawn in a scene that is not patched.
    """

    def __init__(self, task: Task, scene: Scene, changes: Perturbations):
        self._task, self._scene, self._changes = task, scene, changes
        is_patched = changes.changes_model
        self._rehearsal = Rehearsal(scene, CODECS)
        self._placement_scene = Scene(scene.props, setting=scene.setting) if is_patched else scene
        self._first_rehearsal = Rehearsal(self._placement_scene, CODECS) if is_patched else self._rehearsal

    def start(self, progress: EpisodeProgress) -> int:
        """Reset the scene, place the props where the script can be rehearsed, and let them settle.

        A placement counts only if the rehearsal succeeds with the exact keyposes and with those rounded to
        the voxels and bins of keypose policies, so that every episode is solvable by such a policy. Returns the number of
        placements drawn.

        Raises:
            PlacementFailure: `MAX_DRAWS` draws in vain; the message counts the reasons.
        """
        script = self._task.script_for_plan(progress.variation)
        reasons: Counter[str] = Counter()
        for draw in range(1, MAX_DRAWS + 1):
            self._placement_scene.reset()
            reason = "illegal placement"
            placed = self._task.place(self._placement_scene, progress.variation, progress.rng)
            if placed is None:
                raise BimanualError(
                    f"`place` of {self._task.spec.name} returned None, but must return True, or False to draw anew"
                )
            if placed:
                reason = self._first_rehearsal.infeasibility(script)
            if reason is None:
                if self._placement_scene is not self._scene:
                    self._scene.reset()
                    self._scene.place_like(self._placement_scene)
                self._changes.begin(
                    self._task, self._scene, progress, lambda: self._rehearsal.infeasibility(script) is None
                )
                self._scene.settle()
                return draw
            reasons[reason] += 1
        frequent = ", ".join(f"{count}x {reason}" for reason, count in reasons.most_common(3))
        raise PlacementFailure(
            f"{self._task.spec.name}: none of {MAX_DRAWS} drawn placements can be rehearsed by both arms "
            f"({frequent})"
        )


class ProtectiveStop:
    """Ends an episode as a failure when an arm presses too hard for too long.

    A Panda stops with a reflex when the outside force that it estimates passes the thresholds that its user has set
    (`setCollisionBehavior` of libfranka, "upper thresholds"); where contact is meant, libfranka's examples of impedance and
    force control set 100 N. A task may have a bound of its own.
    """

    def __init__(self, task: TaskSpec, scene: SceneView):
        self._forces = ContactForces(scene)
        self._max_force_n = task.load_bounds.get("contact_force_n", MAX_FORCE_N)
        self.note_step = self._forces.note

    def judge(self, progress: EpisodeProgress) -> None:
        """Fail the episode if an arm has pressed too hard for too long, up to this tick."""
        forces_n, _, _ = self._forces.take()
        # Only the steps of this tick: those of a tick that was interrupted may come before.
        filtered_forces_n = low_pass_filter(forces_n[-STEPS_PER_TICK:], progress.filtered_forces_n)
        progress.filtered_forces_n = filtered_forces_n[-1]
        for pressed_n in np.linalg.norm(filtered_forces_n, axis=-1):
            progress.overload_steps = (progress.overload_steps + 1) * (pressed_n > self._max_force_n)
            if progress.overload_steps.max() * PHYSICS_STEP_S >= MAX_PRESS_S:
                arm = ARMS[int(progress.overload_steps.argmax())]
                force_n = pressed_n[arm.ordinal]
                progress.failure = f"{PROTECTIVE_STOP}: the {arm} arm pressed with {force_n:.0f} N"
                return


@dataclass(frozen=True, eq=False)
class World:
    """A scene with its planner, its reset, its renderer and, with the option `protective_stop`, its protective stop."""

    scene: Scene
    planner: KeyposePlanner
    reset: EpisodeReset
    renderer: ObservationRenderer
    stop: ProtectiveStop | None


class Worlds:
    """The worlds of a task by index of their set of props."""

    def __init__(self, task: Task, options: EnvOptions, changes: Perturbations):
        self._task, self._options, self._changes = task, options, changes
        self._compiled: dict[int, World] = {}

    def __getitem__(self, prop_set: int) -> World:
        """The world of a set of props; compiled at its first use."""
        if prop_set not in self._compiled:
            changes, setting = self._changes, self._options.setting
            props = self._task.spec.prop_sets(setting)[prop_set]
            scene = Scene(props, patch=changes.build, setting=setting, prop_set=prop_set)
            self._compiled[prop_set] = World(
                scene,
                KeyposePlanner(scene),
                EpisodeReset(self._task, scene, changes),
                ObservationRenderer(scene, self._options, changes.see),
                ProtectiveStop(self._task.spec, scene) if self._options.protective_stop else None,
            )
        return self._compiled[prop_set]

    def close(self) -> None:
        """Free all worlds; they can be had again."""
        for world in self._compiled.values():
            world.renderer.close()
        self._compiled.clear()
