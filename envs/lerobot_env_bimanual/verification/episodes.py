"""Replay of a policy's recorded episodes from their seeds and actions, without the policy."""

import functools
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.errors import BimanualError, InvalidAction
from lerobot_bimanual.results.episode import Episode, Proof
from lerobot_bimanual.results.evaluation import EvaluationRecord
from lerobot_bimanual.results.proof import first_difference
from lerobot_bimanual.results.protocols import RULES
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.options import EnvOptions
from lerobot_env_bimanual.vector.episode_recorder import PLAYED, EpisodeRecorder
from lerobot_env_bimanual.vector.hold_after_done import INVALID_ACTION, HoldAfterDone
from lerobot_env_bimanual.workers import WorkerPool

CLAIMS = ("variation", "success", "first_met_tick", "failure", "ticks", "keyposes", "load", "survived")
"""Fields of an episode that are compared one by one; its proof is compared step by step."""
REPLAY_OPTIONS = ("variation", "split", "setting", "perturb", "control_mode", *RULES)
"""Options that decide what happens; the others decide only what a policy sees."""

type Options = tuple[tuple[str, str | int], ...]


class EpisodeVerifier:
    """Replays the episodes of an evaluation in a `replay_env`.

    Attributes:
        env: the environment in which it replays; it may be observed.
    """

    def __init__(self, task: str, options: Mapping[str, str | int], **obs_options: Any):
        self.env = replay_env(task, options, **obs_options)
        self._recorder = HoldAfterDone(EpisodeRecorder(self.env))

    def __call__(self, episode: Episode) -> list[str]:
        """Differences between an episode and its replay; empty if it replays as recorded."""
        try:
            self._recorder.reset(seed=episode.seed)
            actions = recorded_actions(episode)
        except BimanualError as error:
            return [f"cannot be replayed: {error}"]
        if self.env.state_hash() != proof_of(episode).start:
            return ["another state at the start"]
        ticks, info = [0], {}
        for action in actions:
            unreadable = InvalidAction((episode.failure or "").removeprefix(INVALID_ACTION))
            *_, terminated, truncated, info = self._recorder.step(action if action.size else unreadable)
            ticks.append(self.env.progress.ticks)
            if terminated or truncated:
                break
        if PLAYED not in info:
            return [f"not over after its {len(actions)} actions, {ticks[-1]} ticks"]
        try:
            return [*_differences(episode, info[PLAYED], ticks)]
        except ValueError as error:
            return [f"cannot be compared: {error}"]


def map_episodes[Found](
    player: Callable[[str, Mapping[str, str | int]], Callable[[Episode], Found]],
    record: EvaluationRecord,
    episodes: Sequence[Episode],
    pool: WorkerPool,
    label: str,
    **how: Any,
) -> list[Found]:
    """What a player, made of task and options, finds in each of some episodes, in parallel and with a progress bar.

    `how` are further arguments of `WorkerPool.map`.
    """
    find = functools.partial(_find, player, record.task, tuple(record.options.items()))
    return [*pool.map(find, episodes, f"{record.task}: {label}", "episode", **how)]


@functools.lru_cache(maxsize=1)
def _kept(player: Callable[..., Any], task: str, options: Options) -> Callable[[Episode], Any]:
    """The player of this process, kept for the next episode of the same evaluation."""
    return player(task, dict(options))


def _find(player: Callable[..., Any], task: str, options: Options, episode: Episode) -> Any:
    return _kept(player, task, options)(episode)


def replay_env(task: str, options: Mapping[str, str | int], **obs_options: Any) -> BimanualEnv:
    """An environment that replays an evaluation, given its options; `obs_options` are options of the observations meanwhile."""
    usual = EnvOptions()
    keywords = {name: type(getattr(usual, name))(options[name]) for name in REPLAY_OPTIONS if name in options}
    return BimanualEnv(task, obs="state", **keywords, **obs_options)


def proof_of(episode: Episode) -> Proof:
    """The proof of an episode of an evaluation; every one has a proof."""
    assert episode.proof is not None
    return episode.proof


def recorded_actions(episode: Episode) -> list[NDArray[np.float32]]:
    """The actions of an episode.

    Raises:
        BimanualError: they cannot be read.
    """
    try:
        return proof_of(episode).action_list()
    except ValueError as error:
        raise BimanualError(f"seed {episode.seed}: {error}") from error


def _differences(recorded: Episode, replayed: Episode, ticks: list[int]) -> Iterator[str]:
    proof, again = proof_of(recorded), proof_of(replayed)
    step = first_difference(proof.links, again.links)
    if step is not None:
        yield _place(step, ticks)
    elif proof.end != again.end:
        yield "the end of the chain of state hashes differs, although all its links agree"
    elif len(proof.action_list()) != len(again.action_list()):  # the others are in the chain
        yield "further actions are recorded"
    claims = [(name, getattr(recorded, name), getattr(replayed, name)) for name in CLAIMS]
    for name, claimed, found in (*claims, ("instruction", proof.instruction, again.instruction)):
        if claimed != found:
            yield f"{name} is {claimed!r}, but {found!r} in the replay"


def _place(step: int, ticks: list[int]) -> str:
    spans = list(pairwise(ticks))
    if step >= len(spans):
        return f"the record continues after the episode's end at {ticks[-1]} ticks"
    first, last = spans[step]
    at = f"tick {last}" if last - first <= 1 else f"ticks {first + 1} to {last}"
    return f"another action or state at step {step}, {at}"
