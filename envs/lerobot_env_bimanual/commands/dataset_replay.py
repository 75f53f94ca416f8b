"""The command `dataset replay`: proof that a dataset's actions do what its rows say."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.terminal import print_table, say, show_next
from lerobot_env_bimanual.workers import WorkerPool

if TYPE_CHECKING:
    from lerobot_bimanual.dataset.reader import RecordedDataset
    from lerobot_bimanual.episode import EpisodeMeta
    from lerobot_env_bimanual.replay import ReplayResult


@dataclass
class DatasetReplayConfig:
    """Options of the command `dataset replay`."""

    # Folder of a dataset that `dataset generate` made; of two views, `frames` unless it is the folder of `keyframes`
    root: Path = field(kw_only=True)
    episode_indices: str = "all"  # `all`, indices 0,3,7 or a half-open range a:b
    workers: int = 0  # processes; 0 takes one per core


def dataset_replay(config: DatasetReplayConfig) -> int:
    """Play the column `action` of recorded episodes from their seeds, and compare the states.

    That of `frames` is a joint action for every tick, that of `keyframes` a keypose for a whole motion. The state is compared
    after every tick that is recorded. Exits with 1 if an episode ends in another state, or is not solved.

    Examples:
        lerobot-bimanual dataset replay --root=data/lift_ball
        lerobot-bimanual dataset replay --root=data/lift_ball/keyframes --episode_indices=0:10
    """
    from lerobot_bimanual.dataset.reader import RecordedDataset, find_view
    from lerobot_env_bimanual.experts.world_version import other_simulation

    dataset = RecordedDataset(find_view(config.root))
    if difference := other_simulation(dataset.provenance):
        say(f"warning: {difference}: trajectories may differ")
    indices = parse_episodes(config.episode_indices, len(dataset))
    play = partial(_replay, dataset.root)
    with WorkerPool(config.workers) as pool:
        results = pool.map(play, indices, "replay", "episode", failed=lambda _, reason: reason)
        played = dict(zip(indices, results, strict=True))
    _print({index: result for index, result in played.items() if not isinstance(result, str)})
    for index, result in played.items():
        if isinstance(result, str):
            say(f"episode {index}: not played: {result}")
    matches = all(not isinstance(result, str) and result[1].matches for result in played.values())
    show_next("lerobot-bimanual", "dataset", "verify", f"--root={config.root}")
    return 0 if matches else 1


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


def _print(played: Mapping[int, tuple[EpisodeMeta, ReplayResult]]) -> None:
    import pandas as pd

    rows = [
        {
            "task": meta.task,
            "variation": meta.variation,
            "episodes": 1,
            "ticks": result.ticks,
            "same states": result.divergence is None,
            "solved": result.success,
        }
        for meta, result in played.values()
    ]
    if rows:
        table = pd.DataFrame(rows).groupby(["task", "variation"]).sum()
        print_table(table.reset_index())
    for index, (meta, result) in played.items():
        if not result.matches:
            end = "solved" if result.success else f"not solved ({result.failure or 'conditions unmet'})"
            states = "same states"
            if result.divergence is not None:
                when = "at the start" if result.divergence < 0 else f"after tick {result.divergence}"
                states = f"another state {when}"
            say(f"episode {index} ({meta.task}, seed {meta.seed}): {states}, {end}")


@lru_cache(maxsize=1)
def _dataset(root: Path) -> RecordedDataset:
    from lerobot_bimanual.dataset.reader import RecordedDataset

    return RecordedDataset(root)


def _replay(root: Path, index: int) -> tuple[EpisodeMeta, ReplayResult] | str:
    from lerobot_env_bimanual.replay import replay_recorded

    return replay_recorded(_dataset(root), index)
