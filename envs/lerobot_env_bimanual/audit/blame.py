"""Which keypose lost an episode, and which arm's half of it.

A failed episode is played again with a snapshot before every keypose. From each of them, the last one first, the expert
takes over with both arms: it plays the keyposes of its own episode of the same seed, from the same number on, with the
time that is left. The last keypose before which that succeeds is the one that lost the episode. Of this keypose then one
arm's half alone is replaced by the expert's, before the expert goes on with both.

Where things are moved after the start, the expert is the one that reads the scene again. That takes it a keypose more, so a
policy that goes on without it may be saved one keypose later than it was lost.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_bimanual.errors import BimanualError, InvalidAction
from lerobot_bimanual.keypose import ARM_KEYPOSE_DIM, KEYPOSE_DIM
from lerobot_bimanual.results.episode import Episode
from lerobot_env_bimanual.audit.episodes import expert_env, played_env, proof_of
from lerobot_env_bimanual.audit.failure_class import FailureClass, failure_class
from lerobot_env_bimanual.audit.witness import EpisodeFacts, EpisodeWitness
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.replanning import expert_of
from lerobot_env_bimanual.vector.hold_after_done import INVALID_ACTION


class Loser(StrEnum):
    """Who lost an episode."""

    LEFT = "left arm"
    RIGHT = "right arm"
    EITHER = "either arm"
    """Better keyposes of any one arm would have sufficed."""
    COORDINATION = "coordination"
    """Only better keyposes of both arms would have sufficed."""
    NOBODY = "nobody"
    """Even when it was over the expert would have solved it, with more time."""
    NOT_EVEN_EXPERT = "not even expert"
    """The expert fails this episode, too, so there is nothing to compare with."""
    NOT_KEYPOSES = "not by keyposes"
    """Played by joint actions, of which only the class can be told."""


@dataclass(frozen=True)
class Blame:
    """Why one episode failed.

    Attributes:
        seed: of the episode.
        variation: index of its variation.
        failure_class: kind of failure.
        fact: what decided about it.
        keyposes: actions that the policy gave.
        last_recoverable: index of the last keypose before which the expert could still have taken over.
        loser: who lost it.
        recovers: whether the episode is solved if at that keypose the left, or the right, arm's half is replaced.
    """

    seed: int
    variation: int
    failure_class: FailureClass
    fact: str
    keyposes: int
    last_recoverable: int | None
    loser: Loser
    recovers: tuple[bool, bool] | None


class Blamer:
    """Finds out why the episodes of one evaluation failed.

    Args:
        task: name of the task.
        options: of the evaluation, by name.
    """

    def __init__(self, task: str, options: Mapping[str, str | int]):
        self._env = played_env(task, options)
        refuses_keyposes = options.get("control_mode") == "joint"
        self._expert_env = expert_env(task, options) if refuses_keyposes else self._env
        self._expert: list[NDArray[np.float32]] = []

    def blame(self, played: Episode) -> Blame:
        """Why a failed episode failed.

        Raises:
            BimanualError: it does not come out as recorded.
        """
        self._start(played, self._expert_env)
        expert_facts, expert_solves = self._play_expert()
        self._start(played, self._env)
        actions = _readable(played)
        states, facts = self._play(actions, played.failure or "")
        if self._env.progress.ticks != played.ticks or self._env.progress.succeeded:
            raise BimanualError(
                f"seed {played.seed} does not come out as recorded; `verify-results` says where"
            )
        kind, fact = failure_class(self._env.task, facts, expert_facts)
        index, loser, recovers = None, Loser.NOT_EVEN_EXPERT, None
        if any(action.size not in (0, KEYPOSE_DIM) for action in actions):
            loser = Loser.NOT_KEYPOSES
        elif expert_solves:
            index, loser, recovers = self._search(actions, states)
        return Blame(
            seed=played.seed,
            variation=played.variation or 0,
            failure_class=kind,
            fact=fact,
            keyposes=len(actions),
            last_recoverable=index,
            loser=loser,
            recovers=recovers,
        )

    def close(self) -> None:
        """Free the world."""
        self._env.close()
        self._expert_env.close()

    def _start(self, played: Episode, env: BimanualEnv) -> None:
        env.reset(seed=played.seed, options={"variation": played.variation})
        if env.state_hash() != proof_of(played).start:
            raise BimanualError(
                f"seed {played.seed} starts in another state here; `verify-results` says more"
            )

    def _play_expert(self) -> tuple[EpisodeFacts, bool]:
        env, self._expert = self._expert_env, []
        witness = EpisodeWitness(env)
        with env.observed_by(witness.note, witness.note_step):
            for move in expert_of(env)(env):
                self._expert.append(move.action)
                _, _, terminated, truncated, _ = env.step(move.action)
                if terminated or truncated:
                    break
        return witness.facts(), env.progress.succeeded

    def _play(self, actions: Iterable[NDArray[np.float32]], failure: str) -> tuple[list[Any], EpisodeFacts]:
        """States before every action and at the end, and what happened."""
        env, states = self._env, [self._env.save_state()]
        witness = EpisodeWitness(env)
        with env.observed_by(witness.note, witness.note_step):
            for action in actions:
                try:
                    env.step(action)
                except InvalidAction as error:
                    env.fail(failure if not action.size else f"{INVALID_ACTION}{error}")
                states.append(env.save_state())
        return states, witness.facts()

    def _search(
        self, actions: list[NDArray[np.float32]], states: list[Any]
    ) -> tuple[int | None, Loser, tuple[bool, bool] | None]:
        """The last recoverable keypose, who lost it, and whether the left or the right half would have sufficed."""
        end, count = states[-1], len(actions)
        if not end[1].failure:
            end[1].ticks = end[1].keyposes = 0  # only time ended it, so let there be more
            if self._recovers(end, self._expert_from(count)):
                return count, Loser.NOBODY, None
        last = next(
            index
            for index in reversed(range(count))
            if self._recovers(states[index], self._expert_from(index))
        )
        left, right = (
            self._recovers(
                states[last],
                [_replaced(actions[last], self._expert_from(last)[0], arm), *self._expert_from(last + 1)],
            )
            for arm in ARMS
        )
        losers = {
            (True, True): Loser.EITHER,
            (True, False): Loser.LEFT,
            (False, True): Loser.RIGHT,
            (False, False): Loser.COORDINATION,
        }
        return last, losers[left, right], (left, right)

    def _expert_from(self, index: int) -> list[NDArray[np.float32]]:
        """What the expert does from a keypose on; after its last one it repeats that."""
        return self._expert[min(index, len(self._expert) - 1) :]

    def _recovers(self, state: Any, actions: Iterable[NDArray[np.float32]]) -> bool:
        """Whether actions solve the episode from a state on."""
        env = self._env
        env.restore_state(state)
        for action in actions:
            try:
                _, _, terminated, truncated, _ = env.step(action)
            except InvalidAction:
                return False
            if terminated or truncated:
                break
        return env.progress.succeeded


def _readable(played: Episode) -> list[NDArray[np.float32]]:
    try:
        return proof_of(played).action_list()
    except ValueError as error:
        raise BimanualError(f"seed {played.seed}: {error}") from error


def _replaced(keypose: NDArray[np.float32], by: NDArray[np.float32], arm: Arm) -> NDArray[np.float32]:
    """A keypose (18,) whose half of one arm is another's; one that nobody could read is left as it is."""
    if keypose.size != KEYPOSE_DIM:
        return keypose
    mixed = keypose.copy()
    half = slice(arm.ordinal * ARM_KEYPOSE_DIM, (arm.ordinal + 1) * ARM_KEYPOSE_DIM)
    mixed[half] = by[half]
    return mixed
