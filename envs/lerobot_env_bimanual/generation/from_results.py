"""Makes datasets of the episodes that policies have played: each is replayed exactly, and its rows are noted on the way."""

from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.dataset import feature_table, schema
from lerobot_bimanual.episode import Demonstration
from lerobot_bimanual.joint_action import JOINT_ACTION_DIM, by_arm, discover_keyframes
from lerobot_bimanual.keypose_layout import KEYPOSE_DIM
from lerobot_bimanual.results.episode import Episode
from lerobot_env_bimanual.experts.recorder import Tape
from lerobot_env_bimanual.failures.attribution import FailureAttributor
from lerobot_env_bimanual.generation.shard import quieten_libraries, write_views
from lerobot_env_bimanual.generation.staging import new_folder, plain_write_errors
from lerobot_env_bimanual.verification.episodes import EpisodeVerifier, Options, recorded_actions

type Part = tuple[str, str, Options, tuple[Episode, ...], Path]
"""Name of a task and of a policy, options of an evaluation, episodes of it, and the new folder that gets a dataset of them
per view."""


def record_replays(part: Part, cameras: tuple[str, ...], size: tuple[int, int], **how: Any) -> list[str]:
    """Replay episodes and write their rows, with further arguments of `write_views`.

    Returns:
        Why episodes were left out, one sentence each; the folder is made unless all were.

    Raises:
        DatasetError: the rows cannot be written.
    """
    task, policy, options, episodes, target = part
    verifier, attributor = _players(task, options, cameras, size)
    env, left_out = verifier.env, list[str]()
    played_by = {"policy": policy, "setting": env.options.setting, "perturb": env.options.perturb}

    def replayed() -> Iterator[Demonstration]:
        for episode in episodes:
            tape = Tape(env, lambda: env.progress.keyposes)
            with env.observed_by(tape.note):
                problems = verifier(episode)
            if not problems and not episode.ticks:
                problems = [f"no tick was played ({episode.failure})"]
            if problems:
                left_out.append(f"{task}, seed {episode.seed}: {problems[0]}")
                continue
            actions = recorded_actions(episode)
            keyposes = [each for each in actions if each.size == KEYPOSE_DIM]
            played = tape.demonstration(np.array(keyposes))
            if any(each.size == JOINT_ACTION_DIM for each in actions):
                played = _with_reached_keyposes(played)
            reason = "" if episode.success else str(attributor.failure_class(episode))
            outcome = {
                feature_table.SUCCESS: np.array([episode.success]),
                feature_table.FAILURE_CLASS: reason,
            }
            yield replace(played, further=outcome | played_by)

    with plain_write_errors(target), new_folder(target.parent) as folder:
        further = feature_table.OUTCOME
        write_views(folder, replayed(), cameras=cameras, size=size, further=further, **how)
        if len(left_out) < len(episodes):
            folder.rename(target)
    return left_out


@lru_cache(maxsize=1)
def _players(
    task: str, options: Options, cameras: tuple[str, ...], size: tuple[int, int]
) -> tuple[EpisodeVerifier, FailureAttributor]:
    """What replays episodes and says why they failed; kept for the next part."""
    quieten_libraries()
    verifier = EpisodeVerifier(task, dict(options), cameras=cameras, image_size=size)
    return verifier, FailureAttributor(task, dict(options))


def _with_reached_keyposes(episode: Demonstration) -> Demonstration:
    """An episode with joint actions, with the poses at its keyframes as keyposes, as PerAct labels demonstrations."""
    actions = np.array([step.action for step in episode.steps]).reshape(-1, JOINT_ACTION_DIM)
    ends = discover_keyframes(actions) or [len(actions) - 1]
    poses = np.array([episode.steps[end].observation[schema.EE_POSE] for end in ends])
    is_open = by_arm(actions)[ends, :, -1:] > 0.5
    free = np.ones_like(is_open)
    keyposes = np.concatenate([poses.reshape(-1, len(ARMS), 7), is_open, free], axis=-1)
    stages = np.searchsorted(ends[:-1], np.arange(len(actions)), side="right").tolist()
    counts = [{schema.KEYPOSE_STEP: np.array([stage], np.float32)} for stage in (*stages, len(ends))]
    steps = tuple(
        replace(step, stage=stage, observation=step.observation | count)
        for step, stage, count in zip(episode.steps, stages, counts[:-1], strict=True)
    )
    return replace(
        episode,
        steps=steps,
        keyposes=keyposes.reshape(-1, KEYPOSE_DIM).astype(np.float32),
        final_observation=episode.final_observation | counts[-1],
    )
