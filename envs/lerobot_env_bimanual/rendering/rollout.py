"""One played episode, kept as states, so that any moment of it can be rendered afterwards."""

from __future__ import annotations

from dataclasses import dataclass, field

from lerobot_bimanual.results.expert_report import EpisodeOutcome
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.runner import Player, run_episode
from lerobot_env_bimanual.world.scene import SceneState
from lerobot_env_bimanual.world.servo_commands import TICK_S


@dataclass
class Recording:
    """States of an episode while it is played.

    Attributes:
        states: states before every tick, and the last one.
        keyposes: number of keyposes completed in each of these states.
    """

    states: list[SceneState] = field(default_factory=list)
    keyposes: list[int] = field(default_factory=list)

    def note(self, env: BimanualEnv) -> None:
        """Append the state at hand."""
        self.states.append(env.scene.save_state())
        self.keyposes.append(env.progress.keyposes)

    @property
    def duration_s(self) -> float:
        """Length of the episode."""
        return (len(self.states) - 1) * TICK_S


type Rollout = tuple[Recording, EpisodeOutcome]
"""States of an episode, and what became of it."""


def rollout(env: BimanualEnv, seed: int, player: Player) -> Rollout:
    """Play an episode, and keep every state of it.

    Args:
        env: environment whose control mode takes the player's actions.
        seed: seed of the reset.
        player: expert or policy.
    """
    recording = Recording()
    with env.observed_by(lambda env, _: recording.note(env)):
        outcome = run_episode(env, seed, player)
    recording.note(env)
    return recording, outcome
