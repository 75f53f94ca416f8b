"""The command `dataset verify`: every row and image of a dataset is what it claims to be."""

from __future__ import annotations

import contextlib
import secrets
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lerobot_bimanual.errors import BimanualError, check_range
from lerobot_bimanual.terminal import print_table, say, show_next
from lerobot_env_bimanual.workers import WorkerPool

if TYPE_CHECKING:
    from lerobot_bimanual.dataset.provenance import Provenance
    from lerobot_env_bimanual.verification.fault import Fault, Findings
    from lerobot_env_bimanual.verification.verifier import Verifier

PASSED, FAULTS, NOT_REPLAYED = 0, 1, 3
"""Exit codes; 2 is a command line that cannot be understood."""

MAX_LINES_PER_CHECK = 10
PRELOADED = ("lerobot.datasets.depth_utils",)
"""Decodes depth: seconds of LeRobot and torch."""


@dataclass
class DatasetVerifyConfig:
    """Options of the command `dataset verify`."""

    # Folder of a dataset that `dataset generate` made; all its views are checked
    root: Path = field(kw_only=True)
    episode_indices: str = "all"  # `all`, indices 0,3,7 or a half-open range a:b
    # Rows of every episode whose images are rendered again and compared: a number, or `all`.
    render: str = "4"
    # Seed of the random choice of those rows; by default another one in every run, which is printed.
    sample_seed: int | None = None
    workers: int = 0  # processes; 0 takes one per core


def dataset_verify(config: DatasetVerifyConfig) -> int:
    """Check files, columns, images and replay of a dataset.

    Every file is hashed, every image decoded, every episode played again and every column compared with it; images of
    a few random rows of every episode are rendered again. Prints how many episodes passed each check, and what is wrong
    and where.

    Exits with 0 if all checks passed, with 1 if anything is wrong, and with 3 if nothing is wrong but the episodes were
    not replayed, because the dataset names other versions of the simulation than are installed, or none.

    Examples:
        lerobot-bimanual dataset verify --root=data/lift_ball
        lerobot-bimanual dataset verify --root=data/lift_ball --episode_indices=0:20 --render=all
    """
    from lerobot_bimanual.benchmark.recipes import GROUP, Recipe
    from lerobot_bimanual.distributions import entries
    from lerobot_env_bimanual.verification.fault import READABLE, Fault, Findings
    from lerobot_env_bimanual.verification.rendering import ALL_ROWS

    seed = secrets.randbelow(2**32) if config.sample_seed is None else config.sample_seed
    check_range("sample_seed", seed, 0)
    if config.render != "all" and not config.render.isdecimal():
        raise BimanualError(
            f"render is {config.render!r}, but must be a number of rows per episode, such as 3, or 'all'"
        )
    rows = ALL_ROWS if config.render == "all" else int(config.render)
    views = [_ViewReport(root) for root in _views(config.root)]
    readable = [view for view in views if view.n_episodes]
    if readable:
        indices = parse_episodes(config.episode_indices, max(view.n_episodes for view in readable))

        def unverified(_: int, reason: str) -> list[Findings]:
            """The findings for an episode whose checks did not finish."""
            return [Findings({READABLE: [Fault(reason)]})] * len(readable)

        # Both views of an episode are verified in one go, which plays it once.
        verify = partial(_verify, tuple((view.root, not view.remark) for view in readable), rows, seed)
        with WorkerPool(config.workers, PRELOADED) as pool:
            found = pool.map(verify, indices, "verifying", "episode", failed=unverified)
            for index, of_views in zip(indices, found, strict=True):
                for view, faults in zip(readable, of_views, strict=True):
                    view.add(index, faults)
    for view in views:
        view.print()
    print(f"rows were drawn by --sample_seed={seed}")
    if any(view.is_wrong for view in views):
        show_next("lerobot-bimanual", "dataset", "generate", "--help")  # the card has the flags that made it
        return FAULTS
    if any(view.remark for view in views):
        return NOT_REPLAYED
    for view in views:
        if view.provenance and view.provenance.is_for_keypose_policies and "peract2" in entries(GROUP):
            recipe = Recipe.find("peract2", "small").file
            repo_id = view.provenance.settings.get("repo_id", f"local/{view.root.name}")
            flags = (f"--config_path={recipe}", f"--dataset.repo_id={repo_id}", f"--dataset.root={view.root}")
            show_next("lerobot-bimanual-train", *flags, "--output_dir=outputs/peract2")
    return PASSED


