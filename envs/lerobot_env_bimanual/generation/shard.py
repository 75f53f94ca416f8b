"""Records one shard, a few candidates of one task, as complete LeRobot datasets."""

from __future__ import annotations

import logging
import threading
from contextlib import ExitStack
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from tqdm import tqdm

from lerobot_bimanual.dataset import feature_table
from lerobot_bimanual.dataset.calibration import Calibration
from lerobot_bimanual.dataset.provenance import EpisodeKey, SkippedSeed
from lerobot_bimanual.errors import PlacementFailure
from lerobot_env_bimanual.experts.recorder import Recorder
from lerobot_env_bimanual.generation.plan import Shard, ShardReport
from lerobot_env_bimanual.generation.settings import GenerationSettings
from lerobot_env_bimanual.generation.staging import REPORT, new_folder, place_shard, plain_write_errors

if TYPE_CHECKING:
    from lerobot_bimanual.dataset.writer import ViewWriter

type Job = tuple[GenerationSettings, Shard, Path]
"""What is recorded, the candidates, and the folder of the finished shard."""


def record_shard(job: Job) -> int:
    """Record a shard and move it to its folder in one piece.

    Returns:
        Number of its episodes.

    Raises:
        DatasetError: the shard cannot be written.
    """
    from lerobot_bimanual.dataset.writer import ViewWriter, write_episode

    settings, shard, target = job
    recorder, options = _recorder(), settings.options
    episodes: list[EpisodeKey] = []
    skipped: list[SkippedSeed] = []
    with plain_write_errors(target), new_folder(target.parent.parent) as folder:
        with ExitStack() as stack:
            writers: list[ViewWriter] = []
            for candidate in shard.candidates:
                try:
                    how = settings.discretise, None if settings.plans == "one" else candidate.plan
                    outcome, episode = recorder.record(
                        candidate.task, options, candidate.seed, candidate.variation, *how
                    )
                    unmet = ", ".join(outcome.unmet) or "none"
                    reason = f"{outcome.failure}, at {outcome.last_move!r}; unmet: {unmet}"
                except PlacementFailure as failure:
                    episode, reason = None, str(failure)
                if episode is None:
                    skipped.append(SkippedSeed(**candidate.model_dump(), reason=reason))
                    continue
                episodes.append(candidate)
                # Perturbed cameras stand elsewhere in every episode.
                last = episode.final_observation
                calibration = None if settings.perturb else Calibration.of_observation(last)
                for view in () if writers else settings.views:  # a dataset without episodes is none
                    writer = ViewWriter(
                        folder / view,
                        settings.repo_id,
                        view,
                        settings.cameras,
                        *options.size,
                        settings.intermediate,
                        settings.depth,
                        further=None if settings.plans == "one" else feature_table.PLANS,
                        calibration=calibration,
                    )
                    writers.append(stack.enter_context(writer))
                write_episode(episode, writers)
        ShardReport(episodes=tuple(episodes), skipped=tuple(skipped)).write(folder / REPORT)
        place_shard(folder, target)
    return len(episodes)


@cache
def _recorder() -> Recorder:
    """The recorder of this process, kept from shard to shard."""
    quieten_libraries()
    return Recorder()


def quieten_libraries() -> None:
    """Keep what recording uses quiet and on one core."""
    import av.logging
    import datasets
    import pyarrow
    import torch

    # The lock of tqdm itself is a named semaphore, which would outlive a worker that is killed.
    tqdm.set_lock(threading.RLock())
    torch.set_num_threads(1)
    pyarrow.set_cpu_count(1)
    datasets.disable_progress_bars()
    av.logging.set_libav_level(av.logging.ERROR)
    logging.getLogger("lerobot").setLevel(logging.CRITICAL)
