"""Plays the episodes of a dataset again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.reader import RecordedDataset, RecordedEpisode
from lerobot_bimanual.episode import EpisodeMeta
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.replay import ReplayMode, ReplayResult, Visitor, replay
from lerobot_env_bimanual.verification.simulation import setting


class Replayer:
    """Plays episodes of one dataset; keeps the environment of the last task.

    Args:
        root: folder of one view.
        mode: "joint" plays the recorded joint actions tick by tick, which the view `frames` stores, "keypose" the
            recorded keyposes.
        image_size: (height, width) in pixels that the calibration of observations is for.
    """

    def __init__(self, root: Path, mode: ReplayMode, image_size: tuple[int, int] = (256, 256)):
        self._dataset = RecordedDataset(root)
        self._mode: ReplayMode = mode
        self._image_size = image_size
        self._env: BimanualEnv | None = None

    def replay(self, index: int, visit: Visitor | None = None) -> tuple[EpisodeMeta, ReplayResult]:
        """Play one episode from its recorded seed and compare every state that is recorded.

        Args:
            index: of the episode.
            visit: as for `lerobot_env_bimanual.replay.replay`.
        """
        episode = self._dataset.episode(index)
        meta, view = episode.meta, self._dataset.view
        actions = episode.columns[schema.ACTION] if self._mode == "joint" else keyposes_of(episode, view)
        env = self._environment(meta)
        return meta, replay(env, meta.seed, meta.variation, actions, hashes_of(episode, view), visit)

    def _environment(self, meta: EpisodeMeta) -> BimanualEnv:
        env = self._env
        if env is None or (env.task, env.options.split) != (meta.task, meta.split):
            if env is not None:
                env.close()
            env = BimanualEnv(
                meta.task,
                split=meta.split,
                image_size=self._image_size,
                obs="state",
                control_mode=self._mode,
                perturb=setting(self._dataset, "perturb", ""),
            )
        self._env = env
        return env


def keyposes_of(episode: RecordedEpisode, view: schema.View) -> NDArray[np.float32]:
    """The keyposes (stages, 18) that an episode executed, in order."""
    rows = len(episode) - (view == "keyframes")  # its last row repeats the last keypose, completed
    steps = episode.columns[schema.KEYPOSE_STEP][:rows]
    _, first_rows = np.unique(steps, return_index=True)
    return episode.columns[schema.NEXT_KEYPOSE][first_rows]


def hashes_of(episode: RecordedEpisode, view: schema.View) -> dict[int, int]:
    """Number of ticks played -> state hash then, of every tick that is a row."""
    ticks_played = episode.columns[schema.TICK] + 1
    if view == "keyframes":
        ticks_played[-1] -= 1  # its last row is the one after the last tick, and repeats that tick's hash
    return dict(zip(ticks_played.tolist(), episode.columns[schema.STATE_HASH].tolist(), strict=True))
