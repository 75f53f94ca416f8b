"""What an episode remembers besides the state of its scene, and what its seed draws first."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lerobot_env_bimanual.options import SETTINGS, SPLITS, STANDARD
from lerobot_env_bimanual.task import TaskSpec, Variation

SUCCESS_TICKS = 10
"""Consecutive control ticks, half a second, that all conditions have to hold."""


@dataclass
class EpisodeProgress:
    """The running or finished episode.

    Attributes:
        seed: of the reset.
        variation: what was drawn or asked for.
        instruction: the sentence that a policy is given.
        rng: the episode's only source of randomness.
        prop_set: index of its set of props, of those of the task in the setting.
        draws: placements that the reset drew until one could be rehearsed.
        conditions: each condition's name and whether it is met now; between the ticks of a step those after the first
            that is not met are left out.
        ticks: control ticks so far.
        keyposes: keyposes executed so far.
        held_ticks: consecutive ticks up to now at which all conditions were met.
        first_met_tick: number of ticks after which they were all met for the first time; None as long as they were not.
        line_fallbacks: straight lines replaced by joint-space motions because an arm could not follow them.
        failure: what ended the episode, empty while nothing has.
        memory: what axes of perturbation remember of the episode, by their name; see `perturbations.axis.Moment`.
    """

    seed: int
    variation: Variation
    instruction: str
    rng: np.random.Generator
    prop_set: int = 0
    draws: int = 0
    conditions: dict[str, bool] = field(default_factory=dict)
    ticks: int = 0
    keyposes: int = 0
    held_ticks: int = 0
    first_met_tick: int | None = None
    line_fallbacks: int = 0
    failure: str = ""
    memory: dict[str, object] = field(default_factory=dict)

    @property
    def succeeded(self) -> bool:
        """Whether the conditions held long enough."""
        return self.held_ticks >= SUCCESS_TICKS and not self.failure

    @property
    def terminated(self) -> bool:
        """Whether the verdict is known."""
        return self.succeeded or bool(self.failure)

    def judge(self, conditions: dict[str, bool]) -> None:
        """Take the conditions after a tick into account, all of them or as far as the first that is not met."""
        self.conditions = conditions
        self.held_ticks = self.held_ticks + 1 if all(conditions.values()) else 0
        if self.held_ticks and self.first_met_tick is None:
            self.first_met_tick = self.ticks

    def info(self) -> dict[str, Any]:
        """What the environment tells besides its observation."""
        return {
            "is_success": self.succeeded,
            "conditions": dict(self.conditions),
            "failure": self.failure,
            "ticks": self.ticks,
            "line_fallbacks": self.line_fallbacks,
            "seed": self.seed,
            "instruction": self.instruction,
        }


def draw_episode(
    spec: TaskSpec, split: str, seed: int, fixed: int | None, setting: str = STANDARD
) -> EpisodeProgress:
    """An episode that has not begun: its variation, instruction, set of props and generator.

    All are always drawn, so that fixing a variation changes nothing else.

    Args:
        spec: of the task.
        split: "train", "val" or "test".
        seed: of the episode.
        fixed: index of the variation; None leaves it to the seed.
        setting: "standard" or "varied".
    """
    entropy = [SPLITS[split], spec.id, seed, SETTINGS[setting]]
    rng = np.random.default_rng(np.random.SeedSequence(entropy))
    drawn, sentence = int(rng.integers(len(spec.variations))), int(rng.integers(len(spec.instructions)))
    variation = spec.variations[drawn if fixed is None else fixed]
    prop_set = int(rng.integers(len(spec.prop_sets(setting))))
    return EpisodeProgress(seed, variation, spec.instructions_for(variation)[sentence], rng, prop_set)
