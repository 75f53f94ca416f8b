"""What is found out about an expert's episode beside its success: does it replay, are its keyframes found again?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.dataset.schema import state_hash_column
from lerobot_bimanual.keyframes import discover_keyframes
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.strain import Strain, StrainMeter
from lerobot_env_bimanual.replay import ReplayMode, replay

KEYFRAME_TOLERANCE_FRAMES = 2


@dataclass(frozen=True)
class Evidence:
    """What was found out about an episode.

    Attributes:
        keyframes_found: whether keyframe discovery on the recorded joint actions finds the ends of all keyposes,
            and nothing else, within `KEYFRAME_TOLERANCE_FRAMES`.
        replayed: whether a replay from the same seed went through the same states, bit for bit; None if none was
            tried.
        strain: what was asked of them.
    """

    keyframes_found: bool
    replayed: bool | None
    strain: Strain


class EvidenceRecorder:
    """Notes an environment's episode, from its first tick to its last.

    Args:
        env: the environment; it has to be `observed_by` the methods `note` and `note_step`.
    """

    def __init__(self, env: BimanualEnv):
        self._env = env
        self._actions: list[NDArray[np.float32]] = []
        self._hashes: list[str] = []
        self._strain = StrainMeter(env.scene)

    def note(self, env: BimanualEnv, joint_action: NDArray[np.float32]) -> None:
        """Note the state before a tick, and its action."""
        self._strain.observe_tick(joint_action)
        self._actions.append(joint_action.copy())
        self._hashes.append(env.state_hash())

    def note_step(self) -> None:
        """Note a step of physics."""
        self._strain.observe_step()

    def evidence(
        self,
        keyposes: Sequence[NDArray[np.float32]],
        ticks: Sequence[int],
        replay_mode: ReplayMode | Literal["none"],
    ) -> Evidence:
        """The evidence, after the episode has ended; the replay starts another one in the same environment.

        Args:
            keyposes: (18,) each, that were executed.
            ticks: how long each took.
            replay_mode: whether the episode is played again, and by what; every state is compared.
        """
        env, strain = self._env, self._strain.result()
        hashes = dict(enumerate(map(state_hash_column, [*self._hashes, env.state_hash()])))
        replayed = None
        if replay_mode != "none":
            actions = self._actions if replay_mode == "joint" else keyposes
            replayed = replay(env, env.progress.seed, env.variation, actions, hashes).matches
        return Evidence(_keyframes_found(np.array(self._actions), ticks), replayed, strain)


def _keyframes_found(actions: NDArray[np.float32], ticks: Sequence[int]) -> bool:
    found, expected = np.array(discover_keyframes(actions)), np.cumsum(ticks)
    return found.shape == expected.shape and bool(
        (np.abs(found - expected) <= KEYFRAME_TOLERANCE_FRAMES).all()
    )
