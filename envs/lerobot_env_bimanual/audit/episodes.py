"""A policy's episodes, played again from their seeds by their recorded actions."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

from lerobot_bimanual.errors import BimanualError, InvalidAction
from lerobot_bimanual.results.episode import Episode, Proof
from lerobot_bimanual.results.hash_chain import first_difference
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.vector.episode_recorder import PLAYED, EpisodeRecorder
from lerobot_env_bimanual.vector.hold_after_done import INVALID_ACTION, HoldAfterDone

CLAIMS = ("variation", "success", "first_met_tick", "failure", "ticks", "keyposes")
"""Fields of an episode that are compared one by one."""
PLAYED_OPTIONS = {"split": str, "control_mode": str, "max_keyposes": int, "perturb": str}
"""Options that decide what happens; the others decide what a policy sees, and nobody looks here."""


@dataclass(frozen=True)
class EpisodeAudit:
    """What an episode is worth.

    Attributes:
        seed: of the episode.
        problems: what differs when it is played again; empty if nothing does.
        placement: hash of where everything stands at its start.
    """

    seed: int
    problems: tuple[str, ...]
    placement: str


class EpisodeAuditor:
    """Plays the episodes of one evaluation again.

    Args:
        task: name of the task.
        options: of the evaluation, by name.

    Attributes:
        env: in which it plays; it may be observed.
    """

    def __init__(self, task: str, options: Mapping[str, str | int]):
        self.env = played_env(task, options)
        self._player = HoldAfterDone(EpisodeRecorder(self.env))

    def audit(self, episode: Episode) -> EpisodeAudit:
        """Play an episode again and compare everything."""
        seed, proof = episode.seed, proof_of(episode)
        try:
            self._player.reset(seed=seed, options={"variation": episode.variation})
        except BimanualError as error:
            return EpisodeAudit(seed, (f"cannot be started: {error}",), "")
        placement = placement_hash(self.env)
        if self.env.state_hash() != proof.start:
            return EpisodeAudit(seed, ("another state at the start",), placement)
        try:
            actions = proof.action_list()
        except ValueError as error:
            return EpisodeAudit(seed, (str(error),), placement)
        ticks, info = [0], {}
        for action in actions:
            unreadable = InvalidAction((episode.failure or "").removeprefix(INVALID_ACTION))
            info = self._player.step(action if action.size else unreadable)[4]
            ticks.append(self.env.progress.ticks)
            if self._player.is_done:
                break
        if PLAYED not in info:
            return EpisodeAudit(
                seed, (f"not over after its {len(actions)} actions, {ticks[-1]} ticks",), placement
            )
        return EpisodeAudit(seed, tuple(_differences(episode, info[PLAYED], ticks)), placement)

    def close(self) -> None:
        """Free the world."""
        self.env.close()


def played_env(task: str, options: Mapping[str, str | int]) -> BimanualEnv:
    """An environment in which an evaluation is played again, given its options by name."""
    keywords = {name: kind(options[name]) for name, kind in PLAYED_OPTIONS.items() if name in options}
    return BimanualEnv(task, obs="state", **keywords)


def expert_env(task: str, options: Mapping[str, str | int]) -> BimanualEnv:
    """An environment in which the expert plays the same episodes, whichever actions the policy was allowed."""
    return played_env(task, dict(options) | {"control_mode": "auto"})


def placement_hash(env: BimanualEnv) -> str:
    """Hash of where everything stands; what has no joint, such as a button's base, is placed in the model."""
    data = env.scene.data
    return hashlib.sha256(data.qpos.tobytes() + data.xpos.tobytes() + data.xquat.tobytes()).hexdigest()


def proof_of(episode: Episode) -> Proof:
    """What proves an episode.

    Raises:
        BimanualError: it was not recorded.
    """
    if episode.proof is None:
        raise BimanualError(f"seed {episode.seed} has no proof, so it cannot be played again")
    return episode.proof


def _differences(played: Episode, again: Episode, ticks: list[int]) -> list[str]:
    problems = []
    proof, new = proof_of(played), proof_of(again)
    step = first_difference(proof.links, new.links)
    if step is not None:
        problems.append(_where(step, ticks))
    elif proof.end != new.end:
        problems.append("the chain of state hashes ends otherwise, although all its links agree")
    elif proof.actions != new.actions:
        problems.append("the actions are written in another form than ours")
    claims = [(name, getattr(played, name), getattr(again, name)) for name in CLAIMS]
    for name, claimed, found in (*claims, ("instruction", proof.instruction, new.instruction)):
        if claimed != found:
            problems.append(f"{name} is {claimed!r:.120}, but {found!r:.120} when it is played again")
    return problems


def _where(step: int, ticks: list[int]) -> str:
    spans = list(pairwise(ticks))
    if step >= len(spans):
        return f"the record goes on beyond the episode's end after {ticks[-1]} ticks"
    first, last = spans[step]
    at = f"tick {last}" if last - first <= 1 else f"ticks {first + 1} to {last}"
    return f"another action or state at step {step}, {at}"
