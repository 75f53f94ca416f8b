"""One played episode: what became of it, and, where it was recorded, what proves it."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field, NonNegativeFloat, NonNegativeInt

from lerobot_bimanual.results.proof import MAX_ACTIONS, MAX_NUMBERS, actions_from_text
from lerobot_bimanual.results.record import Record, require
from lerobot_bimanual.results.statistics import SuccessRate

Sha256 = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
StateHash = Annotated[str, Field(pattern="^([0-9a-f]{16}|[0-9a-f]{64})$")]
"""SHA-256 of a state of the simulation, or its first 16 hexadecimal digits."""


MAX_EPISODES = 100_000
"""A larger number is a mistake, and a list of so many seeds would fill the memory."""
EpisodeCount = Annotated[int, Field(ge=1, le=MAX_EPISODES)]


class Proof(Record):
    """All that is needed to play an episode again without the policy, and to compare every state on the way.

    Attributes:
        instruction: the sentence that the policy was given.
        start: SHA-256 of the simulation's state after the reset.
        actions: the policy's actions, as `results.proof` writes them: one text for each run of actions of equal length.
            A refused action is the last; one that could not be read has length 0.
        links: the beginnings of the hash chain's links, one per action.
        end: the chain's last link.
    """

    instruction: str
    start: Sha256
    actions: tuple[str, ...]
    links: str
    end: Sha256

    def action_list(self) -> list[NDArray[np.float32]]:
        """The actions, one array each.

        Raises:
            ValueError: they cannot be read.
        """
        actions, numbers = list[NDArray[np.float32]](), 0
        for text in self.actions:
            found = actions_from_text(text)
            actions.extend(found)
            numbers += found.size
            if len(actions) > MAX_ACTIONS or numbers > MAX_NUMBERS:
                raise ValueError(f"{len(actions)} actions of {numbers} numbers are more than any episode has")
        return actions


class LoadMetrics(Record):
    """Peak loads of the arms in an episode, or in several.

    Attributes:
        torque: largest motor torque, gravity included, over its limit.
        saturated: share of the time in which any motor was at its limit.
        velocity: largest commanded joint velocity over its limit.
        acceleration: largest commanded joint acceleration over its limit.
        jerk: largest commanded joint jerk over its limit.
        contact_force_n: largest force between an arm and its surroundings, filtered.
        finger_speed_m_s: speed of the fastest finger.
        penetration_mm: deepest penetration of two bodies.
        penetrating: those two bodies; empty if none touched.
    """

    torque: NonNegativeFloat
    saturated: NonNegativeFloat
    velocity: NonNegativeFloat
    acceleration: NonNegativeFloat
    jerk: NonNegativeFloat
    contact_force_n: NonNegativeFloat
    finger_speed_m_s: NonNegativeFloat
    penetration_mm: NonNegativeFloat
    penetrating: str


class Episode(Record):
    """One played episode. What was not recorded is None.

    Attributes:
        seed: seed of the reset; its split is said by the record that holds the episode.
        variation: index of the variation.
        success: whether the episode was solved at its end.
        failure: why it was not solved; None after a success.
        ticks: control ticks that it took.
        keyposes: keyposes executed.
        first_met_tick: number of control ticks after which all conditions of success held for the first time, if only
            for a moment; None if they never did, or if that was not recorded.
        state_hash: SHA-256 of the final state, or its first 16 hexadecimal digits.
        load: loads of the arms; of an expert only where it was solved.
        survived: whether real arms would have survived: no force, velocity or acceleration was beyond their limits.
        proof: how to play the episode again.
    """

    seed: NonNegativeInt
    variation: NonNegativeInt | None = None
    success: bool
    failure: Annotated[str, Field(min_length=1)] | None = None
    ticks: NonNegativeInt | None = None
    keyposes: NonNegativeInt | None = None
    first_met_tick: NonNegativeInt | None = None
    state_hash: StateHash | None = None
    load: LoadMetrics | None = None
    survived: bool | None = None
    proof: Proof | None = None


def _ascending(episodes: tuple[Episode, ...]) -> tuple[Episode, ...]:
    seeds = [episode.seed for episode in episodes]
    is_rising = seeds and seeds == sorted(set(seeds))
    require(is_rising, "episodes must be non-empty with strictly increasing seeds")
    return episodes


def _proved(episodes: tuple[Episode, ...]) -> tuple[Episode, ...]:
    for episode in episodes:
        whole = episode.proof is not None and bool(episode.failure) != episode.success
        require(
            whole, f"the episode of seed {episode.seed} must have a proof, and a failure unless it was solved"
        )
    return episodes


Episodes = Annotated[tuple[Episode, ...], AfterValidator(_ascending)]
"""Episodes of one task with strictly increasing seeds."""
ProvedEpisodes = Annotated[Episodes, AfterValidator(_proved)]
"""Episodes of one task that can be played again."""


def success_rate(episodes: Sequence[Episode]) -> SuccessRate:
    """Successes among episodes."""
    return SuccessRate(sum(episode.success for episode in episodes), len(episodes))


def survival_rate(episodes: Sequence[Episode]) -> SuccessRate | None:
    """Episodes that real arms would have gone through; None if that was not recorded."""
    known = [episode.survived for episode in episodes if episode.survived is not None]
    return SuccessRate(sum(known), len(known)) if known else None
