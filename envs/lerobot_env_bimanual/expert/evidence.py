"""What is found out about an expert's episode beside its success: does it replay, are its keyframes found again?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.keyframes import discover_keyframes
from lerobot_env_bimanual.expert.coupling import Coupling, CouplingMeter

if TYPE_CHECKING:
    from lerobot_env_bimanual.env import BimanualEnv

type ReplayMode = Literal["none", "joint", "keypose"]

KEYFRAME_TOLERANCE_FRAMES = 2


@dataclass(frozen=True)
class Evidence:
    """What was found out about an episode.

    Attributes:
        keyframes_found: whether keyframe discovery on the recorded joint actions finds the ends of all keyposes,
            and nothing else, within `KEYFRAME_TOLERANCE_FRAMES`.
        replayed: whether a replay from the same seed went through the same states, bit for bit; None if none was
            tried.
        coupling: how the two arms depended on each other.
    """

    keyframes_found: bool
    replayed: bool | None
    coupling: Coupling

    @classmethod
    def from_dict(cls, fields: dict[str, Any]) -> Evidence:
        """The evidence that `dataclasses.asdict` has taken apart."""
        return cls(fields["keyframes_found"], fields["replayed"], Coupling(**fields["coupling"]))


class Witness:
    """Watches an environment's episode, from its first tick to its last; use it in a `with` statement.

    Args:
        env: the environment; its ticks are observed meanwhile.
    """

    def __init__(self, env: BimanualEnv):
        self._env = env
        self._actions: list[NDArray[np.float32]] = []
        self._hashes: list[str] = []
        self._meter = CouplingMeter(env.scene)

    def __enter__(self) -> Witness:
        self._env.tick_observers.append(self._note)
        return self

    def __exit__(self, *_: object) -> None:
        self._env.tick_observers.remove(self._note)

    def _note(self, env: BimanualEnv, joint_action: NDArray[np.float32]) -> None:
        """Called before every tick."""
        self._meter.observe()
        self._actions.append(joint_action.copy())
        self._hashes.append(env.state_hash())

    def testify(
        self, keyposes: Sequence[NDArray[np.float32]], ticks: Sequence[int], replay: ReplayMode
    ) -> Evidence:
        """The evidence, after the episode has ended; the replay starts another one in the same environment.

        Args:
            keyposes: (18,) each, that were executed.
            ticks: how long each took.
            replay: "joint" plays the joint actions, one per tick, and compares every state; "keypose" the keyposes,
                and compares the last state; "none" nothing.
        """
        self._meter.observe()
        coupling = self._meter.result()
        hashes = [*self._hashes[1:], self._env.state_hash()]
        replayed = None
        if replay == "joint":
            replayed = _replays(self._env, self._actions, hashes)
        elif replay == "keypose":
            replayed = _replays(self._env, keyposes, hashes[-1:])
        return Evidence(_keyframes_found(np.array(self._actions), ticks), replayed, coupling)


def _keyframes_found(actions: NDArray[np.float32], ticks: Sequence[int]) -> bool:
    found, expected = np.array(discover_keyframes(actions)), np.cumsum(ticks)
    return found.shape == expected.shape and bool(
        (np.abs(found - expected) <= KEYFRAME_TOLERANCE_FRAMES).all()
    )


def _replays(env: BimanualEnv, actions: Sequence[NDArray[np.float32]], hashes: Sequence[str]) -> bool:
    """Whether playing actions ends in success after the same states, of which the last `len(hashes)` are known."""
    env.reset(seed=env.progress.seed)
    first_known = len(actions) - len(hashes)
    for index, action in enumerate(actions):
        _, _, terminated, truncated, info = env.step(action)
        if index >= first_known and env.state_hash() != hashes[index - first_known]:
            return False
        if terminated or truncated:
            return info["is_success"] and index == len(actions) - 1
    return False
