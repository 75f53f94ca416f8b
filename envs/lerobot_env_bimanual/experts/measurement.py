"""An expert's episode with measurements: loads of the arms, keyframes found again, and a bit-exact replay."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.dataset.schema import state_hash_column
from lerobot_bimanual.keyframes import discover_keyframes
from lerobot_bimanual.results.expert_report import EpisodeOutcome
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.load import LoadMeter
from lerobot_env_bimanual.experts.runner import Player, run_episode
from lerobot_env_bimanual.replay import ReplayMode, replay

KEYFRAME_TOLERANCE_FRAMES = 2


def run_measured(
    env: BimanualEnv, seed: int, player: Player, replay_mode: ReplayMode | Literal["none"] = "none"
) -> EpisodeOutcome:
    """Play one episode of an expert, and measure it if it is solved.

    Args:
        env: environment whose control mode takes keyposes.
        seed: seed of the reset.
        player: an expert.
        replay_mode: whether a solved episode is played again, by its joint actions or its keyposes; every state is
            compared. The replay starts another episode in the same environment.
    """
    meter, actions, hashes = LoadMeter(env.scene), list[NDArray[np.float32]](), list[str]()
    keyposes: list[NDArray[np.float32]] = []

    def note(env: BimanualEnv, joint_action: NDArray[np.float32]) -> None:
        meter.observe_tick(joint_action)
        actions.append(joint_action.copy())
        hashes.append(env.state_hash())

    with env.observed_by(note, meter.observe_step):
        outcome = run_episode(env, seed, player, lambda move: keyposes.append(move.action))
    if not outcome.success:
        return outcome
    load, replayed = meter.result(), None
    if replay_mode != "none":
        columns = dict(enumerate(map(state_hash_column, [*hashes, env.state_hash()])))
        replayed = replay(
            env, seed, env.variation, actions if replay_mode == "joint" else keyposes, columns
        ).matches
    return outcome.model_copy(
        update={
            "load": load,
            "keyframes_found": keyframes_found(np.array(actions), [move.ticks for move in outcome.moves]),
            "replayed": replayed,
        }
    )


def keyframes_found(joint_actions: NDArray[np.float32], ticks: list[int]) -> bool:
    """Whether keyframe discovery on joint actions (n, 16) finds the ends of keyposes of these ticks, and nothing else.

    An end counts as found within `KEYFRAME_TOLERANCE_FRAMES`.
    """
    found, expected = np.array(discover_keyframes(joint_actions)), np.cumsum(ticks)
    return found.shape == expected.shape and bool(
        (np.abs(found - expected) <= KEYFRAME_TOLERANCE_FRAMES).all()
    )
