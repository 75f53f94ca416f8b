"""The Gymnasium environment: one task, one world, two kinds of action."""

import copy
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import ArrayLike, NDArray

from lerobot_bimanual.errors import InvalidChoice
from lerobot_bimanual.joint_action import CONTROL_HZ
from lerobot_bimanual.keypose import BimanualKeypose
from lerobot_bimanual.results.evaluation import eval_key
from lerobot_env_bimanual.conditions import Condition, history_conditions
from lerobot_env_bimanual.episode.actions import EMPTY_ACTION, ActionReader
from lerobot_env_bimanual.episode.observations import observation_space
from lerobot_env_bimanual.episode.progress import EpisodeProgress, draw_episode
from lerobot_env_bimanual.motion.planner import KeyposeFailure
from lerobot_env_bimanual.options import EnvOptions, checked_reset_options, checked_seed
from lerobot_env_bimanual.perturbations.perturbations import Perturbations
from lerobot_env_bimanual.robots.panda_pair import PANDA_PAIR
from lerobot_env_bimanual.tasks.registry import get_task
from lerobot_env_bimanual.world.scene import Scene
from lerobot_env_bimanual.world.video import VideoWriter
from lerobot_env_bimanual.worlds import MAX_DRAWS, World, Worlds

type TickObserver = Callable[[BimanualEnv, NDArray[np.float32]], None]


