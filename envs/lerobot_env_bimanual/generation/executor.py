"""Who does the work: the processes of this machine, or the machines of a ray cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Protocol, Self

from lerobot_bimanual.dataset.schema import View
from lerobot_env_bimanual.generation.plan import Shard, ShardReport
from lerobot_env_bimanual.generation.settings import GenerationSettings

POLL_S = 0.5
"""How often an executor lets its caller look at the progress."""


@dataclass(frozen=True)
class MergeJob:
    """A view to be merged from its shards.

    Attributes:
        settings: what was recorded.
        view: which of the views.
        command: the command line that made it.
        worlds: task -> version of the world in which it was played.
        shards: folder and report of each shard, in the order of the episodes.
        root: new folder; holds the view, or a folder per view.
    """

    settings: GenerationSettings
    view: View
    command: str
    worlds: Mapping[str, str]
    shards: Sequence[tuple[Path, ShardReport]]
    root: Path


class Executor(Protocol):
    """Records and merges shards; use it in a `with` statement, which ends everything that it has started."""

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None: ...

    @property
    def successes(self) -> int:
        """Episodes recorded so far."""
        ...

    @property
    def cpu_seconds(self) -> float:
        """CPU time that finished shards and views have taken, of all workers together."""
        ...

    def record(
        self, settings: GenerationSettings, shards: Sequence[Shard], folder: Callable[[str], Path]
    ) -> Iterator[None]:
        """Record shards in any order; yields now and then while they are under way.

        Args:
            settings: what is recorded.
            shards: what is tried.
            folder: gives the folder of a shard's name; each appears in one piece.

        Raises:
            BimanualError: a shard cannot be recorded or written, or workers died.
        """
        ...

    def merge(self, jobs: Sequence[MergeJob]) -> Iterator[None]:
        """Merge views, see `merge.merge_shards`; yields now and then while that is under way."""
        ...
