"""The command `dataset verify`: every row and image of a dataset is what it claims to be."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lerobot_bimanual.errors import BimanualError, check_range
from lerobot_env_bimanual.commands.dataset_replay import parse_episodes

if TYPE_CHECKING:
    from lerobot_bimanual.dataset.provenance import Provenance
    from lerobot_env_bimanual.verification.fault import Fault
    from lerobot_env_bimanual.verification.verifier import EpisodeReport, Thoroughness, Verifier

PASSED, FAULTS, NOT_REPLAYED = 0, 1, 3
"""Exit codes; 2 is a command line that cannot be understood."""

MAX_LINES_PER_CHECK = 10
LOADED_AFTER = ("description", "schema", "episodes", "statistics of the dataset")
"""Checks of the dataset without which LeRobot's loader is not used: it might ask the Hub for what is missing."""

PRELOADED = ("lerobot.datasets.lerobot_dataset",)
"""Decodes depth and loads rows: seconds of LeRobot and torch."""


@dataclass
class DatasetVerifyConfig:
    """Options of the command `dataset verify`."""

    # Folder of a dataset that `dataset generate` made; all its views are checked
    root: Path = field(kw_only=True)
    episode_indices: str = "all"  # `all`, indices 0,3,7 or a half-open range a:b
    # Rows of every episode whose images are rendered again and compared: a number, or `all`.
    render: str = "2"
    # Seed of the random choice of those rows, and of the episode that is read through LeRobot's loader.
    sample_seed: int = 0
    workers: int = 0  # processes; 0 takes one per core


def dataset_verify(config: DatasetVerifyConfig) -> int:
    """Check files, schema, columns, statistics, images and replay of a dataset.

    Every file is hashed, every image decoded, every episode played again and every column compared with it; images of
    a few random rows of every episode are rendered again, and one episode is also read through LeRobot's loader. Prints
    how many episodes passed each check, what is wrong and where, and one hash per view for all its content.

    Exits with 0 if all checks passed, with 1 if anything is wrong, and with 3 if nothing is wrong but the episodes were
    not replayed, because the dataset names other versions of the simulation than are installed, or none.

    Examples:
        lerobot-bimanual dataset verify --root=data/lift_ball
        lerobot-bimanual dataset verify --root=data/lift_ball --episode_indices=0:20 --render=all
    """
    check_range("sample_seed", config.sample_seed, 0)
    os.environ["HF_HUB_OFFLINE"] = "1"  # for LeRobot's loader in workers
    rows = _parse_rows(config.render)
    roots = _views(config.root)
    with tempfile.TemporaryDirectory(prefix="bimanual_verify_") as cache:
        views = [_look_at(root, config, rows, Path(cache)) for root in roots]
        _verify_episodes(views, config.workers)
    for view in views:
        view.print()
    if any(view.is_wrong for view in views):
        print("next: restore the files, or make the dataset again with lerobot-bimanual dataset regenerate")
        return FAULTS
    if any(view.remark for view in views):
        return NOT_REPLAYED
    print("next: lerobot-bimanual policy benchmark, or lerobot-bimanual dataset push")
    return PASSED


def _views(root: Path) -> list[Path]:
    """Folders of the views of a dataset, with those that should be there and are not."""
    from lerobot_bimanual.dataset.provenance import Provenance
    from lerobot_bimanual.dataset.reader import find_view, views_below
    from lerobot_bimanual.dataset.schema import VIEWS

    present = views_below(root)
    if not present:
        return [find_view(root)]
    promised: set[Any] = {view for view in VIEWS if (root / view).is_dir()}
    for place in present:
        with contextlib.suppress(BimanualError, TypeError):  # which the checks of that view tell
            provenance = Provenance.of_dataset(place)
            promised.update(() if provenance is None else provenance.settings.get("views", ()))
    return [root / view for view in VIEWS if view in promised]


@dataclass
class _ViewReport:
    """What was found in one view.

    Attributes:
        root: its folder.
        metadata: faults of the dataset as a whole, by check.
        remark: what is not checked, and why; may be empty.
        indices: episodes that are checked.
        is_whole: whether these are all.
        thoroughness: how they are checked.
        episodes: reports of them.
    """

    root: Path
    metadata: Mapping[str, tuple[Fault, ...]]
    remark: str
    indices: Sequence[int]
    is_whole: bool
    thoroughness: Thoroughness
    episodes: list[EpisodeReport] = field(default_factory=list)

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
        from lerobot_bimanual.dataset.content_hash import combined_hash
        from lerobot_bimanual.tables import print_table

        results: dict[str, list[tuple[int | None, tuple[Fault, ...]]]] = defaultdict(list)
        for check, episode, faults in self._results():
            results[check].append((episode, faults))
        rows = []
        for check, outcomes in results.items():
            failed = sum(bool(faults) for _, faults in outcomes)
            rows.append((check, len(outcomes) - failed, failed))
        print_table(("check", "passed", "failed"), rows, str(self.root))
        if self.remark:
            print(self.remark)
        for check, outcomes in results.items():
            lines = [_line(episode, fault) for episode, faults in outcomes for fault in faults]
            for line in lines[:MAX_LINES_PER_CHECK]:
                print(f"{check}: {line}")
            if len(lines) > MAX_LINES_PER_CHECK:
                print(f"{check}: {len(lines) - MAX_LINES_PER_CHECK} more")
        hashes = [episode.content_hash for episode in self.episodes]
        if self.is_whole and all(hashes):
            print(f"content hash: {combined_hash(hashes)}")


