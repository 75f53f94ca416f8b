"""What a worker does, in whichever process it runs."""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from lerobot_bimanual.errors import BimanualError, DatasetError
from lerobot_env_bimanual.generation.candidates import Shard
from lerobot_env_bimanual.generation.settings import GenerationSettings

if TYPE_CHECKING:
    from lerobot_env_bimanual.expert.recorder import Recorder

_recorder: tuple[tuple[GenerationSettings, str], Recorder] | None = None
"""Of the last shard: a compiled world and its images, kept because the next shard is most likely of the same task."""


def load_libraries() -> None:
    """Import what recording needs, quiet and on one core; seconds the first time, nothing afterwards."""
    import av.logging
    import datasets
    import pyarrow
    import torch

    import lerobot_bimanual.dataset.writer  # noqa: F401

    torch.set_num_threads(1)
    pyarrow.set_cpu_count(1)
    datasets.disable_progress_bars()
    av.logging.set_libav_level(av.logging.ERROR)
    logging.getLogger("lerobot").setLevel(logging.CRITICAL)


def record(
    settings: GenerationSettings, shard: Shard, target: Path, on_episode: Callable[[], None] = lambda: None
) -> None:
    """Record a shard, see `shards.record_shard`, with the recorder of the shard before if it fits.

    Raises:
        DatasetError: the shard cannot be recorded or written.
    """
    from lerobot_env_bimanual.generation.shards import make_recorder, record_shard

    global _recorder
    key = settings, shard.candidates[0].task
    if _recorder is None or _recorder[0] != key:
        if _recorder is not None:
            _recorder[1].close()
        _recorder = key, make_recorder(*key)
    try:
        record_shard(settings, shard, _recorder[1], target, on_episode)
    except BimanualError as error:
        raise DatasetError(str(error)) from None  # errors with other arguments do not survive the way home
