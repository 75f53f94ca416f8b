"""What is asked of an episode and what became of it, as plain records that travel between processes and into JSON."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from lerobot_env_bimanual.experts.control_names import ControlName
from lerobot_env_bimanual.experts.evidence import Evidence
from lerobot_env_bimanual.replay import ReplayMode

type Keyposes = tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class Job:
    """One episode to be played by some process.

    Attributes:
        task: name of the task.
        variation: index, or "any".
        split: split of the seed.
        seed: seed of the reset.
        control: who plays.
        discretise: voxels per axis to which the expert's keyposes are rounded; 0 leaves them exact.
        blind_keyposes: (18,) each, what the control `blind` plays.
        replay: how the expert's episode is replayed afterwards, "none", "joint" or "keypose".
        perturb: what is different from the world as it is, `AXIS:LEVEL,...`.
    """

    task: str
    variation: str
    split: str
    seed: int
    control: ControlName
    discretise: int = 0
    blind_keyposes: Keyposes = ()
    replay: ReplayMode | Literal["none"] = "none"
    perturb: str = ""


@dataclass(frozen=True)
class MoveReport:
    """How one keypose went.

    Attributes:
        name: what the move was for.
        keypose: (18,) the commanded keypose.
        ticks: control ticks it took.
        tip_error_mm: distance of the left and the right tool centre point from their targets at its end; below
            3 mm in free space.
        arrived: whether both are within `MAX_TIP_ERROR_MM`, but for a hand that presses against what it is meant
            to. If not, something was in the way. True also if the episode ended on the way.
    """

    name: str
    keypose: tuple[float, ...]
    ticks: int
    tip_error_mm: tuple[float, ...]
    arrived: bool


@dataclass(frozen=True)
class Outcome:
    """What became of one episode.

    Attributes:
        task: name of the task.
        variation: index of the variation.
        split: split of the seed.
        seed: seed of the reset.
        success: whether the episode was solved.
        failure: why it was not; empty after a success.
        last_move: name of the last move, empty if there was none.
        unmet: conditions that did not hold at the end.
        keyposes: one report per executed keypose.
        ticks: control ticks since the reset.
        draws: placements drawn at the reset.
        line_fallbacks: contact moves for which there was no straight line.
        unstable: whether MuJoCo warned.
        state_hash: hash of the final state.
        evidence: what else was found out about a success, if anybody looked.
    """

    task: str
    variation: int
    split: str
    seed: int
    success: bool
    failure: str
    last_move: str
    unmet: tuple[str, ...]
    keyposes: tuple[MoveReport, ...]
    ticks: int
    draws: int
    line_fallbacks: int
    unstable: bool
    state_hash: str
    evidence: Evidence | None = None