def _line(episode: int | None, fault: Fault) -> str:
    place = "" if episode is None else f"episode {episode}: "
    if fault.row is not None:
        place = f"episode {episode}, row {fault.row}: "
    # Names of columns and files are those that the dataset has, and a terminal obeys what it cannot print.
    return place + (fault.text if fault.text.isprintable() else repr(fault.text))


def _look_at(root: Path, config: DatasetVerifyConfig, rows: int, cache: Path) -> _ViewReport:
    """Check a view as a whole, and plan what is done with its episodes: nothing if none can be found."""
    import numpy as np

    from lerobot_bimanual.dataset.reader import RecordedDataset
    from lerobot_env_bimanual.verification.fault import Fault
    from lerobot_env_bimanual.verification.metadata import READABLE, verify_metadata
    from lerobot_env_bimanual.verification.verifier import Thoroughness

    metadata = verify_metadata(root)
    if metadata.get(READABLE):
        return _ViewReport(root, metadata, "", [], False, Thoroughness(False, 0))
    try:
        dataset = RecordedDataset(root)
    except BimanualError as error:
        metadata = {**metadata, READABLE: (Fault(str(error)),)}
        return _ViewReport(root, metadata, "", [], False, Thoroughness(False, 0))
    indices = parse_episodes(config.episode_indices, len(dataset))
    remark = _why_not_replayed(dataset.provenance)
    sampled = None
    if not any(metadata[check] for check in LOADED_AFTER):
        sampled = int(np.random.default_rng(config.sample_seed).choice(indices))
    thoroughness = Thoroughness(not remark, rows, config.sample_seed, sampled, cache)
    return _ViewReport(root, metadata, remark, indices, indices == list(range(len(dataset))), thoroughness)


def _why_not_replayed(provenance: Provenance | None) -> str:
    """Empty if this installation can play the dataset's episodes."""
    from lerobot_env_bimanual.experts.world_version import other_worlds

    if provenance is None:
        return "not replayed, so not passed: the dataset does not say with which versions it was generated"
    if others := provenance.other_versions():
        listing = ", ".join(
            f"{package} {versions[0]} (installed: {versions[1]})" for package, versions in others.items()
        )
        return f"not replayed, so not passed: generated with {listing}"
    if worlds := other_worlds(provenance.worlds, provenance.perturb):
        return f"not replayed, so not passed: it holds {worlds}, where the same seeds mean other episodes"
    return ""


def _parse_rows(text: str) -> int:
    from lerobot_env_bimanual.verification.rendering import ALL_ROWS

    if text == "all":
        return ALL_ROWS
    if not text.isdecimal():
        raise BimanualError(
            f"render is {text!r}, but must be a number of rows per episode, such as 3, or 'all'"
        )
    return int(text)


def _verify_episodes(views: Sequence[_ViewReport], workers: int) -> None:
    """Check the episodes of all views, both views of an episode in one go, which plays it once."""
    from lerobot_env_bimanual.verification.fault import Fault
    from lerobot_env_bimanual.verification.metadata import READABLE
    from lerobot_env_bimanual.verification.verifier import EpisodeReport
    from lerobot_env_bimanual.workers import WorkerPool

    plans = [(view.root, view.thoroughness, frozenset(view.indices)) for view in views]
    indices = list(dict.fromkeys(index for view in views for index in view.indices))
    if not indices:
        return

    def unverified(index: int, reason: str) -> list[EpisodeReport | None]:
        """The reports of an episode whose checks came to no end."""
        report = EpisodeReport(index, "", {READABLE: (Fault(reason),)})
        return [report if index in view.indices else None for view in views]

    with WorkerPool(workers, _prepare, (plans,), PRELOADED) as pool:
        for reports in pool.map(_verify, indices, "verifying", "episode", failed=unverified):
            for view, report in zip(views, reports, strict=True):
                if report is not None:
                    view.episodes.append(report)


_verifiers: list[tuple[Verifier, frozenset[int]]] = []


def _prepare(plans: Sequence[tuple[Path, Thoroughness, frozenset[int]]]) -> None:
    import av.logging
    import datasets
    import pyarrow

    from lerobot_env_bimanual.verification.simulation import Player
    from lerobot_env_bimanual.verification.verifier import Verifier

    av.logging.set_libav_level(av.logging.PANIC)  # what is broken comes back as a fault
    datasets.disable_progress_bars()
    pyarrow.set_cpu_count(1)
    player = Player()
    _verifiers[:] = [(Verifier(root, thoroughness, player), indices) for root, thoroughness, indices in plans]


def _verify(index: int) -> list[EpisodeReport | None]:
    return [verifier.verify(index) if index in indices else None for verifier, indices in _verifiers]