def parse_episodes(text: str, count: int) -> list[int]:
    """Episode indices that `all`, a comma list or a half-open range `a:b` means, of a dataset of `count` episodes.

    Raises:
        BimanualError: the text is invalid, or there is no such episode.
    """
    indices: Sequence[int] = ()
    try:
        if text == "all":
            indices = range(count)
        elif ":" in text:
            indices = range(*map(int, text.split(":")))
        else:
            indices = [int(index) for index in text.split(",")]
    except (ValueError, TypeError):
        pass
    if not indices or not all(0 <= index < count for index in indices):
        raise BimanualError(
            f"episode_indices is {text!r}, but must be 'all', indices such as 0,3,7 or a range such as 0:10, from 0 to "
            f"{count - 1}"
        )
    return list(indices)


def _views(root: Path) -> list[Path]:
    """Folders of the views of a dataset, including missing ones that its provenance names."""
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


class _ViewReport:
    """What was found in one view; its files are checked at once.

    Attributes:
        root: its folder.
        n_episodes: 0 if none can be read.
        provenance: where the dataset comes from; None if it cannot be read.
        remark: what is not checked, and why; may be empty.
    """

    def __init__(self, root: Path):
        from lerobot_bimanual.dataset.reader import RecordedDataset
        from lerobot_env_bimanual.experts.world_version import simulation_difference
        from lerobot_env_bimanual.verification.fault import READABLE
        from lerobot_env_bimanual.verification.verifier import check_files

        self.root, self.n_episodes, self.remark = root, 0, ""
        self.provenance: Provenance | None = None
        self._faults: dict[str, list[tuple[int | None, list[Fault]]]] = defaultdict(list)
        found = check_files(root)
        if READABLE not in found:
            with found.of(READABLE):
                dataset = RecordedDataset(root)
                self.n_episodes, self.provenance = len(dataset), dataset.provenance
                if difference := simulation_difference(dataset.provenance):
                    self.remark = f"not replayed, so not passed: {difference}"
        self.add(None, found)

    def add(self, episode: int | None, found: Findings) -> None:
        """Add what was found in an episode, or in the files of all."""
        for check, faults in found.items():
            self._faults[check].append((episode, faults))

    @property
    def is_wrong(self) -> bool:
        """Whether any check failed."""
        return any(faults for outcomes in self._faults.values() for _, faults in outcomes)

    def print(self) -> None:
        """The table, and the list of what is wrong."""
        import pandas as pd

        rows = {
            check: [sum(not faults for _, faults in outcomes), sum(bool(faults) for _, faults in outcomes)]
            for check, outcomes in self._faults.items()
        }
        table = pd.DataFrame(rows, index=pd.Index(["passed", "failed"])).T
        print_table(table.rename_axis("check").reset_index(), str(self.root))
        if self.remark:
            say(self.remark)
        for check, outcomes in self._faults.items():
            lines = [_line(episode, fault) for episode, faults in outcomes for fault in faults]
            for line in lines[:MAX_LINES_PER_CHECK]:
                say(f"{check}: {line}")
            if len(lines) > MAX_LINES_PER_CHECK:
                print(f"{check}: {len(lines) - MAX_LINES_PER_CHECK} more")


def _line(episode: int | None, fault: Fault) -> str:
    place = "" if episode is None else f"episode {episode}: "
    if fault.row is not None:
        place = f"episode {episode}, row {fault.row}: "
    # Names of columns and files come from the dataset; a terminal would execute control characters in them.
    return place + (fault.text if fault.text.isprintable() else repr(fault.text))


@lru_cache(maxsize=1)
def _verifiers(views: tuple[tuple[Path, bool], ...], rows: int, seed: int) -> list[Verifier]:
    """The verifiers of this process, one per view; each is given by its folder and whether it is played again."""
    import av.logging
    import datasets
    import pyarrow

    from lerobot_env_bimanual.verification.columns import Player
    from lerobot_env_bimanual.verification.verifier import Verifier

    av.logging.set_libav_level(av.logging.PANIC)  # what is broken comes back as a fault
    datasets.disable_progress_bars()
    pyarrow.set_cpu_count(1)
    player = Player()
    return [Verifier(root, player if is_played else None, rows, seed) for root, is_played in views]


def _verify(views: tuple[tuple[Path, bool], ...], rows: int, seed: int, index: int) -> list[Findings]:
    return [verifier.verify(index) for verifier in _verifiers(views, rows, seed)]
