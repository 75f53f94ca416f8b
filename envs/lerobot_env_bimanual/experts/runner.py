"""Play one episode with a scripted expert, or with any other player that proposes one move after the other.

Every player acts through `BimanualEnv.step`, so an expert has no power that a policy lacks. Scripts read the poses of props
and use them for several stages. That is correct as long as only the hands move the props; if something else does, the
replanning expert starts its script again.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.codec import KeyposeCodec
from lerobot_bimanual.keypose import BimanualKeypose
from lerobot_bimanual.keypose_layout import KEYPOSE_DIM
from lerobot_bimanual.results.expert_report import EpisodeOutcome, MoveReport
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.stage import stages_and_targets
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


def expert(codec: KeyposeCodec | None = None, plan: int = 0) -> Player:
    """The task's script as a player.

    Args:
        codec: round every keypose to its voxels and bins, as a policy would command it.
        plan: number of the task's plan.
    """

    def play(env: BimanualEnv) -> Iterator[Move]:
        script = env.task_definition.script_for_plan(env.progress.variation, plan)
        for stage, target in stages_and_targets(script, env.scene):
            commanded = target if codec is None else codec.discretise(target)
            yield Move(stage.name, commanded.to_vector(), stage.presses)

    return play


def replanning(codec: KeyposeCodec | None = None, plan: int = 0) -> Player:
    """As `expert`, but started again from the present scene whenever a perturbation has moved props.

    Without such a perturbation, it equals `expert`.
    """
    script = expert(codec, plan)

    def play(env: BimanualEnv) -> Iterator[Move]:
        while True:
            seen = env.progress.disturbances
            for move in script(env):
                yield move
                if env.progress.disturbances != seen:
                    break
            else:
                return

    return play


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
    moves, commands, late_moves = list[MoveReport](), list[tuple[float, ...]](), list[int]()
    last_move, failure = "", OUT_OF_MOVES
    for move in player(env):
        if on_move is not None:
            on_move(move)
        ticks_before = info["ticks"]
        _, _, terminated, truncated, info = env.step(move.action)
        last_move, is_over = move.name, terminated or truncated
        if len(move.action) == KEYPOSE_DIM:
            target = BimanualKeypose.from_vector(move.action)
            errors_mm = [1000 * env.scene.tcp(arm).distance_to(target[arm].pose)[0] for arm in ARMS]
            if not is_over and _is_late(env.scene, move, errors_mm):
                late_moves.append(len(moves))
            errors = (round(error_mm, 2) for error_mm in errors_mm)  # left, right
            moves.append(MoveReport(move.name, info["ticks"] - ticks_before, *errors))
            commands.append(tuple(move.action.tolist()))
        if is_over:
            failure = info["failure"] or OUT_OF_TIME
            break
    return outcome_of(
        env,
        success=info["is_success"],
        failure=None if info["is_success"] else failure,
        last_move=last_move,
        unmet=tuple(name for name, met in info["conditions"].items() if not met),
        moves=tuple(moves),
        commands=tuple(commands),
        late_moves=tuple(late_moves),
    )


def outcome_of(env: BimanualEnv, **fields: Any) -> EpisodeOutcome:
    """The outcome of an episode, also of one whose reset has just failed: the given fields, and what the environment knows."""
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


def _is_late(scene: SceneView, move: Move, errors_mm: list[float]) -> bool:
    """Whether a hand is away from its target and does not press what it should; by the tip errors, left and right."""
    away = [arm for arm, error_mm in zip(ARMS, errors_mm, strict=True) if error_mm > MAX_TIP_ERROR_MM]
    return not all(move.presses and scene.touching(arm, move.presses) for arm in away)


@dataclass(frozen=True, eq=False)
class Frame:
    """One control tick of 50 ms.

    Attributes:
        observation: before the tick, as `BimanualEnv.reset` and `step` return it.
        action: (16,) float32 joint action of the tick, left arm first.
        keypose: (18,) float32 keypose that the expert moves to, left arm first.
    """

    observation: dict[str, Any]
    action: NDArray[np.float32]
    keypose: NDArray[np.float32]


def play_expert(task: str, seed: int = 0, **options: Any) -> Iterator[Frame]:
    """Play an episode of a task's expert, frame by frame.

    Args:
        task: name of the task, as in `lerobot-bimanual task list`.
        seed: of the episode.
        options: of `BimanualEnv`, such as `image_size=128`, `variation=2` or `video_dir="outputs/expert"`.

    Yields:
        A frame before each control tick, until the episode ends. The frames of one keypose come together.

    Raises:
        BimanualError: an option is outside its choices, or no placement that both arms can serve was found.
    """
    env = BimanualEnv(task, **options)
    frames: list[Frame] = []

    def note(env: BimanualEnv, action: NDArray[np.float32]) -> None:
        frames.append(Frame(env.observe(), action.copy(), env.last_action.copy()))

    try:
        env.reset(seed=seed)
        for move in replanning()(env):
            with env.observed_by(note):
                _, _, terminated, truncated, _ = env.step(move.action)
            yield from frames
            frames.clear()
            if terminated or truncated:
                return
    finally:
        env.close()
