"""A recorded demonstration, independent of how it is stored."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class EpisodeMeta:
    """What an episode is: task, variation, split and seed determine every state bit for bit.

    Attributes:
        split: "train", "val" or "test".
        instruction: the sentence given to the policy.
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
        observation: dataset key -> vector, seen before the tick.
        action: (16,) float32 joint action applied during the tick.
        stage: index of the keypose being executed, which is also the number of keyposes completed.
        state_hash: first 64 bits of the simulation state's hash after the tick, as a signed integer.
    """

    observation: dict[str, NDArray]
    action: NDArray[np.float32]
    stage: int
    state_hash: int


@dataclass(frozen=True)
class Demonstration:
    """A finished demonstration.

    A demonstration of T ticks has T + 1 observations; row t is the one before tick t, row T the last one.

    Attributes:
        meta: what the episode is.
        keyposes: (stages, 18) float32, the keypose commanded in each stage.
        steps: one entry per control tick; at least one.
        final_observation: vectors of row T.
        images: gives the images of a row, dataset key -> RGB uint8 (H, W, 3) or depth float32 (1, H, W) in
            millimetres, as the environment emits them. They are requested row by row, so that no caller renders
            rows that no view stores, and an episode never has to fit into memory with all its images.
        further: further columns, the same in every row: what became of a policy's episode, or a demonstration's plan.
    """

    meta: EpisodeMeta
    keyposes: NDArray[np.float32]
    steps: tuple[Step, ...]
    final_observation: dict[str, NDArray]
    images: Callable[[int], dict[str, NDArray]]
    further: dict[str, NDArray | str] = field(default_factory=dict)

    @property
    def rows(self) -> int:
        """Number of observations, T + 1."""
        return len(self.steps) + 1

    def stage_starts(self) -> list[int]:
        """Rows with the first observation of each stage, row 0 included."""
        stages = [step.stage for step in self.steps]
        return [row for row, stage in enumerate(stages) if row == 0 or stage != stages[row - 1]]
