"""The robot: two simulated arms that take joint targets and show their joints and cameras."""

import logging
from typing import Any

import numpy as np
from lerobot.robots.robot import Robot
from lerobot.utils.decorators import check_if_already_connected, check_if_not_connected
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS, JOINTS_PER_ARM
from lerobot_bimanual.dataset import schema
from lerobot_bimanual.errors import InvalidAction
from lerobot_bimanual.joint_action import JOINT_ACTION_DIM, by_arm
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.episode.actions import ActionReader
from lerobot_env_bimanual.episode.observations import PIXELS, env_key
from lerobot_env_bimanual.options import EnvOptions
from lerobot_env_bimanual.robots.panda_pair import PANDA_PAIR
from lerobot_robot_bimanual.config_bimanual_sim import BimanualSimConfig

logger = logging.getLogger(__name__)

HOME = np.array([*PANDA_PAIR.home_joints, 1.0] * len(ARMS), dtype=np.float32)
AWAY_RAD = 0.05
"""A hand has left home when one of its joint targets was as far from it as this, and as twice the tolerance."""


class UntimedEnv(BimanualEnv):
    """The environment without a time limit, as people need longer than experts.

    An episode that is solved, or whose simulation became unstable, does not change any more until the next one.
    """

    @property
    def _truncated(self) -> bool:
        return False

    def tick(self, joint_action: NDArray[np.float32]) -> None:
        """Simulate 50 ms towards a joint action (16,) within the limits, unless the episode is over."""
        if self.progress.terminated:
            return
        self._tick(joint_action)
        if self.progress.terminated:
            self._finish_video()
            self.log_outcome()

    def log_outcome(self) -> None:
        """Log the outcome of the episode so far."""
        progress = self.progress
        progress.evaluate_all_conditions(self._conditions, self.scene)
        unmet = ", ".join(name for name, met in progress.conditions.items() if not met)
        verdict = "solved" if progress.succeeded else progress.failure or f"not solved, unmet: {unmet}"
        state = progress.ticks, self.state_hash()
        logger.info("%s: %s after %d ticks, state %s", self.episode_name, verdict, *state)

    @property
    def episode_name(self) -> str:
        """Name of the episode: variation, task, setting, perturbation, split and seed."""
        return f"variation {self.variation} of {self._world_name} seed {self.progress.seed}"


