"""How episodes ended, and which of several checkpoints solved most of them."""

from collections.abc import Sequence
from dataclasses import dataclass

from lerobot_bimanual.evaluation.played_episode import PlayedEpisode
from lerobot_bimanual.results.statistics import SuccessRate


@dataclass(frozen=True)
class EpisodeResult:
    """How one episode ended, of which nothing else is kept.

    Attributes:
        seed: seed of the reset, in the split of the row.
        success: whether it was solved.
        variation: index of the variation; None if the evaluation does not tell (`lerobot-eval` does not).
        failure: why it was not solved; None if the evaluation does not tell, or if it was.
        state_hash: SHA-256 of the simulation's final state; None if the evaluation does not tell.
    """

    seed: int
    success: bool
    variation: int | None = None
    failure: str | None = None
    state_hash: str | None = None


@dataclass(frozen=True)
class Validation:
    """Episodes of the validation split with one checkpoint."""

    step: int
    episodes: tuple[EpisodeResult, ...]


def best_checkpoint(validations: Sequence[Validation]) -> Validation:
    """The checkpoint that solved most validation episodes; of equals the one trained longest."""
    return max(validations, key=lambda validation: (success_rate(validation.episodes).rate, validation.step))


def success_rate(episodes: Sequence[EpisodeResult] | Sequence[PlayedEpisode]) -> SuccessRate:
    """Successes among episodes."""
    return SuccessRate(sum(episode.success for episode in episodes), len(episodes))
