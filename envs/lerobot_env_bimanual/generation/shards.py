"""Records one shard: a few candidates of one task, as complete LeRobot datasets."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

from lerobot_bimanual.codec import KeyposeCodec
from lerobot_bimanual.dataset.provenance import Recipe, SkippedSeed
from lerobot_bimanual.dataset.writer import ViewWriter, write_episode
from lerobot_bimanual.episode import Episode
from lerobot_bimanual.errors import PlacementFailure
from lerobot_env_bimanual.expert.recorder import Recorder
from lerobot_env_bimanual.generation.candidates import Shard, ShardReport
from lerobot_env_bimanual.generation.sealing import seal
from lerobot_env_bimanual.generation.settings import GenerationSettings
from lerobot_env_bimanual.generation.staging import new_folder, place_shard, plain_write_errors


def record_shard(
    settings: GenerationSettings,
    shard: Shard,
    recorder: Recorder,
    target: Path,
    on_episode: Callable[[], None],
) -> None:
    """Record a shard and move it to `target` in one piece.

    Args:
        settings: what is recorded.
        shard: its candidates.
        recorder: of the shard's task.
        target: folder of the finished shard.
        on_episode: called after each success.

    Raises:
        DatasetError: the shard cannot be written.
    """
    episodes: list[Recipe] = []
    skipped: list[SkippedSeed] = []
    with plain_write_errors(target), new_folder(target.parent.parent) as folder:
        with ExitStack() as stack:
            writers: list[ViewWriter] = []
            for candidate in shard.candidates:
                episode, reason = _record(recorder, candidate)
                if episode is None:
                    skipped.append(SkippedSeed(**vars(candidate), reason=reason))
                    continue
                if not writers:  # a dataset without episodes is none: wait for the first
                    writers = [
                        stack.enter_context(_writer(settings, folder, view)) for view in settings.views
                    ]
                write_episode(episode, writers)
                episodes.append(candidate)
                on_episode()
        seal(folder, settings, ShardReport(tuple(episodes), tuple(skipped)))
        place_shard(folder, target)


def make_recorder(settings: GenerationSettings, task: str) -> Recorder:
    """The recorder of one of the tasks."""
    codec = KeyposeCodec(voxels=settings.discretise) if settings.discretise else None
    return Recorder(task, settings.split, settings.cameras, (settings.height, settings.width), codec)


def _record(recorder: Recorder, candidate: Recipe) -> tuple[Episode | None, str]:
    """The episode, or none and the reason."""
    try:
        outcome, episode = recorder.record(candidate.seed, candidate.variation)
    except PlacementFailure as failure:
        return None, str(failure)
    reason = f"{outcome.failure}, at {outcome.last_move!r}; unmet: {', '.join(outcome.unmet) or 'none'}"
    return episode, reason


def _writer(settings: GenerationSettings, folder: Path, view) -> ViewWriter:
    return ViewWriter(
        folder / view,
        settings.repo_id,
        view,
        settings.cameras,
        settings.height,
        settings.width,
        settings.intermediate,
    )
