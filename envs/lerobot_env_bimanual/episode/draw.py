"""What a seed draws before anything is placed."""

from __future__ import annotations

import numpy as np

from lerobot_env_bimanual.episode.progress import EpisodeProgress
from lerobot_env_bimanual.options import SPLITS
from lerobot_env_bimanual.task import TaskSpec


def draw_episode(spec: TaskSpec, split: str, seed: int, fixed: int | None) -> EpisodeProgress:
    """An episode that has not begun: its variation, instruction and generator.

    Both are always drawn, so that fixing a variation changes nothing else.

    Args:
        spec: of the task.
        split: "train", "val" or "test".
        seed: of the episode.
        fixed: index of the variation; None leaves it to the seed.
    """
    rng = np.random.default_rng(np.random.SeedSequence([SPLITS[split], spec.id, seed]))
    drawn, sentence = int(rng.integers(len(spec.variations))), int(rng.integers(len(spec.instructions)))
    variation = spec.variations[drawn if fixed is None else fixed]
    return EpisodeProgress(seed, variation, spec.instructions_for(variation)[sentence], rng)
