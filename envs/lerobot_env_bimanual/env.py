"""The Gymnasium environment: one task, one world, two kinds of action."""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import ArrayLike, NDArray

from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.episode import CONTROL_HZ
from lerobot_bimanual.errors import InvalidChoice, KeyposeFailure
from lerobot_bimanual.keypose import BimanualKeypose
from lerobot_env_bimanual.episode.actions import ActionReader
from lerobot_env_bimanual.episode.observations import observation_space, observe_images, observe_vectors
from lerobot_env_bimanual.motion.planner import KeyposePlanner
from lerobot_env_bimanual.options import MAX_KEYPOSES, SPLITS, EnvOptions
from lerobot_env_bimanual.robots.panda_pair import PANDA_PAIR
from lerobot_env_bimanual.task import Variation
from lerobot_env_bimanual.tasks.registry import get_task
from lerobot_env_bimanual.world.rendering import Renderer, calibration
from lerobot_env_bimanual.world.scene import Scene
from lerobot_env_bimanual.world.video import VideoWriter

SUCCESS_TICKS = 10
"""Consecutive control ticks, half a second, that all conditions have to hold."""

SIMULATION_UNSTABLE = "simulation_unstable"
RENDER_CAMERA = "front"
RENDER_SIZE = (480, 640)


@dataclass
class EpisodeProgress:
    """What an episode remembers besides the state of its scene."""

    seed: int
    variation: Variation
    instruction: str
    rng: np.random.Generator
    conditions: dict[str, bool]
    ticks: int = 0
    keyposes: int = 0
    held_ticks: int = 0
    line_fallbacks: int = 0
    failure: str = ""

    @property
    def succeeded(self) -> bool:
        """Whether the conditions held long enough."""
        return self.held_ticks >= SUCCESS_TICKS and not self.failure

    @property
    def terminated(self) -> bool:
        """Whether the verdict is known."""
        return self.succeeded or bool(self.failure)


