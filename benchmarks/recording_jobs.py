"""Demonstrations recorded on the clock, by our writer or by LeRobot's plain one; for `recording.py`, `loading.py`."""

import resource
import time
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from numpy.typing import NDArray

import lerobot_bimanual.dataset.writer
from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.video import EpisodeVideoEncoder
from lerobot_bimanual.dataset.writer import ViewWriter
from lerobot_env_bimanual.experts.recorder import Recorder
from lerobot_env_bimanual.generation import shard as shard_module
from lerobot_env_bimanual.generation.executor import MergeJob
from lerobot_env_bimanual.generation.merge import merge_shards
from lerobot_env_bimanual.generation.plan import Shard, next_round
from lerobot_env_bimanual.generation.settings import GenerationSettings
from lerobot_env_bimanual.generation.shard import ShardRecorder
from lerobot_env_bimanual.generation.shard_report import read_report

STAGES = ("physics and planning", "rendering", "encoding", "writing", "checking")
PHYSICS, RENDERING, ENCODING, WRITING, CHECKING = STAGES
MERGING = "merging"

RGBD_BYTES = 5
"""Of one pixel as it is stored: three colours, and millimetres in 16 bits."""


class PlainWriter(ViewWriter):
    """A view as who knows LeRobot alone writes it: `LeRobotDataset.create` with every default, frame after frame.

    Images pass through PNG files on the disk, and each episode is encoded by one new process per camera stream.
    """

    def __init__(
        self,
        root: Path,
        repo_id: str,
        view: schema.View,
        cameras: Sequence[str],
        height: int,
        width: int,
        intermediate: Sequence[float] = (),
        depth: bool = True,
    ):
        self.root, self.view, self._depth = root, view, depth
        self._cameras, self._intermediate = tuple(cameras), tuple(intermediate)
        features = schema.features(self._cameras, height, width, view, depth)
        dataset = LeRobotDataset.create(repo_id, schema.FPS, features, root, use_videos=view == "frames")
        assert dataset.writer is not None
        self._writer = dataset.writer

    def finish(self) -> None:
        """Write the footers."""
        self._writer.finalize()


class Stopwatch:
    """CPU and wall seconds of each stage; the time of a stage within another one is the inner one's alone.

    Attributes:
        seconds: stage -> (2,) CPU seconds of this process and of its children that ended, and wall seconds.
        calls: stage -> how often it was entered.
    """

    def __init__(self):
        self.seconds: dict[str, NDArray] = defaultdict(lambda: np.zeros(2))
        self.calls = Counter()

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Add the time of a block."""
        within, start = self.total, _now()
        yield
        self.seconds[name] += _now() - start - (self.total - within)
        self.calls[name] += 1

    @property
    def total(self) -> NDArray:
        """(2,) CPU and wall seconds of all stages."""
        return sum(self.seconds.values(), np.zeros(2))

    @contextmanager
    def watching(self, *functions: tuple[Any, str, str]) -> Iterator[None]:
        """Put functions on the clock for a while, given as owner, name and stage."""
        with ExitStack() as stack:
            for owner, name, stage in functions:
                stack.enter_context(mock.patch.object(owner, name, self._timed(getattr(owner, name), stage)))
            yield

    def _timed(self, function: Any, stage: str) -> Any:
        @wraps(function)
        def timed(*args, **kwargs):
            with self.stage(stage):
                return function(*args, **kwargs)

        return timed


def _now() -> NDArray:
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return np.array(
        [time.process_time() + children.ru_utime + children.ru_stime, time.perf_counter()], dtype=float
    )


@dataclass(frozen=True)
class Recording:
    """What a dataset took.

    Attributes:
        seconds: stage -> CPU and wall seconds per demonstration.
        merging: CPU and wall seconds of merging them all.
        megabytes: "raw images", "videos" and "the rest" -> size per demonstration.
    """

    seconds: dict[str, list[float]]
    merging: list[float]
    megabytes: dict[str, float]


def record(settings: GenerationSettings, writer: type[ViewWriter], folder: Path) -> Recording:
    """Record and merge as `lerobot-bimanual dataset generate` does in one of its workers.

    Args:
        settings: what is recorded, of one task.
        writer: writes the views.
        folder: new folder; the dataset will be `folder/merged`.
    """
    watch = Stopwatch()
    recorder = ShardRecorder()
    one_episode = Shard("warm-up", next_round(settings, [], 0)[0].candidates[:1])
    (folder / "shards").mkdir(parents=True)
    recorder.record(settings, one_episode, folder / "shards" / one_episode.name)  # compiles the world
    finished, reports = [], []
    with (
        mock.patch.object(shard_module, "ViewWriter", writer),
        watch.watching(
            (Recorder, "record", PHYSICS),
            (Recorder, "_render", RENDERING),
            (EpisodeVideoEncoder, "feed_frame", ENCODING),
            (EpisodeVideoEncoder, "finish_episode", ENCODING),
            (lerobot_bimanual.dataset.writer, "check_videos", CHECKING),
            (shard_module, "write_report", CHECKING),
        ),
    ):
        while missing := next_round(settings, reports, len(reports)):
            for shard in missing:
                target = folder / "shards" / shard.name
                with watch.stage(WRITING):  # and whatever else is none of the other stages
                    recorder.record(settings, shard, target)
                with watch.stage(CHECKING):
                    reports.append(read_report(target, settings, shard))
                finished.append((target, reports[-1]))
    with watch.stage(MERGING):
        for view in settings.views:
            merge_shards(MergeJob(settings, view, "", {}, finished, folder / "merged"))
    recorder.close()
    demos = settings.total_episodes
    pixels = watch.calls[RENDERING] * len(settings.cameras) * settings.height * settings.width
    stored, videos = _size(folder / "merged", "**/*"), _size(folder / "merged", "**/*.mp4")
    sizes = {"raw images": pixels * RGBD_BYTES, "videos": videos, "the rest": stored - videos}
    return Recording(
        {stage: (watch.seconds[stage] / demos).round(3).tolist() for stage in STAGES},
        watch.seconds[MERGING].round(3).tolist(),
        {what: round(size / demos / 1e6, 3) for what, size in sizes.items()},
    )


def _size(root: Path, pattern: str) -> int:
    """Bytes of the files that match."""
    return sum(path.stat().st_size for path in root.glob(pattern) if path.is_file())
