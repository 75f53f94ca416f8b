"""Records the episodes of an environment, so that they can be played again without the policy."""

import itertools
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import ArrayLike, NDArray

from lerobot_bimanual.results.episode import Episode, Proof
from lerobot_bimanual.results.proof import HashChain, actions_to_text
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.episode.actions import EMPTY_ACTION
from lerobot_env_bimanual.episode.progress import EpisodeProgress
from lerobot_env_bimanual.experts.load import LoadMeter, is_within_reflex_limits
from lerobot_env_bimanual.experts.runner import OUT_OF_TIME

PLAYED = "played"
"""Key of the last step's info that holds the whole `Episode`."""


class EpisodeRecorder(gym.Wrapper):
    """Adds the `Episode` to the info of an episode's last step, under `PLAYED`."""

    _load: LoadMeter  # of the episode

    def __init__(self, env: BimanualEnv):
        super().__init__(env)
        self._env = env
        self._start = ""
        self._chain = HashChain()
        self._actions: list[NDArray[np.float32]] = []
        env.tick_observers.append(lambda *_: self._load.observe_tick())
        env.step_observers.append(lambda: self._load.observe_step())

    def reset(self, **arguments: Any) -> tuple[Any, dict[str, Any]]:
        """Start an episode, and its record."""
        observation, info = self._env.reset(**arguments)
        self._start = self._env.state_hash()
        progress = self._env.progress
        facts = (self._env.task, self._env.options.split, progress.seed, self._env.variation)
        self._chain = HashChain(*map(str, facts), progress.instruction, self._start)
        self._actions = []
        self._load = LoadMeter(self._env.scene)
        return observation, info

    def step(self, action: ArrayLike) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """One step of the episode; an action that is refused is recorded when the episode is ended by `fail`."""
        return self._recorded(self._env.step(action))

    def fail(self, reason: str) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """End the episode as a failure because its last action was refused."""
        return self._recorded(self._env.fail(reason))

    def _recorded(self, transition: Any) -> Any:
        observation, reward, terminated, truncated, info = transition
        action, self._env.last_action = self._env.last_action, EMPTY_ACTION
        self._actions.append(action)
        self._chain.add(action, self._env.state_hash())
        if terminated or truncated:
            info = info | {PLAYED: self._played(self._env.progress)}
        return observation, reward, terminated, truncated, info

    def _played(self, progress: EpisodeProgress) -> Episode:
        load = self._load.result()
        return Episode(
            seed=progress.seed,
            variation=progress.variation.index,
            success=progress.succeeded,
            failure=None if progress.succeeded else progress.failure or OUT_OF_TIME,
            ticks=progress.ticks,
            keyposes=progress.keyposes,
            first_met_tick=progress.first_met_tick,
            load=load,
            survived=is_within_reflex_limits(self._env.task, load),
            proof=Proof(
                instruction=progress.instruction,
                start=self._start,
                actions=tuple(
                    actions_to_text(np.stack(list(run)))
                    for _, run in itertools.groupby(self._actions, key=len)
                ),
                links=self._chain.links,
                end=self._chain.end,
            ),
        )
