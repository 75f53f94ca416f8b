"""Vector environments for evaluation: started late, quick to start, idle when their episode is over.

LeRobot has such a vector environment, but importing it costs every worker process about eight seconds for
LeRobot and torch. This module and all that a worker needs import neither.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import gymnasium as gym
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv, VectorEnv
from gymnasium.vector.utils import batch_space

PRELOADED_IN_FORK_SERVER = ["lerobot_env_bimanual.env"]
"""Imported once by the process from which the workers are forked, instead of by each of them."""

_main_module_lock = threading.Lock()


class FreezeWhenOver(gym.Wrapper):
    """Repeats the last transition of a finished episode until the next explicit reset.

    A batched rollout goes on until its slowest episode ends and ignores what the others do meanwhile, so a
    finished environment has no reason to simulate another episode. Gymnasium's automatic reset calls `reset`
    without arguments, which no explicit reset of a vector environment does; it keeps the environment frozen.
    """

    def __init__(self, env: gym.Env):
        super().__init__(env)
        self._last: tuple[Any, float, bool, bool, dict[str, Any]] | None = None

    def reset(self, **arguments: Any) -> tuple[Any, dict[str, Any]]:
        """Start an episode, or repeat the last observation if this is an automatic reset."""
        if self._last is not None and not arguments:
            return self._last[0], self._last[4]
        self._last = None
        return self.env.reset(**arguments)

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """One step, or the last transition again, without its reward."""
        if self._last is not None:
            return self._last
        observation, reward, terminated, truncated, info = self.env.step(action)
        if terminated or truncated:
            self._last = (observation, 0.0, terminated, truncated, info)
        return observation, float(reward), terminated, truncated, info


def _make_frozen(make_env: Callable[[], gym.Env]) -> gym.Env:
    return FreezeWhenOver(make_env())


@contextlib.contextmanager
def _main_module_hidden() -> Iterator[None]:
    """Keep `multiprocessing` from importing the main script again in every worker.

    Workers need nothing from it, and the scripts `lerobot-eval` and `lerobot-train` would bring LeRobot and
    torch along. The standard library offers no switch for this, it only skips a main module without a file.
    """
    main = sys.modules["__main__"]
    with _main_module_lock:
        file, spec = main.__dict__.pop("__file__", None), main.__spec__
        main.__spec__ = None
        try:
            yield
        finally:
            main.__spec__ = spec
            if file is not None:
                main.__file__ = file


class LazyVectorEnv(VectorEnv):
    """A synchronous or asynchronous vector environment that exists from its first use until `close`.

    LeRobot creates the vector environments of all tasks at once and evaluates them one after the other; this
    way only one task's environments hold processes and memory. It can be used again after `close`. Automatic
    resets happen at the step after an episode's end and leave the environment frozen, see `FreezeWhenOver`.

    Args:
        make_envs: one picklable factory per environment; all with the same spaces. The first is called here
            for its spaces and metadata.
        asynchronous: one process per environment instead of one after the other in this process.
    """

    def __init__(self, make_envs: Sequence[Callable[[], gym.Env]], *, asynchronous: bool):
        self._make_envs = [partial(_make_frozen, make_env) for make_env in make_envs]
        self._asynchronous = asynchronous
        self._running: SyncVectorEnv | AsyncVectorEnv | None = None
        self._lock = threading.Lock()
        example = make_envs[0]()
        self.num_envs = len(make_envs)
        self.metadata = {**example.metadata, "autoreset_mode": AutoresetMode.NEXT_STEP}
        self.render_mode = example.render_mode
        self.single_observation_space = example.observation_space
        self.single_action_space = example.action_space
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        example.close()

    def _ensure(self) -> SyncVectorEnv | AsyncVectorEnv:
        """Start the environments unless they run; LeRobot calls this by name to start the next task's early."""
        with self._lock:
            if self._running is None:
                if self._asynchronous:
                    multiprocessing.set_forkserver_preload(PRELOADED_IN_FORK_SERVER)
                    with _main_module_hidden():
                        self._running = AsyncVectorEnv(
                            self._make_envs, context="forkserver", autoreset_mode=AutoresetMode.NEXT_STEP
                        )
                else:
                    self._running = SyncVectorEnv(self._make_envs, autoreset_mode=AutoresetMode.NEXT_STEP)
            return self._running

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Start an episode in every environment; a single seed is counted up."""
        return self._ensure().reset(seed=seed, options=options)

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Step every environment; `actions` (num_envs, 16) or (num_envs, 18)."""
        return self._ensure().step(actions)

    def render(self) -> tuple[Any, ...] | None:
        """A frame of every environment."""
        return self._ensure().render()

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """Call a method, or get an attribute, of every environment."""
        return self._ensure().call(name, *args, **kwargs)

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """Get an attribute of every environment."""
        return self._ensure().get_attr(name)

    def set_attr(self, name: str, values: Any) -> None:
        """Set an attribute of every environment."""
        self._ensure().set_attr(name, values)

    def close(self, **kwargs: Any) -> None:
        """Close the environments and end their processes."""
        with self._lock:
            if self._running is not None:
                self._running.close(**kwargs)
                self._running = None
