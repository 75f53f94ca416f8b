"""Failure attribution: at which keypose an episode was lost, and which arm is responsible.

A failed episode is replayed with a snapshot before every keypose. From each snapshot, the last one first, the expert takes
over with both arms: it plays the keyposes of its own episode of the same seed, from the same index on, in the remaining
time. The last keypose before which that succeeds is the one that lost the episode. At this keypose, the half of one arm
alone is then replaced by the expert's, before the expert continues with both arms.

If both arms follow another plan of the task at first, the expert follows that plan, too.

Under perturbations that move bodies after the start, the replanning expert takes over. It needs one keypose more; for a
policy that does without it, the keypose that is found may be one too late.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_bimanual.errors import BimanualError, InvalidAction
from lerobot_bimanual.keypose_layout import ARM_KEYPOSE_DIM, KEYPOSE_DIM
from lerobot_bimanual.results.episode import Episode
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.runner import replanning
from lerobot_env_bimanual.failures.agreement import common_plan
from lerobot_env_bimanual.failures.classes import FailureClass, classify
from lerobot_env_bimanual.failures.monitor import EpisodeEvents, EpisodeMonitor
from lerobot_env_bimanual.vector.hold_after_done import INVALID_ACTION
from lerobot_env_bimanual.verification.episodes import proof_of, recorded_actions, replay_env


class Responsible(StrEnum):
    """What is responsible for a failed episode."""

    LEFT = "left arm"
    RIGHT = "right arm"
    EITHER = "either arm"
    """A better keypose of either arm alone would have sufficed."""
    COORDINATION = "coordination"
    """Only better keyposes of both arms would have sufficed."""
    TIME = "time"
    """At the end of the episode the expert would still have solved it, with more time."""
    EXPERT_FAILS = "expert fails too"
    """The expert fails this episode as well, so nothing can be compared."""
    JOINT_ACTIONS = "joint actions"
    """The episode was not played by keyposes, so only its class is known."""


@dataclass(frozen=True)
class Attribution:
    """Why one episode failed.

    Attributes:
        seed: seed of the episode.
        variation: index of its variation.
        failure_class: class of the failure.
        event: the event that decided about the class.
        last_recoverable: index of the last keypose before which the expert could have taken over; None if unknown.
        reached: share of the expert's keyposes that come before that one, in [0, 1]; None if unknown.
        responsible: what is responsible.
    """

    seed: int
    variation: int
    failure_class: FailureClass
    event: str
    last_recoverable: int | None
    reached: float | None
    responsible: Responsible


class FailureAttributor:
    """Attributes the failed episodes of an evaluation with these options."""

    def __init__(self, task: str, options: Mapping[str, str | int]):
        self._env = self._expert_env = replay_env(task, options)
        if options.get("control_mode") == "joint":  # in which the expert cannot play
            self._expert_env = replay_env(task, {**options, "control_mode": "auto"})
        self._expert: list[NDArray[np.float32]] = []

    def __call__(self, episode: Episode) -> Attribution:
        """Why a failed episode failed.

        Raises:
            BimanualError: the replay differs from the record.
        """
        kind, event, states, expert_solves = self._classified(episode)
        actions = recorded_actions(episode)
        index, responsible = None, Responsible.EXPERT_FAILS
        is_joint = self._env is not self._expert_env  # which refuses keyposes
        if is_joint or any(action.size not in (0, KEYPOSE_DIM) for action in actions):
            responsible = Responsible.JOINT_ACTIONS
        elif expert_solves:
            index, responsible = self._search(actions, states)
        return Attribution(
            seed=episode.seed,
            variation=episode.variation or 0,
            failure_class=kind,
            event=event,
            last_recoverable=index,
            reached=None if index is None else min(1.0, index / len(self._expert)),
            responsible=responsible,
        )

    def failure_class(self, episode: Episode) -> FailureClass:
        """The class of a failed episode alone, without the search; errors as above."""
        return self._classified(episode)[0]

    def _classified(self, episode: Episode) -> tuple[FailureClass, str, list[Any], bool]:
        """Class and event of a failed episode, its states, and whether the expert solves it."""
        self._reset(episode, self._expert_env)
        moves = replanning(plan=common_plan(self._expert_env, episode))(self._expert_env)
        self._expert, _, expert_events = self._play(self._expert_env, (move.action for move in moves))
        expert_solves = self._expert_env.progress.succeeded
        self._reset(episode, self._env)
        _, states, events = self._play(self._env, recorded_actions(episode), episode.failure or "")
        if self._env.progress.ticks != episode.ticks or self._env.progress.succeeded:
            raise BimanualError(
                f"seed {episode.seed} replays otherwise than recorded; `lerobot-bimanual results verify` says where"
            )
        return *classify(self._env.task, events, expert_events), states, expert_solves

    def _reset(self, episode: Episode, env: BimanualEnv) -> None:
        env.reset(seed=episode.seed, options={"variation": episode.variation})
        if env.state_hash() != proof_of(episode).start:
            raise BimanualError(
                f"seed {episode.seed} starts in another state here; `lerobot-bimanual results verify` says more"
            )

    def _play(
        self, env: BimanualEnv, actions: Iterable[NDArray[np.float32]], failure: str = ""
    ) -> tuple[list[NDArray[np.float32]], list[Any], EpisodeEvents]:
        """The actions until the episode is over, states before each of them and at the end, and the events."""
        played, states, monitor = list[NDArray[np.float32]](), [env.save_state()], EpisodeMonitor(env)
        with env.observed_by(monitor.note, monitor.note_step):
            for action in actions:
                played.append(action)
                try:
                    _, _, terminated, truncated, _ = env.step(action)
                except InvalidAction as error:
                    reason = f"{INVALID_ACTION}{error}" if action.size else failure
                    _, _, terminated, truncated, _ = env.fail(reason)
                states.append(env.save_state())
                if terminated or truncated:
                    break
        return played, states, monitor.events()

    def _search(
        self, actions: list[NDArray[np.float32]], states: list[Any]
    ) -> tuple[int | None, Responsible]:
        """The last recoverable keypose, and what is responsible."""
        end, count = states[-1], len(actions)
        if not end[1].failure:
            end[1].ticks = end[1].keyposes = 0  # only time ended the episode, so more time is given
            if self._recovers(end, self._expert_from(count)):
                return count, Responsible.TIME
        backwards = reversed(range(count))
        last = next(index for index in backwards if self._recovers(states[index], self._expert_from(index)))
        better, afterwards = self._expert_from(last)[0], self._expert_from(last + 1)
        left, right = (
            self._recovers(states[last], [_replaced(actions[last], better, arm), *afterwards]) for arm in ARMS
        )
        responsible = {
            (True, True): Responsible.EITHER,
            (True, False): Responsible.LEFT,
            (False, True): Responsible.RIGHT,
            (False, False): Responsible.COORDINATION,
        }
        return last, responsible[left, right]

    def _expert_from(self, index: int) -> list[NDArray[np.float32]]:
        """The expert's keyposes from an index on; beyond its last one it repeats that."""
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


def _replaced(keypose: NDArray[np.float32], by: NDArray[np.float32], arm: Arm) -> NDArray[np.float32]:
    """A keypose (18,) with one arm's half taken from another; an unreadable one is left as it is."""
    if keypose.size != KEYPOSE_DIM:
        return keypose
    mixed = keypose.copy()
    half = slice(arm.ordinal * ARM_KEYPOSE_DIM, (arm.ordinal + 1) * ARM_KEYPOSE_DIM)
    mixed[half] = by[half]
    return mixed
