"""An episode that somebody has played, kept as states: what is to be seen of it is rendered afterwards."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.outcome import Outcome
from lerobot_env_bimanual.experts.runner import Move, Player, run_episode
from lerobot_env_bimanual.world.scene import SceneState
from lerobot_env_bimanual.world.servo_commands import TICK_S


@dataclass(frozen=True, eq=False)
class Take:
    """One episode.

    Attributes:
        outcome: what became of it.
        states: before every tick, and the last one.
        moves: name of each move, and the tick at which it starts.
    """

    outcome: Outcome
    states: Sequence[SceneState]
    moves: Sequence[tuple[str, int]]

    @property
    def duration_s(self) -> float:
        """Length of the episode."""
        return self.outcome.ticks * TICK_S


def take(env: BimanualEnv, seed: int, player: Player, variation: int | None = None) -> Take:
    """Let somebody play an episode, and keep every state of it.

    Args:
        env: environment whose control mode takes the player's actions.
        seed: seed of the reset.
        player: who plays.
        variation: index; None leaves it to the environment's options.
    """
    states: list[SceneState] = []
    moves: list[tuple[str, int]] = []

    def start_move(move: Move) -> None:
        moves.append((move.name, len(states)))

    with env.observed_by(lambda env, _: states.append(env.scene.save_state())):
        outcome = run_episode(env, seed, player, start_move, variation)
    return Take(outcome, [*states, env.scene.save_state()], moves)
