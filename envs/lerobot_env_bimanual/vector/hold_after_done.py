"""A wrapper that holds the last transition of a finished episode, while other environments of its batch go on."""

import copy
from dataclasses import dataclass
from typing import Any

import gymnasium as gym

from lerobot_bimanual.errors import InvalidAction

INVALID_ACTION = "invalid action: "
"""Prefix of the failure of an episode that ended with an invalid action."""


@dataclass(frozen=True)
class SkippedEpisode:
    """Takes the place of an action in an episode that is not played, and ends it."""

    success: bool
    """Whether it was solved when it was played."""


class HoldAfterDone(gym.Wrapper):
    """Repeats the last transition of a finished episode until the next explicit reset.

    A batched rollout goes on until its slowest episode ends and ignores the others meanwhile, so a finished environment
    has no reason to simulate another episode. Gymnasium's automatic reset calls `reset` without arguments, which no
    explicit reset of a vector environment does; it keeps the last transition.
    """

    def __init__(self, env: gym.Env):
        super().__init__(env)
        self._begun: tuple[Any, dict[str, Any]] | None = None
        self._last: tuple[Any, float, bool, bool, dict[str, Any]] | None = None
        self._last_frame: Any = None

    def reset(self, **arguments: Any) -> tuple[Any, dict[str, Any]]:
        """Start an episode, or repeat the last observation if this is an automatic reset."""
        if self._last is not None and not arguments:
            return self._last[0], self._last[4]
        self._last = self._last_frame = None
        self._begun = self.env.reset(**arguments)
        return self._begun

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """One step, or the last transition again, without its reward.

        An action that cannot be executed ends the episode as a failure; an `InvalidAction` in its place does so with its own
        text, and `SkippedEpisode` ends it at once.
        """
        if self._last is not None:
            return self._last
        if isinstance(action, SkippedEpisode) and self._begun is not None:
            observation, info = self._begun
            self._last = (observation, 0.0, True, False, info | {"is_success": action.success})
            return observation, float(action.success), *self._last[2:]
        try:
            if isinstance(action, InvalidAction):
                raise action
            observation, reward, terminated, truncated, info = self.env.step(action)
        except InvalidAction as error:
            fail = self.env.get_wrapper_attr("fail")
            observation, reward, terminated, truncated, info = fail(f"{INVALID_ACTION}{error}")
        if terminated or truncated:
            self._last = (observation, 0.0, terminated, truncated, info)
        return observation, float(reward), terminated, truncated, info

    def render(self) -> Any:
        """A frame; of a finished episode a copy of its last one, as LeRobot renders every environment to the end."""
        if self._last is None:
            return self.env.render()
        if self._last_frame is None:
            self._last_frame = self.env.render()
        return copy.copy(self._last_frame)