class BimanualSim(Robot):
    """Two simulated Pandas in front of a task, as LeRobot's command lines see a robot.

    An action is one control tick, as in the environment and in the datasets: the actions of a demonstration lead to its
    states, bit for bit. Bad values are dealt with as in the environment's mode `auto`: targets outside the joint
    limits are clipped, a NaN raises.

    **The next episode begins when both hands are sent home**, or to where they began, after one of them has left it. That
    is what LeRobot does by itself between the episodes of `lerobot-rollout --strategy.type=episodic`, and what a person does
    in the reset phase of `lerobot-record`, with a larger `home_tolerance_rad`. Until then an episode that is solved does
    not change.

    Attributes:
        config: what was chosen.
        cameras: names of the cameras; LeRobot counts them.
    """

    config_class = BimanualSimConfig
    name = schema.ROBOT_TYPE

    def __init__(self, config: BimanualSimConfig):
        super().__init__(config)
        self.config = config
        self._options = EnvOptions(**config.keywords())
        self.cameras = () if self._options.obs == "state" else self._options.camera_names
        self._reader = ActionReader(self._options.control_mode, PANDA_PAIR)
        self._env: UntimedEnv | None = None
        self._next_seed = config.seed
        self._homes = HOME[None]
        self._has_left_home = False

    @property
    def observation_features(self) -> dict[str, Any]:
        """Joints as `float`, images as their shape (H, W, 3), depth as (H, W, 1)."""
        images: dict[str, Any] = dict.fromkeys(self.cameras, (*self._options.size, 3))
        if self._options.obs == "rgbd":
            images |= {f"{camera}_depth": (*self._options.size, 1) for camera in self.cameras}
        return self.action_features | images

    @property
    def action_features(self) -> dict[str, Any]:
        """The sixteen numbers of a joint action, by name."""
        return dict.fromkeys(schema.JOINT_NAMES, float)

    @property
    def is_connected(self) -> bool:
        """Whether there is a world."""
        return self._env is not None

    @property
    def is_calibrated(self) -> bool:
        """Simulated arms always are."""
        return True

    def calibrate(self) -> None:
        """Nothing to do."""

    def configure(self) -> None:
        """Nothing to do."""

    @property
    @check_if_not_connected
    def env(self) -> UntimedEnv:
        """The world, with the running or finished episode.

        Raises:
            DeviceNotConnectedError: there is none before `connect`.
        """
        assert self._env is not None
        return self._env

    @check_if_already_connected
    def connect(self, calibrate: bool = True) -> None:
        """Build the world and reset the first episode.

        Raises:
            DeviceAlreadyConnectedError: there is a world already.
            BimanualError: a perturbation finds nothing to change in the task.
            PlacementFailure: no placement of the props was found that both arms can serve.
        """
        env = UntimedEnv(self.config.task, options=self._options)
        self._next_seed = self.config.seed
        try:
            self._begin_episode(env)
        except BaseException:
            env.close()
            raise
        self._env = env
        # LeRobot brings the arms back to their first posture; an axis of perturbation may have changed it.
        self._homes = np.stack([HOME, env.progress.sent_action])

    def get_observation(self) -> dict[str, Any]:
        """Joints in rad, openings 0..1, images uint8 (H, W, 3), depth uint16 (H, W, 1) in millimetres.

        Raises:
            DeviceNotConnectedError: before `connect`.
        """
        observed = self.env.observe()
        state = observed[env_key(schema.STATE)]
        observation: dict[str, Any] = dict(zip(schema.JOINT_NAMES, state.tolist(), strict=True))
        observation |= observed.get(PIXELS, {})
        if self._options.obs == "rgbd":
            for camera in self.cameras:
                depth_mm = observed[env_key(schema.depth_key(camera))]  # (1, H, W)
                observation[f"{camera}_depth"] = depth_mm[0, ..., None].round().astype(np.uint16)
        return observation

    def send_action(self, action: dict[str, Any]) -> dict[str, Any]:
        """Go on for one tick, or begin the next episode if this sends both hands home.

        Args:
            action: the sixteen numbers by name.

        Returns:
            What the arms were given last, within the limits of joints and speed.

        Raises:
            InvalidAction: names are missing or unknown, or a value is no finite number. The world did not change.
            PlacementFailure: the next episode cannot begin; sending both hands home again begins the one after it.
            DeviceNotConnectedError: before `connect`.
        """
        env = self.env
        command = self._read(action)
        away_rad = np.abs(by_arm(command - self._homes)[..., :JOINTS_PER_ARM]).max(axis=(-2, -1))
        distance_rad, tolerance_rad = float(away_rad.min()), self.config.home_tolerance_rad
        was_over = env.progress.terminated
        if self._has_left_home and distance_rad < tolerance_rad:
            if not was_over:
                env.log_outcome()
            self._begin_episode(env)
        else:
            self._has_left_home |= distance_rad > max(AWAY_RAD, 2 * tolerance_rad)
            env.tick(command)
            if env.progress.terminated and not was_over:
                logger.info(
                    "the next episode begins when both hands are sent home, within %g rad", tolerance_rad
                )
        return dict(zip(schema.JOINT_NAMES, env.progress.sent_action.tolist(), strict=True))

    def disconnect(self) -> None:
        """Log the outcome of an unfinished episode, and free the world.

        Raises:
            DeviceNotConnectedError: before `connect`.
        """
        env = self.env
        if env.progress.ticks and not env.progress.terminated:
            env.log_outcome()
        env.close()
        self._env = None

    def _begin_episode(self, env: UntimedEnv) -> None:
        self._next_seed += 1  # before the reset: a seed without a placement is not tried again
        env.reset(seed=self._next_seed - 1)
        self._has_left_home = False
        logger.info('%s: "%s"', env.episode_name, env.task_description)

    def _read(self, action: dict[str, Any]) -> np.ndarray:
        """The command (16,) float32 that an action means."""
        missing = [name for name in schema.JOINT_NAMES if name not in action]
        unknown = [name for name in action if name not in schema.JOINT_NAMES]
        if missing or unknown:
            raise InvalidAction(
                f"a robot action has the {JOINT_ACTION_DIM} keys {schema.JOINT_NAMES[0]} to "
                f"{schema.JOINT_NAMES[-1]}; missing: {', '.join(missing) or 'none'}; "
                f"unknown: {', '.join(map(str, unknown)) or 'none'}"
            )
        try:
            values = [float(action[name]) for name in schema.JOINT_NAMES]
        except (TypeError, ValueError) as error:
            raise InvalidAction(f"a robot action consists of numbers: {error}") from error
        command = self._reader.read(self._reader.vector(values))
        assert isinstance(command, np.ndarray)  # a vector of sixteen is no keypose
        return command
