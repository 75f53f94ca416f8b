"""The verb `verify`: every row and image of a dataset is what it claims to be."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from lerobot_bimanual.errors import SchemaMismatch
from lerobot_env_bimanual.commands.replay import parse_episodes

if TYPE_CHECKING:
    from lerobot_bimanual.dataset.provenance import Provenance
    from lerobot_env_bimanual.verification.fault import Fault
    from lerobot_env_bimanual.verification.verifier import EpisodeReport, Verifier

MAX_LINES_PER_CHECK = 10
PRELOADED = ("lerobot.datasets.depth_utils",)
"""What decodes depth: seconds of LeRobot and torch."""


@dataclass
class VerifyConfig:
    """Options of the verb `verify`."""

    root: Path = field(kw_only=True)  # folder of a dataset that `generate` made; all its views are checked
    episodes: str = "all"  # `all`, indices 0,3,7 or a half-open range a:b
    render: int = 3  # episodes, drawn at random, whose images are rendered again and compared
    seed: int = 0  # of that draw
    workers: int = 0  # processes; 0 takes one per core


def verify(config: VerifyConfig) -> int:
    """Check tables, labels, calibration, images and replay of a dataset.

    Every image is decoded, every episode is played again. Prints how many episodes passed each check, what is wrong
    and where, and one hash per view for all its content. Exits with 1 if anything is wrong. Under another version
    of the simulation the checks that need it are left out.

    Examples:
        lerobot-bimanual verify --root=data/lift_ball
        lerobot-bimanual verify --root=data/lift_ball --episodes=0:20 --render=20
    """
    from lerobot_bimanual.dataset.reader import find_view, views_below

    roots = views_below(config.root) or [find_view(config.root)]
    views = [_verify_view(root, config) for root in roots]
    for view in views:
        view.print()
    return 1 if any(view.is_wrong for view in views) else 0


@dataclass
class _ViewReport:
    """What was found in one view.

    Attributes:
        root: its folder.
        metadata: faults of the dataset as a whole, by check.
        episodes: reports of its episodes.
        is_whole: whether these are all episodes.
        remark: what was not checked, and why; may be empty.
    """

    root: Path
    metadata: Mapping[str, tuple[Fault, ...]]
    episodes: Sequence[EpisodeReport] = ()
    is_whole: bool = False
    remark: str = ""

    @property
    def is_wrong(self) -> bool:
        """Whether any check failed."""
        return any(faults for _, _, faults in self._results())

    def _results(self) -> Iterator[tuple[str, int | None, tuple[Fault, ...]]]:
        """(check, episode, faults) of everything that was checked."""
        yield from ((check, None, faults) for check, faults in self.metadata.items())
        for episode in self.episodes:
            yield from ((check, episode.index, faults) for check, faults in episode.faults.items())

    def print(self) -> None:
        """The table, the list of what is wrong, and the hash."""
        from rich.console import Console
        from rich.table import Table

        from lerobot_bimanual.dataset.content_hash import combined_hash

        results: dict[str, list[tuple[int | None, tuple[Fault, ...]]]] = defaultdict(list)
        for check, episode, faults in self._results():
            results[check].append((episode, faults))
        table = Table("check", title=str(self.root), title_justify="left")
        for heading in ("passed", "failed"):
            table.add_column(heading, justify="right")
        for check, outcomes in results.items():
            failed = sum(bool(faults) for _, faults in outcomes)
            table.add_row(check, str(len(outcomes) - failed), f"[red]{failed}[/red]" if failed else "0")
        console = Console()
        console.print(table)
        if self.remark:
            print(self.remark)
        for check, outcomes in results.items():
            lines = [_line(episode, fault) for episode, faults in outcomes for fault in faults]
            for line in lines[:MAX_LINES_PER_CHECK]:
                print(f"{check}: {line}")
            if len(lines) > MAX_LINES_PER_CHECK:
                print(f"{check}: {len(lines) - MAX_LINES_PER_CHECK} more")
        if self.is_whole:
            print(f"content hash: {combined_hash(episode.content_hash for episode in self.episodes)}")


def _line(episode: int | None, fault: Fault) -> str:
    place = "" if episode is None else f"episode {episode}: "
    if fault.row is not None:
        place = f"episode {episode}, row {fault.row}: "
    return place + fault.text


def _verify_view(root: Path, config: VerifyConfig) -> _ViewReport:
    import numpy as np

    from lerobot_bimanual.dataset.reader import RecordedDataset
    from lerobot_env_bimanual.verification.fault import Fault
    from lerobot_env_bimanual.verification.verifier import verify_metadata
    from lerobot_env_bimanual.workers import WorkerPool

    try:
        dataset = RecordedDataset(root)
    except SchemaMismatch as error:
        return _ViewReport(root, {"schema": (Fault(str(error)),)})
    remark = _why_not_simulated(dataset.provenance)
    indices = parse_episodes(config.episodes, len(dataset))
    count = min(config.render, len(indices))
    rendered = frozenset(np.random.default_rng(config.seed).choice(indices, count, replace=False).tolist())
    with WorkerPool(config.workers, _prepare, (root, rendered, not remark), PRELOADED) as pool:
        reports = list(pool.map(_verify, indices, dataset.view, "episode", failed=_unverified))
    is_whole = indices == list(range(len(dataset)))
    return _ViewReport(root, verify_metadata(root), reports, is_whole, remark)


def _why_not_simulated(provenance: Provenance | None) -> str:
    """Empty if this installation can play the dataset's episodes."""
    if provenance is None:
        return "not replayed: the dataset does not say with which versions it was generated"
    if others := provenance.other_versions():
        listing = ", ".join(
            f"{package} {versions[0]} (installed: {versions[1]})" for package, versions in others.items()
        )
        return f"not replayed: generated with {listing}"
    return ""


_verifier: Verifier | None = None


def _prepare(root: Path, rendered: frozenset[int], simulate: bool) -> None:
    import av.logging

    from lerobot_env_bimanual.verification.verifier import Verifier

    global _verifier
    av.logging.set_libav_level(av.logging.PANIC)  # what is broken comes back as a fault
    _verifier = Verifier(root, rendered, simulate)


def _verify(index: int) -> EpisodeReport:
    assert _verifier is not None
    return _verifier.verify(index)


def _unverified(index: int, reason: str) -> EpisodeReport:
    """The report of an episode whose checks came to no end."""
    from lerobot_env_bimanual.verification.fault import Fault
    from lerobot_env_bimanual.verification.verifier import EpisodeReport

    return EpisodeReport(index, "", {"checked": (Fault(reason),)})
