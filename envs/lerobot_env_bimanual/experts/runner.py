"""Play one episode with the scripted expert, or with any other player that proposes one move after the other.

Every player acts through `BimanualEnv.step`, so an expert has no power that a policy lacks.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.codec import KeyposeCodec
from lerobot_bimanual.keypose import BimanualKeypose, Keypose
from lerobot_bimanual.keypose_layout import KEYPOSE_DIM
from lerobot_bimanual.results.expert_report import EpisodeOutcome, MoveReport
from lerobot_env_bimanual.env import BimanualEnv
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
"""A player is started after the reset and resumed after each move, so it may read the scene."""


def run_expert(
    env: BimanualEnv,
    seed: int,
    codec: KeyposeCodec | None = None,
    on_move: Callable[[Move], None] | None = None,
    variation: int | None = None,
) -> EpisodeOutcome:
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
) -> EpisodeOutcome:
    """Play one episode until it ends or the player has no move left.

    Args:
        env: environment whose control mode takes the player's actions.
        seed: seed of the reset.
        player: who plays.
        on_move: called before each move is executed.
        variation: index; None leaves it to the environment's options.
    """
    _, info = env.reset(seed=seed, options=None if variation is None else {"variation": variation})
    moves: list[MoveReport] = []
    commands: list[tuple[float, ...]] = []
    late_moves: list[int] = []
    last_move, failure = "", OUT_OF_MOVES
    for move in player(env):
        if on_move is not None:
            on_move(move)
        ticks_before = info["ticks"]
        _, _, terminated, truncated, info = env.step(move.action)
        last_move, is_over = move.name, terminated or truncated
        if len(move.action) == KEYPOSE_DIM:
            errors_mm = _tip_errors_mm(env.scene, move)
            if not is_over and _is_late(env.scene, move, errors_mm):
                late_moves.append(len(moves))
            moves.append(
                MoveReport(move.name, info["ticks"] - ticks_before, *(round(mm, 2) for mm in errors_mm))
            )
            commands.append(tuple(float(number) for number in move.action))
        if is_over:
            failure = info["failure"] or OUT_OF_TIME
            break
    return _outcome(
        env,
        success=info["is_success"],
        failure=None if info["is_success"] else failure,
        last_move=last_move,
        unmet=tuple(name for name, met in info["conditions"].items() if not met),
        moves=tuple(moves),
        commands=tuple(commands),
        late_moves=tuple(late_moves),
    )


def failed_to_start(env: BimanualEnv, failure: str) -> EpisodeOutcome:
    """The outcome of an episode whose reset has just failed."""
    return _outcome(env, success=False, failure=failure)


def _outcome(env: BimanualEnv, **fields: Any) -> EpisodeOutcome:
    """The given fields, and those that the environment knows."""
    return EpisodeOutcome(
        **fields,
        task=env.task,
        variation=env.variation,
        seed=env.progress.seed,
        ticks=env.progress.ticks,
        draws=env.progress.draws,
        line_fallbacks=env.progress.line_fallbacks,
        unstable=env.scene.unstable,
        state_hash=env.state_hash(),
    )


def _tip_errors_mm(scene: SceneView, move: Move) -> list[float]:
    """Distance in mm of the left and the right tool centre point from its target."""
    target = BimanualKeypose.from_vector(move.action)
    return [1000 * scene.tcp(arm).distance_to(target[arm].pose)[0] for arm in ARMS]


def _is_late(scene: SceneView, move: Move, errors_mm: list[float]) -> bool:
    """Whether a hand is away from its target and does not press what it should."""
    away = [arm for arm, error_mm in zip(ARMS, errors_mm, strict=True) if error_mm > MAX_TIP_ERROR_MM]
    return not all(move.presses and scene.touching(arm, move.presses) for arm in away)
