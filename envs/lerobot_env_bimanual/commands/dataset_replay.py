"""The command `dataset replay`: proof that a dataset's actions do what its rows say."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from lerobot_bimanual.errors import BimanualError, DatasetError

if TYPE_CHECKING:
    from lerobot_bimanual.dataset.reader import RecordedDataset
    from lerobot_bimanual.dataset.schema import View
    from lerobot_bimanual.episode import EpisodeMeta
    from lerobot_env_bimanual.replay import Replayer, ReplayMode, ReplayResult


@dataclass
class DatasetReplayConfig:
    """Options of the command `dataset replay`."""

    root: Path = field(kw_only=True)  # folder of a dataset that `dataset generate` made
    # `joint` plays the column `action` open-loop (view `frames`), `keypose` executes the recorded keyposes (either
    # view). Both compare the state after every tick that is recorded.
    replay: Literal["joint", "keypose"] = "joint"
    episode_indices: str = "all"  # `all`, indices 0,3,7 or a half-open range a:b
    workers: int = 0  # processes; 0 takes one per core


def dataset_replay(config: DatasetReplayConfig) -> int:
    """Replay recorded episodes from their seeds and compare the states.

    Exits with 1 if an episode ends in another state, or is not solved.

    Examples:
        lerobot-bimanual dataset replay --root=data/lift_ball
        lerobot-bimanual dataset replay --root=data/lift_ball --replay=keypose --episode_indices=0:10
    """
    from lerobot_bimanual.dataset.reader import RecordedDataset, find_view
    from lerobot_env_bimanual.workers import WorkerPool

    preferred: tuple[View, ...] = ("frames",) if config.replay == "joint" else ("frames", "keyframes")
    dataset = RecordedDataset(find_view(config.root, preferred))
    if config.replay == "joint" and dataset.view != "frames":
        raise DatasetError(
            f"{dataset.root} is a {dataset.view!r} view, which does not store every action. Replay the 'frames' view "
            "of the same episodes, or use --replay=keypose"
        )
    _warn_of_other_versions(dataset)
    indices = parse_episodes(config.episode_indices, len(dataset))
    with WorkerPool(config.workers, _prepare, (dataset.root, config.replay)) as pool:
        results = pool.map(_replay, indices, "replay", "episode", failed=lambda _, reason: reason)
        played = dict(zip(indices, results, strict=True))
    _print({index: result for index, result in played.items() if not isinstance(result, str)})
    unplayed = {index: result for index, result in played.items() if isinstance(result, str)}
    for index, reason in unplayed.items():
        print(f"episode {index}: not played: {reason}")
    matches = all(not isinstance(result, str) and result[1].matches for result in played.values())
    print(f"next: lerobot-bimanual dataset verify --root={config.root}")
    return 0 if matches else 1


def parse_episodes(text: str, count: int) -> list[int]:
    """Episode indices that `all`, a comma list or a half-open range `a:b` means, of a dataset of `count` episodes.

    Raises:
        BimanualError: the text is invalid, or there is no such episode.
    """
    try:
        indices = _read_indices(text, count)
    except ValueError:
        indices = []
    ends = (indices[0], indices[-1]) if isinstance(indices, range) and indices else indices
    if not indices or not all(0 <= index < count for index in ends):
        raise BimanualError(
            f"episode_indices is {text!r}, but must be 'all', indices such as 0,3,7 or a range such as 0:10, from 0 to "
            f"{count - 1}"
        )
    return list(indices)


def _read_indices(text: str, count: int) -> Sequence[int]:
    """What a text means, as a range where it may be longer than memory."""
    if text == "all":
        return range(count)
    if ":" in text:
        first, end = text.split(":")
        return range(int(first), int(end))
    return [int(index) for index in text.split(",")]


def _warn_of_other_versions(dataset: RecordedDataset) -> None:
    from lerobot_env_bimanual.experts.world_version import other_worlds

    if dataset.provenance is None:
        print(f"warning: {dataset.root} does not say with which versions it was generated")
        return
    for package, (recorded, installed) in dataset.provenance.other_versions().items():
        print(
            f"warning: generated with {package} {recorded}, but {installed} is installed: "
            "trajectories may differ"
        )
    if worlds := other_worlds(dataset.provenance.worlds, dataset.provenance.perturb):
        print(f"warning: it holds {worlds}: trajectories differ")


def _print(played: Mapping[int, tuple[EpisodeMeta, ReplayResult]]) -> None:
    from lerobot_bimanual.tables import print_table

    groups: dict[tuple[str, int], list[ReplayResult]] = defaultdict(list)
    for meta, result in played.values():
        groups[meta.task, meta.variation].append(result)
    rows = []
    for (task, variation), group in sorted(groups.items()):
        same = sum(result.divergence is None for result in group)
        solved = sum(result.success for result in group)
        ticks = sum(result.ticks for result in group)
        rows.append((task, variation, len(group), ticks, same, solved))
    print_table(("task", "variation", "episodes", "ticks", "same states", "solved"), rows)
    for index, (meta, result) in played.items():
        if not result.matches:
            end = "solved" if result.success else f"not solved ({result.failure or 'conditions unmet'})"
            print(f"episode {index} ({meta.task}, seed {meta.seed}): {result.comparison}, {end}")


_replayer: Replayer | None = None


def _prepare(root: Path, mode: ReplayMode) -> None:
    from lerobot_env_bimanual.replay import Replayer

    global _replayer
    _replayer = Replayer(root, mode)


def _replay(index: int) -> tuple[EpisodeMeta, ReplayResult] | str:
    assert _replayer is not None
    return _replayer.replay(index)
