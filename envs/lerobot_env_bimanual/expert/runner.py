"""Play one episode: the expert, or anything else that proposes one move after the other.

Everything acts through `BimanualEnv.step`, so an expert has no power that a policy lacks. What an episode came
to is an `Outcome`, a plain record that travels between processes and into JSON.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_bimanual.codec import KeyposeCodec
from lerobot_bimanual.keypose import BimanualKeypose, Keypose

if TYPE_CHECKING:
    from lerobot_env_bimanual.env import BimanualEnv
    from lerobot_env_bimanual.scene import Scene
    from lerobot_env_bimanual.task import Stage

EMPTY_SCRIPT = "the script ended without success"


@dataclass(frozen=True)
class Move:
    """One action of an episode and what it is for."""

    name: str
    action: NDArray[np.float32]


type Control = Callable[[BimanualEnv], Iterator[Move]]
"""Whoever plays: started after reset, resumed after each move, so it may read the scene."""


@dataclass(frozen=True)
class StageReport:
    """How one keypose went.

    Attributes:
        name: what the move is for.
        keypose: (18,) the executed keypose, as plain numbers.
        ticks: control ticks it took.
        tip_error_mm: distance of the left and the right tool centre point from their targets at its end. In
            free space it stays below 3 mm; more than 12 mm means contact.
    """

    name: str
    keypose: tuple[float, ...]
    ticks: int
    tip_error_mm: tuple[float, float]


@dataclass(frozen=True)
class Outcome:
    """What became of one episode.

    Attributes:
        task: name of the task.
        variation: index of the variation.
        split: split of the seed.
        seed: seed of the reset.
        success: whether the episode was solved.
        failure: why it was not, empty after a success.
        stage: name of the last move.
        unmet: conditions that did not hold at the end.
        stages: one report per executed keypose.
        ticks: control ticks since reset.
        draws: placements drawn at reset.
        line_fallbacks: contact moves for which no straight line existed.
        warnings: whether MuJoCo found the simulation unstable.
        state_hash: hash of the final state.
    """

    task: str
    variation: int
    split: str
    seed: int
    success: bool
    failure: str
    stage: str
    unmet: tuple[str, ...]
    stages: tuple[StageReport, ...]
    ticks: int
    draws: int
    line_fallbacks: int
    warnings: bool
    state_hash: str
