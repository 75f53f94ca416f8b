"""Records one shard, a few candidates of one task, as complete LeRobot datasets."""

import logging
import threading
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack
from functools import cache
from pathlib import Path
from typing import Any

from tqdm import tqdm

from lerobot_bimanual.dataset import feature_table
from lerobot_bimanual.dataset.calibration import Calibration
from lerobot_bimanual.dataset.provenance import EpisodeKey, SkippedSeed
from lerobot_bimanual.dataset.schema import View
from lerobot_bimanual.episode import Demonstration
from lerobot_bimanual.errors import PlacementFailure
from lerobot_env_bimanual.experts.recorder import Recorder
from lerobot_env_bimanual.generation.plan import Shard, ShardReport
from lerobot_env_bimanual.generation.settings import GenerationSettings
from lerobot_env_bimanual.generation.staging import REPORT, new_folder, place_shard, plain_write_errors

type Job = tuple[GenerationSettings, Shard, Path]
"""What is recorded, the candidates, and the folder of the finished shard."""


def record_shard(job: Job) -> int:
    """Record a shard and move it to its folder in one piece.

    Returns:
        Number of its episodes.

    Raises:
        DatasetError: the shard cannot be written.
    """
    settings, shard, target = job
    options, has_plans = settings.options, settings.plans == "several"
    episodes, skipped = list[EpisodeKey](), list[SkippedSeed]()

    def solved() -> Iterator[Demonstration]:
        for candidate in shard.candidates:
            which = candidate.task, options, candidate.seed, candidate.variation
            try:
                plan = candidate.plan if has_plans else None
                outcome, episode = _recorder().record(*which, settings.discretise, plan)
                unmet = ", ".join(outcome.unmet) or "none"
                reason = f"{outcome.failure}, at {outcome.last_move!r}; unmet: {unmet}"
            except PlacementFailure as failure:
                episode, reason = None, str(failure)
            if episode is None:
                skipped.append(SkippedSeed(**candidate.model_dump(), reason=reason))
            else:
                episodes.append(candidate)
                yield episode

    with plain_write_errors(target), new_folder(target.parent.parent) as folder:
        stored = settings.repo_id, settings.views, settings.cameras, options.size, bool(settings.perturb)
        how = {"intermediate": settings.intermediate, "depth": settings.depth}
        further = feature_table.PLANS if has_plans else None
        write_views(folder, solved(), *stored, **how, further=further)
        ShardReport(episodes=tuple(episodes), skipped=tuple(skipped)).write(folder / REPORT)
        place_shard(folder, target)
    return len(episodes)


def write_views(
    folder: Path,
    episodes: Iterable[Demonstration],
    repo_id: str,
    views: Sequence[View],
    cameras: Sequence[str],
    size: tuple[int, int],
    is_perturbed: bool,
    **how: Any,
) -> None:
    """Write episodes as one dataset per view in a folder; no dataset if there are no episodes.

    Each episode is written before the next one is played. If `is_perturbed`, cameras may have moved, so every row holds its
    calibration. `size` and all further arguments are those of `ViewWriter`.
    """
    from lerobot_bimanual.dataset.writer import ViewWriter, write_episode

    with ExitStack() as stack:
        writers: list[ViewWriter] = []
        for episode in episodes:
            if not writers and not is_perturbed:
                how["calibration"] = Calibration.of_observation(episode.final_observation)
            for view in () if writers else views:
                writer = ViewWriter(folder / view, repo_id, view, cameras, *size, **how)
                writers.append(stack.enter_context(writer))
            write_episode(episode, writers)


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