class BimanualEnv(gym.Env):
    """A bimanual manipulation task with two Franka arms.

    An action of 16 numbers is one control tick of 50 ms towards absolute joint targets (per arm, left first,
    seven joints in rad and the gripper from 0 closed to 1 open). An action of 18 numbers is a keypose (per arm
    position in m, quaternion wxyz, gripper_open, ignore_collisions) which is planned and executed to its end
    within one step. `lerobot_env_bimanual.episode.actions` says what happens to bad actions.

    The reward is 1 at success and 0 before. `info` holds, after reset and every step, `is_success`, `conditions`
    (name -> met now), `failure` (empty while there is none), `ticks` and `line_fallbacks` (straight lines
    replaced by joint-space motions because an arm could not follow them).

    An episode is determined by task, split, seed and variation, bit for bit. Building the environment is cheap:
    the world is compiled at the first reset, OpenGL starts at the first image, and both come back after `close`.

    Args:
        task: registered task name.
        variation: index, or "any" to draw one per episode.
        split: "train", "val" or "test"; the same seed means different episodes in each.
        cameras: cameras of the observation.
        image_size: side in pixels, or (height, width).
        obs: "rgbd", "rgb" (no depth) or "state" (no images).
        control_mode: "joint" and "keypose" take one kind of action and are strict; "auto" declares joint actions
            and takes both.
        video_dir: if set, every episode's motion is filmed to a file there.
        max_keyposes: keyposes until an episode is truncated.
        render_quality: of `render` and of films, "observation" or "high". On one CPU core a frame costs 25 ms or
            300 ms, so "high", with shadows and anti-aliasing, is for pictures of a few episodes.
        render_mode: only "rgb_array".

    Raises:
        BimanualError: an option is outside its choices; the message lists them.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": CONTROL_HZ}  # noqa: RUF012  (Gymnasium's attribute)

    def __init__(
        self,
        task: str,
        variation: int | str = "any",
        split: str = "test",
        cameras: str | Sequence[str] = CAMERA_NAMES,
        image_size: int | str | Sequence[int] = 256,
        obs: str = "rgbd",
        control_mode: str = "auto",
        video_dir: str | Path | None = None,
        max_keyposes: int = MAX_KEYPOSES,
        render_quality: str = "observation",
        render_mode: str | None = "rgb_array",
    ):
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise InvalidChoice("render_mode", render_mode, self.metadata["render_modes"])
        self.task_definition = get_task(task)
        spec = self.task_definition.spec
        self.settings = EnvOptions.parse(
            spec,
            variation=variation,
            split=split,
            cameras=cameras,
            image_size=image_size,
            obs=obs,
            control_mode=control_mode,
            video_dir=video_dir,
            max_keyposes=max_keyposes,
            render_quality=render_quality,
        )
        self.render_mode = render_mode
        self.task = spec.name
        self.tick_listener: Callable[[BimanualEnv, NDArray[np.float32]], None] | None = None
        self._actions = ActionReader(self.settings.control_mode, PANDA_PAIR)
        self.action_space = self._actions.space
        self.observation_space = observation_space(self.settings)
        self._scene: Scene | None = None
        self._planner: KeyposePlanner | None = None
        self._observer: Renderer | None = None
        self._frame_renderer: Renderer | None = None
        self._progress: EpisodeProgress | None = None
        self._video: VideoWriter | None = None

    @property
    def scene(self) -> Scene:
        """The world; compiled on first use."""
        if self._scene is None:
            self._scene = Scene(self.task_definition.spec.props)
            self._planner = KeyposePlanner(self._scene)
        return self._scene

    @property
    def progress(self) -> EpisodeProgress:
        """The running or finished episode.

        Raises:
            ResetNeeded: there is none yet.
        """
        if self._progress is None:
            raise gym.error.ResetNeeded("call reset() before using the environment")
        return self._progress

    @property
    def task_description(self) -> str:
        """The episode's instruction, in words; before the first episode the canonical one."""
        if self._progress is None:
            spec = self.task_definition.spec
            return spec.instructions_for(spec.variations[self.settings.variation or 0])[0]
        return self._progress.instruction

    @property
    def variation(self) -> int:
        """Index of the episode's variation."""
        return self.progress.variation.index

    @property
    def _max_episode_steps(self) -> int:
        """Upper bound of steps per episode, under the name that LeRobot asks for."""
        if self.settings.control_mode == "keypose":
            return self.settings.max_keyposes
        return self.task_definition.spec.horizon_ticks

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Start an episode.

        Args:
            seed: non-negative integer that determines the episode; without it one is drawn from the generator
                that the last given seed started.
            options: not used.

        Raises:
            PlacementFailure: no placement of the props was found that both arms can serve.
        """
        super().reset(seed=seed)
        self._finish_video()
        scene = self.scene
        self._progress = self._draw_episode(
            int(self.np_random.integers(2**31)) if seed is None else int(seed)
        )
        self.task_definition.reset(scene, self._progress.variation, self._progress.rng)
        self._progress.conditions = self.task_definition.check(scene, self._progress.variation)
        return self.observe(), self._info()

    def _draw_episode(self, seed: int) -> EpisodeProgress:
        """Draw variation and instruction; always both, so that fixing a variation changes nothing else."""
        spec = self.task_definition.spec
        rng = np.random.default_rng(np.random.SeedSequence([SPLITS[self.settings.split], spec.id, seed]))
        drawn, sentence = int(rng.integers(len(spec.variations))), int(rng.integers(len(spec.instructions)))
        variation = spec.variations[drawn if self.settings.variation is None else self.settings.variation]
        return EpisodeProgress(seed, variation, spec.instructions_for(variation)[sentence], rng, {})

    def step(self, action: ArrayLike) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """Execute one joint action (a control tick) or one keypose (a whole motion).

        Raises:
            InvalidAction: the action is one that its control mode refuses.
            ResetNeeded: the episode is over, or none was started.
        """
        progress = self.progress
        if progress.terminated or self._truncated:
            raise gym.error.ResetNeeded("the episode is over; call reset() before the next step")
        try:
            command = self._actions.read(action)
            if isinstance(command, BimanualKeypose):
                self._execute(command)
            else:
                self._tick(command)
        except KeyposeFailure as failure:
            progress.failure = str(failure)
        truncated = self._truncated and not progress.terminated
        if progress.terminated or truncated:
            self._finish_video()
        return self.observe(), float(progress.succeeded), progress.terminated, truncated, self._info()

    @property
    def _truncated(self) -> bool:
        progress = self.progress
        horizon = self.task_definition.spec.horizon_ticks
        return progress.ticks >= horizon or progress.keyposes >= self.settings.max_keyposes

    def _execute(self, keypose: BimanualKeypose) -> None:
        progress = self.progress
        assert self._planner is not None  # made with the scene
        plan = self._planner.plan(keypose, progress.rng)
        progress.line_fallbacks += plan.line_fallbacks
        for joint_action in plan.actions:
            self._tick(joint_action)
            if progress.terminated or self._truncated:
                break
        while progress.held_ticks and not (progress.terminated or self._truncated):
            self._tick(plan.actions[-1])  # the conditions hold; wait for the verdict
        progress.keyposes += 1

    def _tick(self, joint_action: NDArray[np.float32]) -> None:
        if self.tick_listener is not None:
            self.tick_listener(self, joint_action)
        scene, progress = self.scene, self.progress
        scene.tick(joint_action)
        progress.ticks += 1
        progress.conditions = self.task_definition.check(scene, progress.variation)
        progress.held_ticks = progress.held_ticks + 1 if all(progress.conditions.values()) else 0
        if scene.unstable:
            progress.failure = SIMULATION_UNSTABLE
        if self.settings.video_dir is not None:
            self._film(self.settings.video_dir)

    def observe(self) -> dict[str, Any]:
        """The observation of the present state; see `lerobot_env_bimanual.episode.observations` for its arrays."""
        settings = self.settings
        observation: dict[str, Any] = {}
        if settings.obs != "state":
            if self._observer is None:
                self._observer = Renderer(self.scene, settings.cameras, settings.height, settings.width)
            observation |= observe_images(settings, self._observer.render())
        views = calibration(self.scene, settings.height, settings.width)
        return observation | observe_vectors(self.scene, self.progress.keyposes, views)

    def _info(self) -> dict[str, Any]:
        progress = self.progress
        return {
            "is_success": progress.succeeded,
            "conditions": dict(progress.conditions),
            "failure": progress.failure,
            "ticks": progress.ticks,
            "line_fallbacks": progress.line_fallbacks,
        }

    def render(self) -> NDArray[np.uint8] | None:
        """The front camera at 480x640, uint8 RGB."""
        return None if self.render_mode is None else self._render_frame()

    def _render_frame(self) -> NDArray[np.uint8]:
        if self._frame_renderer is None:
            quality = self.settings.render_quality
            self._frame_renderer = Renderer(self.scene, (RENDER_CAMERA,), *RENDER_SIZE, quality=quality)
        return self._frame_renderer.render()[RENDER_CAMERA][0]

    def _film(self, folder: Path) -> None:
        if self._video is None:
            episode = f"v{self.variation}_{self.settings.split}_seed{self.progress.seed}"
            self._video = VideoWriter(folder, f"{self.task}_{episode}")
        self._video.add(self._render_frame())

    def _finish_video(self) -> None:
        if self._video is not None:
            self._video.close(self._outcome())
            self._video = None

    def _outcome(self) -> str:
        if self.progress.succeeded:
            return "success"
        return "failure" if self.progress.terminated or self._truncated else "unfinished"

    def state_hash(self) -> str:
        """SHA-256 of everything that decides how the simulation goes on."""
        return self.scene.state_hash()

    def save_state(self) -> tuple[Any, EpisodeProgress]:
        """A copy of the episode, from which `restore_state` continues bit for bit."""
        return self.scene.save_state(), copy.deepcopy(self.progress)

    def restore_state(self, state: tuple[Any, EpisodeProgress]) -> None:
        """Go back to a saved state of an environment with the same options; the state may be used again."""
        scene_state, progress = state
        self.scene.restore_state(scene_state)
        self._progress = copy.deepcopy(progress)

    def close(self) -> None:
        """Finish the video and free the world; a later reset builds it anew."""
        self._finish_video()
        for renderer in (self._observer, self._frame_renderer):
            if renderer is not None:
                renderer.close()
        self._observer = self._frame_renderer = None
        self._scene = self._planner = self._progress = None
