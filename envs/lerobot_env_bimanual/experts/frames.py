"""An expert's episode as frames, one per control tick: what `lerobot_env_bimanual.play_expert` iterates over."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.runner import expert_of


@dataclass(frozen=True, eq=False)
class Frame:
    """One control tick of 50 ms.

    Attributes:
        observation: before the tick, as `BimanualEnv.reset` and `step` return it.
        action: (16,) float32 joint action of the tick, left arm first.
        keypose: (18,) float32 keypose that the expert moves to, left arm first.
    """

    observation: dict[str, Any]
    action: NDArray[np.float32]
    keypose: NDArray[np.float32]


def play_expert(task: str, seed: int = 0, **options: Any) -> Iterator[Frame]:
    """Play an episode of a task's expert, frame by frame.

    Args:
        task: name of the task, as in `lerobot-bimanual task list`.
        seed: of the episode.
        options: of `BimanualEnv`, such as `image_size=128`, `variation=2` or `video_dir="outputs/expert"`.

    Yields:
        A frame before each control tick, until the episode ends. The frames of one keypose come together.

    Raises:
        BimanualError: an option is outside its choices, or no placement that both arms can serve was found.
    """
    env = BimanualEnv(task, **options)
    frames: list[Frame] = []
    try:
        env.reset(seed=seed)
        for move in expert_of(env)(env):
            with env.observed_by(
                lambda env, action: frames.append(Frame(env.observe(), action, env.last_action))
            ):
                _, _, terminated, truncated, _ = env.step(move.action)
            yield from frames
            frames.clear()
            if terminated or truncated:
                return
    finally:
        env.close()