class BimanualEnv(gym.Env):
    """A bimanual manipulation task with two Franka arms.

    An action of 16 numbers is one control tick of 50 ms towards absolute joint targets (per arm, left first,
    seven joints in rad and the gripper from 0 closed to 1 open). An action of 18 numbers is a keypose (per arm
    position in m, quaternion wxyz, gripper_open, ignore_collisions) which is planned and executed to its end
    within one step. An action that cannot be executed, such as a NaN, raises `InvalidAction` and leaves the episode as it was;
    `lerobot_env_bimanual.episode.actions` says which are invalid.

    The reward is 1 at success and 0 before. `info` holds, after reset and every step, `is_success`, `conditions`
    (name -> met now), `failure` (empty while there is none), `ticks`, `line_fallbacks` (straight lines replaced by
    joint-space motions because an arm could not follow them), `clipped_ticks` and `clipped_rad` (see
    `lerobot_env_bimanual.episode.actions`), and the episode's `seed` and `instruction`.

    An episode is determined by task, setting, split, seed, variation and perturbations, bit for bit. Construction is cheap:
    each set of props is compiled at the first reset that draws it, OpenGL starts at the first image, and after `close` both
    are started again when needed. A running environment cannot be copied or pickled, but the result of `save_state()` can, and
    `restore_state` of another environment with the same options continues from it.

    Args:
        task: registered task name.
        options: all other options, without `results_dir`; by default those of `EnvOptions()`.
        render_mode: only "rgb_array".
        keywords: single options by name; they win over `options`.

    Attributes:
        options: what was chosen.
        perturbations: the differences from the nominal world.
        action_lengths: how many numbers an action may have.
        last_action: the action of the last step as float32, also if it was refused; empty if it could not be read.
        tick_observers: called in turn before every control tick, with the environment and the joint action (16,).
        step_observers: called in turn after every step of physics of the episode.

    Raises:
        BimanualError: an option is outside its choices; the message lists them.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": CONTROL_HZ}  # noqa: RUF012  (Gymnasium's attribute)

    def __init__(
        self,
        task: str,
        *,
        options: EnvOptions | None = None,
        render_mode: str | None = "rgb_array",
        **keywords: Any,
    ):
        if render_mode is not None and str(render_mode) != "rgb_array":
            raise InvalidChoice("render_mode", render_mode, self.metadata["render_modes"])
        self.task_definition = get_task(task)
        spec = self.task_definition.spec
        self.task = spec.name
        self.options = EnvOptions.of(**((options or EnvOptions()).keywords() | keywords))
        if self.options.results_dir is not None:
            raise InvalidChoice(
                "results_dir",
                self.options.results_dir,
                "given to `evaluate` or `lerobot-eval`, which record episodes",
            )
        self._variation = spec.variation_index(self.options.variation)
        self.render_mode = render_mode
        self.last_action = EMPTY_ACTION
        self.tick_observers: list[TickObserver] = []
        self.step_observers: list[Callable[[], None]] = []
        self._actions = ActionReader(self.options.control_mode, PANDA_PAIR)
        self.action_lengths, self.action_space = self._actions.lengths, self._actions.space
        self.observation_space = observation_space(self.options)
        self.perturbations = Perturbations(
            self.options.perturb, spec, self.options.split, self.options.camera_names
        )
        self._worlds = Worlds(self.task_definition, self.options, self.perturbations)
        self._progress: EpisodeProgress | None = None
        self._video: VideoWriter | None = None

    @property
    def _world(self) -> World:
        return self._worlds[0 if self._progress is None else self._progress.prop_set]

    @property
    def scene(self) -> Scene:
        """The world of the episode; compiled on first use. The next episode may have another one, with other things.

        Raises:
            InvalidChoice: an axis of perturbation finds nothing to change in the task.
        """
        return self._world.scene

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
        spec = self.task_definition.spec
        canonical = spec.instructions_for(spec.variations[self._variation or 0])[0]
        return canonical if self._progress is None else self._progress.instruction

    @property
    def variation(self) -> int:
        """Index of the episode's variation."""
        return self.progress.variation.index

    @property
    def _max_episode_steps(self) -> int:
        """Upper bound of steps per episode, under the name that LeRobot asks for."""
        if self.options.control_mode == "keypose":
            return self.options.max_keyposes
        return self.task_definition.spec.horizon_ticks

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Start an episode.

        Args:
            seed: integer from 0 to 2**63 - 1 that determines the episode; without it one is drawn from the generator
                that the last given seed started.
            options: `{"variation": index}` chooses the variation of this episode alone; other entries, which callers
                such as LeRobot add for their wrappers, are ignored.

        Raises:
            InvalidChoice: the seed or the options are invalid, or the task does not have the variation.
            PlacementFailure: no placement of the props was found that both arms can serve.
        """
        seed, chosen = checked_seed(seed), checked_reset_options(options)
        variation = self._variation
        if "variation" in chosen:
            variation = self.task_definition.spec.variation_index(chosen["variation"])
        super().reset(seed=seed)
        self._finish_video()
        seed = int(self.np_random.integers(2**31)) if seed is None else seed
        split, setting = self.options.split, self.options.setting
        progress = draw_episode(self.task_definition.spec, split, seed, variation, setting)
        world = self._worlds[progress.prop_set]
        self._progress = progress
        try:
            progress.draws = world.reset.start(progress)
        except BaseException as failure:  # nothing can be played from here, also after an interrupt
            progress.failure, progress.draws = str(failure) or repr(failure), MAX_DRAWS
            raise
        progress.sent_action = progress.wanted = world.scene.commanded
        progress.history_conditions = history_conditions(self._conditions, world.scene, {})
        progress.evaluate_all_conditions(self._conditions, world.scene)
        return self.observe(), progress.info()

    @contextmanager
    def observed_by(
        self, observer: TickObserver, step_observer: Callable[[], None] = lambda: None
    ) -> Iterator[None]:
        """Call an observer before every control tick, and another after every step of physics, in a `with` block."""
        self.tick_observers.append(observer)
        self.step_observers.append(step_observer)
        try:
            yield
        finally:
            self.tick_observers.remove(observer)
            self.step_observers.remove(step_observer)

    def step(self, action: ArrayLike) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """Execute one joint action (a control tick) or one keypose (a whole motion).

        Raises:
            InvalidAction: the action is one that its control mode refuses.
            ResetNeeded: the episode is over, or none was started.
        """
        progress = self._running_episode()
        self.last_action = EMPTY_ACTION
        try:
            self.last_action = self._actions.vector(action)
            command = self._actions.read(self.last_action)
            if isinstance(command, BimanualKeypose):
                self._execute(command)
            else:
                self._tick(command)
        except KeyposeFailure as failure:
            progress.failure = str(failure)
        return self._transition()

    def fail(self, reason: str) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """End the episode as a failure, without a tick; returns what `step` returns.

        Raises:
            ResetNeeded: the episode is over, or none was started.
        """
        self._running_episode().failure = reason
        return self._transition()

    def _running_episode(self) -> EpisodeProgress:
        if self.progress.terminated or self._truncated:
            raise gym.error.ResetNeeded("the episode is over; call reset() before the next step")
        return self.progress

    def _transition(self) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        progress, truncated = self.progress, self._truncated and not self.progress.terminated
        if progress.terminated or truncated:
            self._finish_video()
        progress.evaluate_all_conditions(self._conditions, self.scene)
        return self.observe(), float(progress.succeeded), progress.terminated, truncated, self.progress.info()

    @property
    def _truncated(self) -> bool:
        is_late = self.progress.ticks >= self.task_definition.spec.horizon_ticks
        return is_late or self.progress.keyposes >= self.options.max_keyposes

    def _execute(self, keypose: BimanualKeypose) -> None:
        progress = self.progress
        # A plan starts from where the arms were told to go, which a perturbation may have moved.
        progress.sent_action = progress.wanted = self.scene.commanded
        plan = self._world.planner.plan(keypose, progress.rng)
        progress.line_fallbacks += plan.line_fallbacks
        for joint_action in (*plan.actions, *[plan.actions[-1]] * self.perturbations.late_ticks):
            self._tick(joint_action)
            if progress.terminated or self._truncated:
                break
        while progress.held_ticks and not (progress.terminated or self._truncated):
            self._tick(plan.actions[-1])  # the conditions hold; wait for the verdict
        progress.keyposes += 1

    def _tick(self, wanted: NDArray[np.float32]) -> None:
        scene, progress, stop = self.scene, self.progress, self._world.stop
        joint_action = self._actions.limited(wanted, progress)
        for observer in self.tick_observers:
            observer(self, joint_action)
        progress.record_action(wanted, joint_action)
        observers = self.step_observers if stop is None else [*self.step_observers, stop.note_step]
        scene.tick(self.perturbations.command(joint_action, scene, progress), observers)
        progress.ticks += 1
        progress.judge(self._conditions, scene)
        if stop is not None:
            stop.judge(progress)
        if scene.unstable:
            progress.failure = "simulation_unstable"
        self.perturbations.disturb(scene, progress)
        if self.options.video_dir is not None:
            self._film(Path(self.options.video_dir))

    @property
    def _conditions(self) -> tuple[Condition, ...]:
        return self.task_definition.conditions(self.progress.variation)

    def observe(self) -> dict[str, Any]:
        """The observation of the present state; see `lerobot_env_bimanual.episode.observations` for its arrays."""
        return self._world.renderer.observe(self.progress)

    def images(self) -> dict[str, Any]:
        """The images of an observation, with depth, whatever the option `obs` says."""
        return self._world.renderer.images(self.progress, depth=True)

    def render(self) -> NDArray[np.uint8] | None:
        """The front camera at 480x640, uint8 RGB."""
        return None if self.render_mode is None else self._world.renderer.frame()

    def _film(self, folder: Path) -> None:
        if self._video is None:
            what = eval_key(self.task, "any", self.options.perturb, self.options.setting)
            words = (what, f"v{self.variation}", self.options.split, f"seed{self.progress.seed}")
            self._video = VideoWriter(folder, "_".join(words), caption=" ".join(words))
        self._video.add(self._world.renderer.frame())

    def _finish_video(self) -> None:
        if self._video is not None:
            ended = "failure" if self.progress.terminated or self._truncated else "unfinished"
            video, self._video = self._video, None  # a video that cannot be finished is not tried again
            video.close("success" if self.progress.succeeded else ended)

    def state_hash(self) -> str:
        """SHA-256 of the state of the physics, of the arms' commands, and of the `Once` and `Always` conditions so far.

        The planner's random generator and the counters are not included; seed and actions determine them.
        """
        return self.progress.joined_hash(self.scene.state_hash())

    @property
    def _world_name(self) -> str:
        options = self.options
        return f"{eval_key(self.task, 'any', options.perturb, options.setting)} {options.split}"

    def save_state(self) -> tuple[Any, EpisodeProgress, str]:
        """A copy of the episode, from which `restore_state` continues bit for bit; it can be pickled."""
        return self.scene.save_state(), copy.deepcopy(self.progress), self._world_name

    def restore_state(self, state: tuple[Any, EpisodeProgress, str]) -> None:
        """Go back to a saved state of an environment with the same options; the state may be used again.

        Raises:
            InvalidChoice: it is of another task, setting, perturbation or split; nothing has changed then.
        """
        scene_state, progress, world_name = state
        if world_name != self._world_name:
            raise InvalidChoice("world of the saved state", world_name, repr(self._world_name))
        self._progress = copy.deepcopy(progress)
        self.scene.restore_state(scene_state)

    def __getstate__(self) -> object:
        """The state for copy and pickle, which shares nothing that changes; refused during an episode, as it would be lost."""
        if self._progress is not None:
            raise TypeError(
                "a running environment cannot be copied: give its save_state() to restore_state() of a new one"
            )
        own = {"tick_observers": [*self.tick_observers], "step_observers": [*self.step_observers]}
        own |= {"_worlds": Worlds(self.task_definition, self.options, self.perturbations)}
        return vars(self) | own | {"_np_random": copy.deepcopy(self._np_random)}

    def close(self) -> None:
        """Finish the video and free the world; a later reset builds it anew."""
        try:
            self._finish_video()
        finally:
            self._worlds.close()
            self._progress = None
