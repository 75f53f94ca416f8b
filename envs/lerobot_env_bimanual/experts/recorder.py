"""Records the expert's episodes.

Images are rendered separately from the physics: while the expert plays, the state and vectors of every tick are
recorded; afterwards, images are rendered from these states, for the requested rows only. So a failed attempt costs no
image, a dataset of keyframes renders a dozen rows instead of hundreds, and an episode with all its images never has to
fit into memory.
"""

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.codec import KeyposeCodec
from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.feature_table import PLAN
from lerobot_bimanual.episode import Demonstration, EpisodeMeta, Step
from lerobot_bimanual.results.expert_report import EpisodeOutcome
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.episode.observations import env_key
from lerobot_env_bimanual.experts.plans import demonstrator
from lerobot_env_bimanual.experts.runner import replanning, run_episode
from lerobot_env_bimanual.options import EnvOptions
from lerobot_env_bimanual.world.scene import SceneState


class Tape:
    """Records an episode while it is played. Its images can be rendered until the environment's next episode.

    Args:
        env: where it is played.
        stage: gives the index of the keypose that is under way.
    """

    def __init__(self, env: BimanualEnv, stage: Callable[[], int]):
        self._env, self._stage = env, stage
        self._ticks: list[tuple[dict[str, NDArray], NDArray[np.float32], int]] = []
        self._states: list[SceneState] = []
        self._hashes: list[str] = []

    def note(self, env: BimanualEnv, joint_action: NDArray[np.float32]) -> None:
        """Note the state before a tick; its hash belongs to the tick before."""
        self._ticks.append((_vectors(env.observe()), joint_action.copy(), self._stage()))
        self._states.append(env.scene.save_state())
        self._hashes.append(env.state_hash())

    def demonstration(self, keyposes: NDArray[np.float32]) -> Demonstration:
        """The episode, which has just ended.

        Args:
            keyposes: (stages, 18), those that were commanded.
        """
        env, states = self._env, [*self._states, self._env.scene.save_state()]
        hashes_after = map(schema.state_hash_column, [*self._hashes[1:], env.state_hash()])
        steps = tuple(Step(*tick, after) for tick, after in zip(self._ticks, hashes_after, strict=True))

        def images(row: int) -> dict[str, NDArray]:
            env.scene.restore_state(states[row])
            seen, images = env.images(), {}
            for camera in env.options.camera_names:
                images[schema.image_key(camera)] = seen["pixels"][camera]
                images[schema.depth_key(camera)] = seen[env_key(schema.depth_key(camera))]
            return images

        split, seed = env.options.split, env.progress.seed
        meta = EpisodeMeta(env.task, env.variation, split, seed, env.task_description)
        return Demonstration(meta, keyposes, steps, _vectors(env.observe()), images)


class Recorder:
    """Plays the experts of tasks and records what happens; keeps the last world, most likely that of the next episode."""

    def __init__(self):
        self._env: BimanualEnv | None = None

    def record(
        self,
        task: str,
        options: EnvOptions,
        seed: int,
        variation: int,
        voxels: int = 0,
        plan: int | None = None,
    ) -> tuple[EpisodeOutcome, Demonstration | None]:
        """Play one episode.

        Args:
            task: registered task name.
            options: of its environment, which observes no images by itself and takes keyposes; see `recording_options`.
            seed: seed of the reset.
            variation: index of the task's variation.
            voxels: voxels per axis to which keyposes are rounded before they are executed; 0 leaves them exact.
            plan: number of the plan to follow; all plans of the task must then be feasible, and the episode stores it.

        Returns:
            The outcome, and the episode if it succeeded. The episode's images can be rendered until the
            next call.

        Raises:
            InvalidChoice: the task has no such plan.
            PlacementFailure: the seed has no placement of the props that both arms can serve, or not with all plans.
        """
        if self._env is None or (self._env.task, self._env.options) != (task, options):
            if self._env is not None:
                self._env.close()
            self._env = BimanualEnv(task, options=options)
        env = self._env
        keyposes: list[NDArray[np.float32]] = []
        tape = Tape(env, lambda: len(keyposes) - 1)
        with env.observed_by(tape.note):
            codec = KeyposeCodec(voxels=voxels) if voxels else None
            player = replanning(codec) if plan is None else partial(demonstrator, plan=plan, codec=codec)
            outcome = run_episode(env, seed, player, lambda move: keyposes.append(move.action), variation)
        if not outcome.success:
            return outcome, None
        further = {} if plan is None else {PLAN: np.array([plan])}
        return outcome, replace(tape.demonstration(np.array(keyposes)), further=further)


def recording_options(
    split: str, cameras: Iterable[str], image_size: tuple[int, int], perturb: str, setting: str
) -> EnvOptions:
    """Options of an environment in which episodes are recorded; the size of images is height and width in pixels."""
    return EnvOptions(
        split=split,
        cameras=",".join(cameras),
        image_size="{}x{}".format(*image_size),
        obs="state",
        control_mode="keypose",
        perturb=perturb,
        setting=setting,
    )


def _vectors(observation: dict[str, Any]) -> dict[str, NDArray]:
    """Dataset keys of an observation without images."""
    return {key: observation[env_key(key)] for key in schema.VECTORS if env_key(key) in observation}
