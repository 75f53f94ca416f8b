"""What is the same for every policy: how much it is shown, and on how much it is scored."""

from dataclasses import dataclass
from typing import Literal

ScoredSplit = Literal["val", "test"]
RecipeName = Literal["small", "paper"]


@dataclass(frozen=True)
class Protocol:
    """The numbers of a benchmark that are no matter of training.

    Attributes:
        demos: expert demonstrations of the split `train`.
        image_size: side of the images in pixels, in the demonstrations and in the evaluations.
        val_episodes: episodes of the split `val` on which every checkpoint is scored, to choose the best; 0 where
            there is nothing to choose, because there is only one.
        test_episodes: episodes of the split `test` on which the chosen checkpoint is scored.
        intermediate: where on the way to a keypose observations are kept in the view `keyframes`, as fractions of the
            motion. The paper keeps every tenth frame. They are seen with the label of the keypose that the hand is
            nearly at, which teaches a small network to stay where it is (docs/learning.md).
    """

    demos: int
    image_size: int
    val_episodes: int
    test_episodes: int
    intermediate: tuple[float, ...]


PROTOCOLS = {
    "small": Protocol(demos=100, image_size=128, val_episodes=20, test_episodes=50, intermediate=()),
    "paper": Protocol(
        demos=100, image_size=256, val_episodes=100, test_episodes=100, intermediate=(0.35, 0.7)
    ),
}
"""By the name of the recipe; the second is that of the PerAct2 paper."""
