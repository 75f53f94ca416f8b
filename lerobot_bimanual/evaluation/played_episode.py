"""One episode that was played: what is claimed of it, and the actions that prove it."""

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.results.action_text import actions_from_text
from lerobot_bimanual.results.hash_chain import first_difference

HASH = re.compile("[0-9a-f]{64}")


@dataclass(frozen=True)
class PlayedEpisode:
    """One episode.

    Attributes:
        seed: seed of the reset, in the split of the evaluation.
        variation: index of its variation.
        instruction: the sentence that the policy was given.
        success: whether it was solved at its end.
        first_met_tick: number of control ticks after which all conditions of success held for the first time, if only
            for a moment; None if they never did.
        failure: why it was not solved; empty after a success.
        ticks: control ticks that it took.
        keyposes: keyposes executed.
        start: SHA-256 of the simulation's state after the reset.
        actions: what the policy answered, as `action_text` writes it, one text for each run of actions of equal length;
            a refused answer is the last, and one that nobody could read has length 0.
        links: the beginnings of the hash chain's links, one per action.
        end: the chain's last link.

    Raises:
        ValueError: a value is impossible or contradicts another.
    """

    seed: int
    variation: int
    instruction: str
    success: bool
    first_met_tick: int | None
    failure: str
    ticks: int
    keyposes: int
    start: str
    actions: tuple[str, ...]
    links: str
    end: str

    def __post_init__(self) -> None:
        for name in ("seed", "variation", "ticks", "keyposes"):
            if getattr(self, name) < 0:
                raise ValueError(f"{name} is {getattr(self, name)}, but must not be negative")
        for name in ("start", "end"):
            if not HASH.fullmatch(getattr(self, name)):
                raise ValueError(f"{name} must be 64 hexadecimal digits")
        if bool(self.failure) == self.success:
            raise ValueError("there must be a failure just if there is no success")
        if self.success and self.first_met_tick is None:
            raise ValueError("first_met_tick must say when a success began")
        if self.first_met_tick is not None and not 0 <= self.first_met_tick <= self.ticks:
            raise ValueError("first_met_tick must be one of the episode's ticks")
        first_difference(self.links, self.links)

    def action_list(self) -> list[NDArray[np.float32]]:
        """The actions, one array each.

        Raises:
            ValueError: they cannot be read.
        """
        return [action for text in self.actions for action in actions_from_text(text)]
