"""One recorded demonstration, independent of how it is stored."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

CONTROL_HZ = 20
"""Control ticks per second; one tick is one dataset frame (RLBench records one observation per 0.05 s)."""


@dataclass(frozen=True)
class EpisodeMeta:
    """What an episode is.

    Attributes:
        task: Registered task name.
        variation: Variation index.
        split: "train", "val" or "test".
        seed: The integer that, with task and split, determines every state bit for bit.
        instruction: The sentence given to the policy.
    """

    task: str
    variation: int
    split: str
    seed: int
    instruction: str


@dataclass(frozen=True)
class Step:
    """One control tick.

    Attributes:
        observation: Dataset key -> array, seen before the tick. Images may be missing from rows that no view
            stores.
        action: (16,) float32 joint action applied during the tick.
        stage: Index of the keypose being executed, which is also the number of keyposes completed.
        keyframe: Whether this is the first observation after a completed keypose, or the last of the episode.
        state_hash: First 64 bits of the simulation state's hash after the tick, as a signed integer.
    """

    observation: dict[str, NDArray]
    action: NDArray[np.float32]
    stage: int
    keyframe: bool
    state_hash: int


@dataclass
class Episode:
    """A finished demonstration.

    Attributes:
        meta: What the episode is.
        keyposes: (stages, 18) float32, the keypose commanded in each stage.
        steps: One entry per control tick.
        final_observation: Observation after the last tick.
    """

    meta: EpisodeMeta
    keyposes: NDArray[np.float32]
    steps: list[Step] = field(default_factory=list)
    final_observation: dict[str, NDArray] = field(default_factory=dict)
