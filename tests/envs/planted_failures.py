"""Episodes of the expert with one planted error, recorded as in an evaluation."""

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from itertools import chain, repeat

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.results.episode import Episode
from lerobot_bimanual.results.evaluation import EvaluationRecord
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.runner import Player, expert, run_episode
from lerobot_env_bimanual.experts.world_version import world_version
from lerobot_env_bimanual.vector.episode_recorder import PLAYED, EpisodeRecorder
from lerobot_env_bimanual.vector.hold_after_done import HoldAfterDone

Keyposes = NDArray[np.float32]
Change = Callable[[Keyposes], Keyposes]
SEED = 40_001
EXPERT = expert()


@cache
def expert_keyposes(task: str, player: Player = EXPERT, seed: int = SEED, perturb: str = "") -> Keyposes:
    """Keyposes (n, 18) of the expert, or of another player, in variation 0."""
    env, moves = BimanualEnv(task, obs="state", perturb=perturb), []
    run_episode(env, seed, player, moves.append, variation=0)
    return np.array([move.action for move in moves])


def shifted(index: int | slice, column: int | list[int], by: float, kept: bool = True) -> Change:
    """An error: these columns of these keyposes are off by `by`, or have this value if `kept` is false."""

    def change(keyposes: Keyposes) -> Keyposes:
        changed = keyposes.copy()
        changed[index, column] = kept * changed[index, column] + by
        return changed

    return change


def from_on(index: int, column: int, value: float) -> Change:
    """An error: one number has another value from one keypose on."""
    return shifted(slice(index, None), column, value, kept=False)


def reproved(episode: Episode, **changes: object) -> Episode:
    """An episode whose proof has other values."""
    assert episode.proof is not None
    return episode.model_copy(update={"proof": episode.proof.model_copy(update=changes)})


def evaluation(task: str, options: Mapping[str, str | int], *episodes: Episode) -> EvaluationRecord:
    """The record of an evaluation of these episodes in the installed world."""
    return EvaluationRecord(
        schema_version=2,
        task=task,
        world=world_version(task, str(options.get("perturb", ""))),
        options=dict(options),
        batch_size=1,
        versions={"numpy": "1"},
        episodes=episodes,
    )


def played(task: str, actions: Sequence[NDArray] | Keyposes, seed: int = SEED, perturb: str = "") -> Episode:
    """The recorded episode of these actions; the last one is repeated until it is over."""
    recorder = HoldAfterDone(EpisodeRecorder(BimanualEnv(task, obs="state", perturb=perturb)))
    recorder.reset(seed=seed, options={"variation": 0})
    info, left = {}, chain(actions, repeat(actions[-1]))
    while PLAYED not in info:
        info = recorder.step(next(left))[4]
    return info[PLAYED]
