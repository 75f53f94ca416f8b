"""The environment as `gymnasium.make` returns it, on demand with LeRobot's keys."""

from typing import Any, Literal, get_args

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.wrappers import TransformObservation

from lerobot_bimanual.dataset.schema import image_key
from lerobot_bimanual.errors import InvalidChoice
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.episode.observations import PIXELS, dataset_row

Keys = Literal["gymnasium", "lerobot"]


def make_env(
    task: str, *, keys: Keys = "gymnasium", render_mode: str | None = "rgb_array", **options: Any
) -> gym.Env:
    """A task as an environment, the same as of `gymnasium.make("bimanual/LiftBall-v0", ...)`.

    Args:
        task: its name.
        keys: `gymnasium` for the observations of `BimanualEnv`; `lerobot` for rows as a `LeRobotDataset` has them, in which
            colours are float32 (3, H, W) in [0, 1].
        render_mode: only "rgb_array".
        options: of `EnvOptions`.

    Raises:
        BimanualError: an option is outside its choices.
    """
    env = BimanualEnv(task, render_mode=render_mode, **options)
    if checked_keys(keys) == "gymnasium":
        return env
    found: Any = env.observation_space
    space: dict[str, Any] = {**found}
    pixels = space.pop(PIXELS, {})
    images: dict[str, Any] = {
        image_key(camera): spaces.Box(0, 1, (3, *box.shape[:2]), np.float32) for camera, box in pixels.items()
    }
    return TransformObservation(env, dataset_row, spaces.Dict(images | dataset_row(space)))


def checked_keys(keys: Any) -> Keys:
    """The argument `keys`, refused unless it is one of `Keys`."""
    if keys not in get_args(Keys):
        raise InvalidChoice("keys", keys, get_args(Keys))
    return keys
