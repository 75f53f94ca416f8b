"""Plays recorded actions again and compares the states that they lead to, bit for bit."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.schema import state_hash_column
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.options import STANDARD

if TYPE_CHECKING:
    from lerobot_bimanual.dataset.reader import RecordedDataset, RecordedEpisode
    from lerobot_bimanual.episode import EpisodeMeta


type ReplayMode = Literal["joint", "keypose"]
"""By joint actions, one per tick, or by keyposes, a whole motion each."""


@dataclass(frozen=True)
class ReplayResult:
    """How a replay compares with the record.

    Attributes:
        ticks: control ticks that were played.
        divergence: first tick after which the state differed from the record, or that one of them lacks; -1 where the
            reset already gave another state, `None` if there is none.
        success: whether the task was solved.
        failure: what the environment says if it was not.
    """

    ticks: int
    divergence: int | None
    success: bool
    failure: str

    @property
    def matches(self) -> bool:
        """Whether the replay went exactly as recorded."""
        return self.success and self.divergence is None


def replay(
    env: BimanualEnv, seed: int, variation: int, actions: Iterable[ArrayLike], hashes: Mapping[int, int]
) -> ReplayResult:
    """Play actions from a seed until the episode ends, or a state is not as recorded.

    Args:
        env: environment of the episode's task and split, whose control mode takes the actions.
        seed: seed of the episode.
        variation: index of its variation.
        actions: recorded joint actions (16,) or keyposes (18,), all of them.
        hashes: number of ticks played -> state hash then, as datasets store it; the largest number is the episode's
            length.

    Raises:
        InvalidAction: the environment refuses an action.
    """
    divergence, length = None, max(hashes)

    def compare(env: BimanualEnv, _: NDArray | None = None) -> None:
        nonlocal divergence
        ticks = env.progress.ticks
        if divergence is None and (
            ticks > length or (ticks in hashes and state_hash_column(env.state_hash()) != hashes[ticks])
        ):
            divergence = ticks - 1

    env.reset(seed=seed, options={"variation": variation})
    with env.observed_by(compare):
        for action in actions:
            _, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated or divergence is not None:
                break
    compare(env)
    ticks = env.progress.ticks
    if divergence is None and ticks < length:
        divergence = ticks
    return ReplayResult(ticks, divergence, env.progress.succeeded, env.progress.failure)


@lru_cache(maxsize=1)
def _environment(task: str, split: str, mode: ReplayMode, perturb: str, setting: str) -> BimanualEnv:
    """The environment of the last recorded episode of this process, kept for the next one of its kind."""
    return BimanualEnv(task, split=split, obs="state", control_mode=mode, perturb=perturb, setting=setting)


def replay_recorded(dataset: RecordedDataset, index: int) -> tuple[EpisodeMeta, ReplayResult]:
    """Play the actions of an episode from its recorded seed and compare every state that is recorded.

    Args:
        dataset: one view: `frames` holds a joint action per tick, `keyframes` the keyposes, a whole motion each.
        index: of the episode.
    """
    episode, view, provenance = dataset.episode(index), dataset.view, dataset.provenance
    meta, world = episode.meta, ("", STANDARD)
    if provenance is not None:
        world = provenance.perturb, provenance.setting
    env = _environment(meta.task, meta.split, "joint" if view == "frames" else "keypose", *world)
    return meta, replay(env, meta.seed, meta.variation, actions_of(episode, view), hashes_of(episode, view))


def actions_of(episode: RecordedEpisode, view: schema.View) -> NDArray[np.float32]:
    """The actions (actions, 16 or 18) that an episode executed, in order."""
    actions = episode.columns[schema.ACTION]
    if view == "frames":
        return actions
    # Rows on the way to a keypose have it, too, and the last row repeats the last one, completed.
    _, first_rows = np.unique(episode.columns[schema.KEYPOSE_STEP][:-1], return_index=True)
    return actions[first_rows]


def hashes_of(episode: RecordedEpisode, view: schema.View) -> dict[int, int]:
    """Number of ticks played -> state hash then, of every tick that is a row."""
    ticks_played = episode.columns[schema.TICK] + 1
    if view == "keyframes":
        ticks_played[-1] -= 1  # its last row is the one after the last tick, and repeats that tick's hash
    return dict(zip(ticks_played.tolist(), episode.columns[schema.STATE_HASH].tolist(), strict=True))
