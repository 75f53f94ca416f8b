"""One episode to be played: what it is, and how a process plays it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from lerobot_bimanual.codec import KeyposeCodec
from lerobot_bimanual.errors import PlacementFailure
from lerobot_bimanual.results.expert_report import EXPERTS, EpisodeOutcome, PlayerName
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.baselines import make_player
from lerobot_env_bimanual.experts.load import run_measured
from lerobot_env_bimanual.experts.runner import failed_to_start, run_episode
from lerobot_env_bimanual.replay import ReplayMode

type Keyposes = tuple[tuple[float, ...], ...]
"""Keyposes (18,) each."""


@dataclass(frozen=True)
class EpisodeSpec:
    """One episode; its outcome depends on these fields alone.

    Attributes:
        task: name of the task.
        variation: index, or "any".
        split: split of the seed.
        seed: seed of the reset.
        player: name of the player.
        discretise: voxels per axis to which an expert's keyposes are rounded; 0 leaves them exact.
        mean_keyposes: keyposes of the player `open_loop`.
        replay: how a solved episode of an expert is replayed afterwards.
        perturb: perturbations of the world, `AXIS:LEVEL,...`.
    """

    task: str
    variation: str
    split: str
    seed: int
    player: PlayerName
    discretise: int = 0
    mean_keyposes: Keyposes = ()
    replay: ReplayMode | Literal["none"] = "none"
    perturb: str = ""

    def __str__(self) -> str:
        return (
            f"{self.player} on seed {self.seed} of {self.task}{f' at {self.perturb}' if self.perturb else ''}"
        )


_environments: dict[tuple[str, str, str, str], BimanualEnv] = {}
"""The environment of the last episode of this process."""


def play(spec: EpisodeSpec) -> EpisodeOutcome:
    """Play one episode in this process, in an environment that is kept for the next episode of its kind."""
    key = (spec.task, spec.variation, spec.split, spec.perturb)
    if key not in _environments:
        for env in _environments.values():
            env.close()
        _environments.clear()
        _environments[key] = BimanualEnv(
            spec.task, variation=spec.variation, split=spec.split, obs="state", perturb=spec.perturb
        )
    env = _environments[key]
    codec = KeyposeCodec(voxels=spec.discretise) if spec.discretise else None
    player = make_player(spec.player, spec.seed, codec, spec.mean_keyposes)
    try:
        if spec.player in EXPERTS:
            return run_measured(env, spec.seed, player, spec.replay)
        return run_episode(env, spec.seed, player)
    except PlacementFailure as failure:
        return failed_to_start(env, str(failure))
    except Exception:
        del _environments[key]  # its state is unknown
        raise
