"""Play one episode: the expert, or anything else that proposes one move after the other.

Everything acts through `BimanualEnv.step`, so an expert has no power that a policy lacks. What an episode came
to is an `Outcome`, a plain record that travels between processes and into JSON.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_bimanual.codec import KeyposeCodec
from lerobot_bimanual.keypose import KEYPOSE_DIM, BimanualKeypose, Keypose
from lerobot_env_bimanual.expert.evidence import Evidence

if TYPE_CHECKING:
    from lerobot_env_bimanual.env import BimanualEnv
    from lerobot_env_bimanual.world.scene import Scene

MAX_TIP_ERROR_MM = 12.0
"""At the end of a keypose; more is a hidden collision (design study)."""

OUT_OF_MOVES = "no move left"
OUT_OF_TIME = "out of time"


@dataclass(frozen=True, eq=False)
class Move:
    """One action of an episode.

    Attributes:
        name: what it is for.
        action: a keypose (18,) or a joint action (16,), as `BimanualEnv.step` takes them.
        presses: the prop that keeps the hands from arriving, if that is meant.
    """

    name: str
    action: NDArray[np.float32]
    presses: str | None = None


type Control = Callable[[BimanualEnv], Iterator[Move]]
"""Whoever plays: started after the reset and resumed after each move, so it may look at the scene."""


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

    @classmethod
    def from_dict(cls, fields: dict[str, Any]) -> Outcome:
        """The outcome that `dataclasses.asdict` and JSON have taken apart."""
        evidence = fields["evidence"]
        reports = (
            report | {"keypose": tuple(report["keypose"]), "tip_error_mm": tuple(report["tip_error_mm"])}
            for report in fields["keyposes"]
        )
        return cls(
            **fields
            | {
                "unmet": tuple(fields["unmet"]),
                "keyposes": tuple(MoveReport(**report) for report in reports),
                "evidence": None if evidence is None else Evidence.from_dict(evidence),
            }
        )


def run_expert(
    env: BimanualEnv,
    seed: int,
    codec: KeyposeCodec | None = None,
    on_move: Callable[[Move], None] | None = None,
) -> Outcome:
    """Let the task's script play one episode.

    Args:
        env: environment whose control mode takes keyposes.
        seed: seed of the reset.
        codec: round every keypose to its voxels and bins, as a policy would command it.
        on_move: called before each keypose is executed.
    """
    return run_episode(env, seed, expert(codec), on_move)


def expert(codec: KeyposeCodec | None = None, frozen: Arm | None = None) -> Control:
    """The task's script as a control.

    Args:
        codec: round every keypose to its voxels and bins.
        frozen: an arm that stays at home with its hand open, whatever the script wants of it.
    """

    def play(env: BimanualEnv) -> Iterator[Move]:
        target = home_keypose(env.scene)
        home = target
        for stage in env.task_definition.script(env.scene, env.progress.variation):
            target = stage.keypose(target)
            if frozen is not None:
                target = replace(target, **{frozen.value: home[frozen]})
            commanded = target if codec is None else codec.discretise(target)
            yield Move(stage.name, commanded.to_vector(), stage.presses)

    return play


def home_keypose(scene: Scene) -> BimanualKeypose:
    """Where both arms are right after a reset, hands open."""
    left, right = (Keypose(scene.tcp(arm), gripper_open=True, ignore_collisions=True) for arm in ARMS)
    return BimanualKeypose(left, right)


def run_episode(
    env: BimanualEnv, seed: int, control: Control, on_move: Callable[[Move], None] | None = None
) -> Outcome:
    """Play one episode until it ends or the control has no move left.

    Args:
        env: environment whose control mode takes the control's actions.
        seed: seed of the reset.
        control: who plays.
        on_move: called before each move is executed.
    """
    _, info = env.reset(seed=seed)
    reports: list[MoveReport] = []
    last_move, failure = "", OUT_OF_MOVES
    for move in control(env):
        if on_move is not None:
            on_move(move)
        ticks_before = info["ticks"]
        _, _, terminated, truncated, info = env.step(move.action)
        last_move, is_over = move.name, terminated or truncated
        if len(move.action) == KEYPOSE_DIM:
            reports.append(_report(env.scene, move, info["ticks"] - ticks_before, is_over))
        if is_over:
            failure = info["failure"] or OUT_OF_TIME
            break
    return _outcome(
        env,
        success=info["is_success"],
        failure="" if info["is_success"] else failure,
        last_move=last_move,
        unmet=tuple(name for name, met in info["conditions"].items() if not met),
        keyposes=tuple(reports),
    )


def failed_to_start(env: BimanualEnv, failure: str) -> Outcome:
    """The outcome of an episode whose reset has just failed."""
    return _outcome(env, success=False, failure=failure, last_move="", unmet=(), keyposes=())


def _outcome(env: BimanualEnv, **fields: Any) -> Outcome:
    """The given fields, and those that stand in the environment."""
    return Outcome(
        **fields,
        task=env.task,
        variation=env.variation,
        split=env.settings.split,
        seed=env.progress.seed,
        ticks=env.progress.ticks,
        draws=env.task_definition.draws,
        line_fallbacks=env.progress.line_fallbacks,
        unstable=env.scene.unstable,
        state_hash=env.state_hash(),
    )


def _report(scene: Scene, move: Move, ticks: int, is_over: bool) -> MoveReport:
    target = BimanualKeypose.from_vector(move.action)
    errors_mm = {arm: 1000 * scene.tcp(arm).distance_to(target[arm].pose)[0] for arm in ARMS}
    late = [arm for arm in ARMS if errors_mm[arm] > MAX_TIP_ERROR_MM]
    return MoveReport(
        name=move.name,
        keypose=tuple(float(number) for number in move.action),
        ticks=ticks,
        tip_error_mm=tuple(round(error, 2) for error in errors_mm.values()),
        arrived=is_over or all(move.presses and scene.touching(arm, move.presses) for arm in late),
    )
