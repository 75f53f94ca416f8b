"""Play one episode: the expert, or anything else that proposes one move after the other.

Everything acts through `BimanualEnv.step`, so an expert has no power that a policy lacks.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.codec import KeyposeCodec
from lerobot_bimanual.keypose import KEYPOSE_DIM, BimanualKeypose, Keypose
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.outcome import MoveReport, Outcome
from lerobot_env_bimanual.world.scene_view import SceneView

MAX_TIP_ERROR_MM = 12.0
"""At the end of a keypose; more is a hidden collision: in free space it is below 3 mm (docs/tasks.md)."""

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


type Player = Callable[[BimanualEnv], Iterator[Move]]
"""Whoever plays: started after the reset and resumed after each move, so it may look at the scene."""


def run_expert(
    env: BimanualEnv,
    seed: int,
    codec: KeyposeCodec | None = None,
    on_move: Callable[[Move], None] | None = None,
    variation: int | None = None,
) -> Outcome:
    """Let the task's script play one episode.

    Args:
        env: environment whose control mode takes keyposes.
        seed: seed of the reset.
        codec: round every keypose to its voxels and bins, as a policy would command it.
        on_move: called before each keypose is executed.
        variation: index; None leaves it to the environment's options.
    """
    return run_episode(env, seed, expert(codec), on_move, variation)


def expert(codec: KeyposeCodec | None = None) -> Player:
    """The task's script as a player.

    Args:
        codec: round every keypose to its voxels and bins.
    """

    def play(env: BimanualEnv) -> Iterator[Move]:
        target = home_keypose(env.scene)
        for stage in env.task_definition.script(env.scene, env.progress.variation):
            target = stage.keypose(target)
            commanded = target if codec is None else codec.discretise(target)
            yield Move(stage.name, commanded.to_vector(), stage.presses)

    return play


def home_keypose(scene: SceneView) -> BimanualKeypose:
    """Where both arms are right after a reset, hands open."""
    left, right = (Keypose(scene.tcp(arm), gripper_open=True, ignore_collisions=True) for arm in ARMS)
    return BimanualKeypose(left, right)


def run_episode(
    env: BimanualEnv,
    seed: int,
    player: Player,
    on_move: Callable[[Move], None] | None = None,
    variation: int | None = None,
) -> Outcome:
    """Play one episode until it ends or the player has no move left.

    Args:
        env: environment whose control mode takes the player's actions.
        seed: seed of the reset.
        player: who plays.
        on_move: called before each move is executed.
        variation: index; None leaves it to the environment's options.
    """
    _, info = env.reset(seed=seed, options=None if variation is None else {"variation": variation})
    reports: list[MoveReport] = []
    last_move, failure = "", OUT_OF_MOVES
    for move in player(env):
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
        split=env.options.split,
        seed=env.progress.seed,
        ticks=env.progress.ticks,
        draws=env.progress.draws,
        line_fallbacks=env.progress.line_fallbacks,
        unstable=env.scene.unstable,
        state_hash=env.state_hash(),
    )


def _report(scene: SceneView, move: Move, ticks: int, is_over: bool) -> MoveReport:
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
