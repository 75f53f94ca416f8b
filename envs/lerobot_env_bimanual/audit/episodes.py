"""A policy's episodes, played again from their seeds by their recorded actions."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, fields
from itertools import pairwise

from lerobot_bimanual.errors import BimanualError, InvalidAction
from lerobot_bimanual.evaluation.played_episode import PlayedEpisode
from lerobot_bimanual.json_file import shown
from lerobot_bimanual.json_record import decode
from lerobot_bimanual.results.hash_chain import first_difference
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.episode_recorder import PLAYED, EpisodeRecorder
from lerobot_env_bimanual.hold_after_done import INVALID_ACTION, HoldAfterDone

PROOFS = ("start", "actions", "links", "end")
"""Fields of an episode that are compared step by step; the others are claims, compared one by one."""
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

    def __init__(self, task: str, options: Mapping[str, str]):
        self.env = played_env(task, options)
        self._player = HoldAfterDone(EpisodeRecorder(self.env))

    def audit(self, played: PlayedEpisode) -> EpisodeAudit:
        """Play an episode again and compare everything."""
        try:
            self._player.reset(seed=played.seed, options={"variation": played.variation})
        except BimanualError as error:
            return EpisodeAudit(played.seed, (f"cannot be started: {error}",), "")
        placement = placement_hash(self.env)
        if self.env.state_hash() != played.start:
            return EpisodeAudit(played.seed, ("another state at the start",), placement)
        try:
            actions = played.action_list()
        except ValueError as error:
            return EpisodeAudit(played.seed, (str(error),), placement)
        ticks, info = [0], {}
        for action in actions:
            unreadable = InvalidAction(played.failure.removeprefix(INVALID_ACTION))
            info = self._player.step(action if action.size else unreadable)[4]
            ticks.append(self.env.progress.ticks)
            if self._player.is_done:
                break
        if PLAYED not in info:
            return EpisodeAudit(
                played.seed, (f"not over after its {len(actions)} actions, {ticks[-1]} ticks",), placement
            )
        again = decode(PlayedEpisode, json.loads(info[PLAYED]), "the episode played again")
        return EpisodeAudit(played.seed, tuple(_differences(played, again, ticks)), placement)

    def close(self) -> None:
        """Free the world."""
        self.env.close()


def played_env(task: str, options: Mapping[str, str]) -> BimanualEnv:
    """An environment in which an evaluation is played again, given its options by name."""
    keywords = {name: kind(options[name]) for name, kind in PLAYED_OPTIONS.items() if name in options}
    return BimanualEnv(task, obs="state", **keywords)


def expert_env(task: str, options: Mapping[str, str]) -> BimanualEnv:
    """An environment in which the expert plays the same episodes, whichever actions the policy was allowed."""
    return played_env(task, dict(options) | {"control_mode": "auto"})


def placement_hash(env: BimanualEnv) -> str:
    """Hash of where everything stands; what has no joint, such as a button's base, is placed in the model."""
    data = env.scene.data
    return hashlib.sha256(data.qpos.tobytes() + data.xpos.tobytes() + data.xquat.tobytes()).hexdigest()


def _differences(played: PlayedEpisode, again: PlayedEpisode, ticks: list[int]) -> list[str]:
    problems = []
    step = first_difference(played.links, again.links)
    if step is not None:
        problems.append(_where(step, ticks))
    elif played.end != again.end:
        problems.append("the chain of state hashes ends otherwise, although all its links agree")
    elif played.actions != again.actions:
        problems.append("the actions are written in another form than ours")
    for name in (field.name for field in fields(PlayedEpisode) if field.name not in PROOFS):
        claimed, found = getattr(played, name), getattr(again, name)
        if claimed != found:
            problems.append(f"{name} is {shown(claimed)}, but {shown(found)} when it is played again")
    return problems


def _where(step: int, ticks: list[int]) -> str:
    spans = list(pairwise(ticks))
    if step >= len(spans):
        return f"the record goes on beyond the episode's end after {ticks[-1]} ticks"
    first, last = spans[step]
    at = f"tick {last}" if last - first <= 1 else f"ticks {first + 1} to {last}"
    return f"another action or state at step {step}, {at}"
