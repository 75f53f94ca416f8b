"""Records one shard, a few candidates of one task, as complete LeRobot datasets."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from contextlib import ExitStack
from functools import cache
from pathlib import Path

from tqdm import tqdm

from lerobot_bimanual.codec import KeyposeCodec
from lerobot_bimanual.dataset.provenance import EpisodeKey, SkippedSeed
from lerobot_bimanual.dataset.schema import View
from lerobot_bimanual.dataset.writer import ViewWriter, write_episode
from lerobot_bimanual.episode import Demonstration
from lerobot_bimanual.errors import PlacementFailure
from lerobot_env_bimanual.experts.recorder import Recorder
from lerobot_env_bimanual.generation.plan import Shard, ShardReport
from lerobot_env_bimanual.generation.settings import GenerationSettings
from lerobot_env_bimanual.generation.staging import REPORT, new_folder, place_shard, plain_write_errors


def quieten_libraries() -> None:
    """Keep what recording uses quiet and on one core."""
    import av.logging
    import datasets
    import pyarrow
    import torch

    tqdm.set_lock(
        threading.RLock()
    )  # its own is a named semaphore, which would outlive a worker that is killed
    torch.set_num_threads(1)
    pyarrow.set_cpu_count(1)
    datasets.disable_progress_bars()
    av.logging.set_libav_level(av.logging.ERROR)
    logging.getLogger("lerobot").setLevel(logging.CRITICAL)


class ShardRecorder:
    """Records one shard after the other; keeps a task's compiled world for the next one, most likely of that task."""

    def __init__(self):
        self._recorder: Recorder | None = None
        self._key: tuple[GenerationSettings, str] | None = None

    def record(
        self,
        settings: GenerationSettings,
        shard: Shard,
        target: Path,
        on_episode: Callable[[], object] = lambda: None,
    ) -> None:
        """Record a shard and move it to `target` in one piece.

        Args:
            settings: what is recorded.
            shard: its candidates.
            target: folder of the finished shard.
            on_episode: called after each success.

        Raises:
            DatasetError: the shard cannot be written.
        """
        recorder = self._recorder_of(settings, shard.candidates[0].task)
        episodes: list[EpisodeKey] = []
        skipped: list[SkippedSeed] = []
        with plain_write_errors(target), new_folder(target.parent.parent) as folder:
            with ExitStack() as stack:
                writers: list[ViewWriter] = []
                for candidate in shard.candidates:
                    episode, reason = _record(recorder, candidate)
                    if episode is None:
                        skipped.append(SkippedSeed(**candidate.model_dump(), reason=reason))
                        continue
                    if not writers:  # a dataset without episodes is none: wait for the first
                        writers = [
                            stack.enter_context(_writer(settings, folder, view)) for view in settings.views
                        ]
                    write_episode(episode, writers)
                    episodes.append(candidate)
                    on_episode()
            ShardReport(episodes=tuple(episodes), skipped=tuple(skipped)).write(folder / REPORT)
            place_shard(folder, target)

    def close(self) -> None:
        """Free the simulation and its images."""
        if self._recorder is not None:
            self._recorder.close()
        self._recorder = self._key = None

    def _recorder_of(self, settings: GenerationSettings, task: str) -> Recorder:
        if self._recorder is None or self._key != (settings, task):
            self.close()
            codec = KeyposeCodec(voxels=settings.discretise) if settings.discretise else None
            size = settings.height, settings.width
            self._recorder = Recorder(task, settings.split, settings.cameras, size, codec, settings.perturb)
            self._key = settings, task
        return self._recorder


@cache
def recorder() -> ShardRecorder:
    """The recorder of this process, kept from shard to shard; quietens libraries."""
    quieten_libraries()
    return ShardRecorder()


def _record(recorder: Recorder, candidate: EpisodeKey) -> tuple[Demonstration | None, str]:
    """The episode, or none and the reason."""
    try:
        outcome, episode = recorder.record(candidate.seed, candidate.variation)
    except PlacementFailure as failure:
        return None, str(failure)
    reason = f"{outcome.failure}, at {outcome.last_move!r}; unmet: {', '.join(outcome.unmet) or 'none'}"
    return episode, reason


def _writer(settings: GenerationSettings, folder: Path, view: View) -> ViewWriter:
    return ViewWriter(
        folder / view,
        settings.repo_id,
        view,
        settings.cameras,
        settings.height,
        settings.width,
        settings.intermediate,
        settings.depth,
    )
