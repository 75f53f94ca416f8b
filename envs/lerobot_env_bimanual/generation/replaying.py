"""Plays stored episodes again and compares every state."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.reader import RecordedDataset, RecordedEpisode
from lerobot_bimanual.episode import EpisodeMeta
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.options import ControlMode

ReplayMode = Literal["joint", "keypose"]
Visitor = Callable[[BimanualEnv], None]
"""Sees the environment before every tick and after the last one."""


@dataclass(frozen=True)
class ReplayResult:
    """How a replay compares with the record.

    Attributes:
        index: episode index in the dataset.
        meta: what the episode is.
        ticks: control ticks that were played.
        divergence: first tick after which the state differed from the record, `None` if none did. When keyposes
            are replayed only the last state is compared.
        success: whether the task was solved.
        failure: what the environment says if it was not.
    """

    index: int
    meta: EpisodeMeta
    ticks: int
    divergence: int | None
    success: bool
    failure: str

    @property
    def matches(self) -> bool:
        """Whether the replay went exactly as recorded."""
        return self.success and self.divergence is None


class Replayer:
    """Plays episodes of one dataset; keeps the environment of the last task.

    Args:
        root: folder of one view.
        mode: "joint" plays the recorded joint actions tick by tick, "keypose" the recorded keyposes.
        image_size: (height, width) in pixels that the calibration of observations is for.
    """

    def __init__(self, root: Path, mode: ReplayMode, image_size: tuple[int, int] = (256, 256)):
        self._dataset = RecordedDataset(root)
        self._mode: ReplayMode = mode
        self._image_size = image_size
        self._env: BimanualEnv | None = None

    def replay(self, index: int, visit: Visitor | None = None) -> ReplayResult:
        """Play one episode from its recorded seed.

        Args:
            index: of the episode.
            visit: called before every tick and after the last.
        """
        episode = self._dataset.episode(index)
        env = self._environment(episode.meta, self._mode)
        env.reset(seed=episode.meta.seed, options={"variation": episode.meta.variation})
        with _visited(env, visit):
            if self._mode == "joint":
                divergence = _play_joint_actions(env, episode)
            else:
                divergence = _play_keyposes(env, episode, keyposes_of(episode, self._dataset.view))
        progress = env.progress
        return ReplayResult(
            index, episode.meta, progress.ticks, divergence, progress.succeeded, progress.failure
        )

    def _environment(self, meta: EpisodeMeta, mode: ControlMode) -> BimanualEnv:
        env = self._env
        if env is None or (env.task, env.options.split) != (meta.task, meta.split):
            if env is not None:
                env.close()
            env = BimanualEnv(
                meta.task, split=meta.split, image_size=self._image_size, obs="state", control_mode=mode
            )
        self._env = env
        return env


@contextmanager
def _visited(env: BimanualEnv, visit: Visitor | None) -> Iterator[None]:
    """Show the environment to a visitor while it is played."""
    if visit is None:
        yield
        return
    with env.observed_by(lambda env, _: visit(env)):
        yield
        visit(env)


def keyposes_of(episode: RecordedEpisode, view: schema.View) -> NDArray[np.float32]:
    """The keyposes (stages, 18) that an episode executed, in order."""
    rows = len(episode) - (view == "keyframes")  # its last row repeats the last keypose, completed
    steps = episode.columns[schema.KEYPOSE_STEP][:rows]
    _, first_rows = np.unique(steps, return_index=True)
    return episode.columns[schema.NEXT_KEYPOSE][first_rows]


def _play_joint_actions(env: BimanualEnv, episode: RecordedEpisode) -> int | None:
    """Play every tick; returns the first one that ended in another state, or that could not be played."""
    actions, hashes = episode.columns[schema.ACTION], episode.columns[schema.STATE_HASH]
    is_over = False
    for tick, (action, expected) in enumerate(zip(actions, hashes, strict=True)):
        if is_over:
            return tick
        _, _, terminated, truncated, _ = env.step(action)
        if schema.state_hash_column(env.state_hash()) != expected:
            return tick
        is_over = terminated or truncated
    return None


def _play_keyposes(env: BimanualEnv, episode: RecordedEpisode, keyposes: NDArray[np.float32]) -> int | None:
    """Play every keypose; returns the last tick if the final state is another one than recorded."""
    for keypose in keyposes:
        _, _, terminated, truncated, _ = env.step(keypose)
        if terminated or truncated:
            break
    matches = schema.state_hash_column(env.state_hash()) == episode.columns[schema.STATE_HASH][-1]
    return None if matches else env.progress.ticks
