"""Records the expert's episodes.

Physics and images are apart: while the expert plays, every tick's state and vectors are noted; images are rendered
afterwards from the noted states, of the rows that are requested. So a failed attempt costs no image, a dataset
of keyframes renders a dozen rows instead of hundreds, and an episode with all its images never has to fit into
memory.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.codec import KeyposeCodec
from lerobot_bimanual.dataset import schema
from lerobot_bimanual.episode import Demonstration, EpisodeMeta, Step
from lerobot_bimanual.results.expert_report import EpisodeOutcome
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.episode.observations import env_key
from lerobot_env_bimanual.experts.runner import Move, expert_of, run_episode
from lerobot_env_bimanual.world.scene import SceneState


class Recorder:
    """Plays a task's expert and records what happens.

    Args:
        task: registered task name.
        split: "train", "val" or "test".
        cameras: cameras of the images.
        image_size: (height, width) in pixels.
        codec: round every keypose to its voxels and bins before it is executed and recorded.
        perturb: perturbations, `AXIS:LEVEL,...`.
    """

    def __init__(
        self,
        task: str,
        split: str,
        cameras: tuple[str, ...],
        image_size: tuple[int, int],
        codec: KeyposeCodec | None = None,
        perturb: str = "",
    ):
        self._env = BimanualEnv(
            task,
            split=split,
            cameras=cameras,
            image_size=image_size,
            obs="state",
            control_mode="keypose",
            perturb=perturb,
        )
        self._codec = codec

    def record(self, seed: int, variation: int) -> tuple[EpisodeOutcome, Demonstration | None]:
        """Play one episode.

        Args:
            seed: seed of the reset.
            variation: index of the task's variation.

        Returns:
            What became of it, and the episode if it succeeded. The episode's images can be asked for until the
            next call.

        Raises:
            PlacementFailure: the seed has no placement of the props that both arms can serve.
        """
        tape = _Tape()
        with self._env.observed_by(tape.note_tick):
            player = expert_of(self._env, self._codec)
            outcome = run_episode(self._env, seed, player, tape.start_stage, variation)
        if not outcome.success:
            return outcome, None
        tape.states.append(self._env.scene.save_state())
        tape.hashes.append(outcome.state_hash)
        meta = EpisodeMeta(
            self._env.task, variation, self._env.options.split, seed, self._env.task_description
        )
        return outcome, tape.episode(meta, _vectors(self._env.observe()), self._render)

    def close(self) -> None:
        """Free the simulation and the renderer."""
        self._env.close()

    def _render(self, state: SceneState) -> dict[str, NDArray]:
        self._env.scene.restore_state(state)
        return _camera_images(self._env.images(), self._env.options.camera_names)


class _Tape:
    """What is noted while an episode is played."""

    def __init__(self):
        self.keyposes: list[NDArray[np.float32]] = []
        self.observations: list[dict[str, NDArray]] = []
        self.actions: list[NDArray[np.float32]] = []
        self.stages: list[int] = []
        self.states: list[SceneState] = []
        self.hashes: list[str] = []

    def start_stage(self, move: Move) -> None:
        self.keyposes.append(move.action)

    def note_tick(self, env: BimanualEnv, joint_action: NDArray[np.float32]) -> None:
        """Note the state before a tick; its hash belongs to the tick before."""
        self.observations.append(_vectors(env.observe()))
        self.actions.append(joint_action.copy())
        self.stages.append(len(self.keyposes) - 1)
        self.states.append(env.scene.save_state())
        self.hashes.append(env.state_hash())

    def episode(self, meta: EpisodeMeta, final_observation: dict[str, NDArray], render: Any) -> Demonstration:
        hashes_after = self.hashes[1:]
        steps = tuple(
            Step(observation, action, stage, schema.state_hash_column(state_hash))
            for observation, action, stage, state_hash in zip(
                self.observations, self.actions, self.stages, hashes_after, strict=True
            )
        )
        states = self.states
        return Demonstration(
            meta, np.array(self.keyposes), steps, final_observation, lambda row: render(states[row])
        )


def _vectors(observation: dict[str, Any]) -> dict[str, NDArray]:
    """Dataset keys of an observation without images."""
    return {key: observation[env_key(key)] for key in schema.VECTORS if env_key(key) in observation}


def _camera_images(observation: dict[str, Any], cameras: tuple[str, ...]) -> dict[str, NDArray]:
    """Dataset keys of an observation's images."""
    images = {}
    for camera in cameras:
        images[schema.image_key(camera)] = observation["pixels"][camera]
        images[schema.depth_key(camera)] = observation[env_key(schema.depth_key(camera))]
    return images
