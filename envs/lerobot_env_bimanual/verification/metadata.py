"""Checks of a dataset as a whole: its files, what describes them, and where it comes from."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.checksums import checksum_problems, plain_files
from lerobot_bimanual.dataset.provenance import Provenance, other_lerobot
from lerobot_bimanual.dataset.reader import (
    BOOKKEEPING,
    DATA_PATH,
    IMAGE_TYPES,
    VIDEO_PATH,
    RecordedDataset,
    episode_table,
    is_depth,
    read_info,
)
from lerobot_bimanual.errors import DatasetError
from lerobot_env_bimanual.verification.fault import Fault, Findings
from lerobot_env_bimanual.verification.statistics import check_dataset_statistics

READABLE = "readable"
"""Whether something can be read at all; nothing else is checked of what cannot."""

LANGUAGE_COLUMNS = ("language_persistent", "language_events")
"""Columns that LeRobot's annotation adds to a dataset; they may be there."""


def verify_metadata(root: Path) -> Findings:
    """What is wrong with a dataset as a whole, by check.

    Where it holds links or pipes that is all that is said, as every other check would follow them.
    """
    if odd := plain_files(root)[1]:
        return Findings({READABLE: [Fault(text) for text in odd]})
    findings = Findings()
    for name, check in METADATA_CHECKS.items():
        with findings.of(name) as found:
            found += check(root)
    return findings


def check_checksums(root: Path) -> Iterator[Fault]:
    """Every file is as it was published."""
    yield from map(Fault, checksum_problems(root))


def check_description(root: Path) -> Iterator[Fault]:
    """What `meta/info.json` says of the dataset is what LeRobot writes for these episodes."""
    from lerobot.datasets.dataset_metadata import CODEBASE_VERSION

    info, lengths = read_info(root), episode_table(root, ["episode_index", "length"])["length"].to_pylist()
    by_another = other_lerobot(Provenance.of_dataset(root))
    has_videos = any(feature["dtype"] == "video" for feature in info["features"].values())
    wanted = {
        "codebase_version": info.get("codebase_version") if by_another else CODEBASE_VERSION,
        "fps": schema.FPS,
        "robot_type": schema.ROBOT_TYPE,
        "total_episodes": len(lengths),
        "total_frames": sum(lengths),
        "splits": {"train": f"0:{len(lengths)}"},
        "data_path": DATA_PATH,
        "video_path": VIDEO_PATH if has_videos else None,
    }
    for name, value in wanted.items():
        if not _same(info.get(name), value):
            yield Fault(f"{name} is {info.get(name)!r}, not {value!r}")


def check_schema(root: Path) -> Iterator[Fault]:
    """The declared features are the schema's for this view, with LeRobot's own and one size for all cameras."""
    dataset = RecordedDataset(root)
    features = dataset.info["features"]
    sizes = {tuple(f["shape"][:2]) for f in features.values() if f["dtype"] in IMAGE_TYPES}
    if len(sizes) != 1:
        yield Fault(f"images have the sizes {sorted(sizes)}, but must have one")
        return
    height, width = sizes.pop()
    outcome = schema.SUCCESS in features
    wanted = schema.features(dataset.cameras, height, width, dataset.view, dataset.has_depth, outcome)
    wanted |= {key: {"dtype": dtype, "shape": (1,), "names": None} for key, dtype in BOOKKEEPING.items()}
    found = {key: feature for key, feature in features.items() if key not in LANGUAGE_COLUMNS}
    for key in sorted(wanted.keys() ^ found.keys()):
        yield Fault(f"{key} is {'missing' if key in wanted else 'not in the schema'}")
    for key in sorted(wanted.keys() & found.keys()):
        for aspect in ("dtype", "shape", "names"):
            ours, theirs = wanted[key][aspect], found[key].get(aspect)
            if not _same(theirs, ours):
                yield Fault(f"{aspect} of {key} is {theirs!r}, not {ours!r}")
        if is_depth(found[key]) and (unit := found[key]["info"].get("depth_unit", "mm")) != "mm":
            yield Fault(f"the unit of {key} is {unit!r}, not 'mm'")


def check_episodes(root: Path) -> Iterator[Fault]:
    """The episodes follow each other without a gap, and the files hold their rows and no other."""
    columns = ["episode_index", "length", "dataset_from_index", "dataset_to_index"]
    _, lengths, starts, ends = (np.asarray(column) for column in episode_table(root, columns).itercolumns())
    wanted = np.cumsum(lengths)
    wrong = np.flatnonzero((ends != wanted) | (starts != wanted - lengths))
    for episode in wrong[:1].tolist():
        yield Fault(f"episode {episode} is said to have the rows {starts[episode]} to {ends[episode]}")
    try:
        rows = sum(pq.read_metadata(path).num_rows for path in root.glob("data/*/*.parquet"))
    except (pa.ArrowException, OSError) as error:
        raise DatasetError(f"a file of rows is damaged: {error}") from error
    if rows != sum(lengths):
        yield Fault(f"the files hold {rows} rows, but the episodes have {sum(lengths)}")


def check_provenance(root: Path) -> Iterator[Fault]:
    """It tells view and cameras, and one key per episode."""
    dataset = RecordedDataset(root)
    provenance = dataset.provenance
    if provenance is None and schema.SUCCESS in dataset.info["features"]:
        return  # policies' episodes, which no command makes from settings
    if provenance is None:
        yield Fault("the dataset does not say where it comes from: meta/bimanual.json is missing")
        return
    for what, said, held in (
        ("view", provenance.view, dataset.view),
        ("number of episodes", len(provenance.episodes), len(dataset)),
        ("cameras", provenance.settings.get("cameras"), [*dataset.cameras]),
    ):
        if said != held:
            yield Fault(f"its {what} is {said}, but the dataset's is {held}")
    for key, count in Counter(provenance.episodes).items():
        if count > 1:
            yield Fault(f"it lists {key} {count} times")


METADATA_CHECKS: dict[str, Callable[[Path], Iterator[Fault]]] = {
    "checksums": check_checksums,
    "description": check_description,
    "schema": check_schema,
    "episodes": check_episodes,
    "statistics of the dataset": check_dataset_statistics,
    "provenance": check_provenance,
}


def _same(found: Any, wanted: Any) -> bool:
    """Equality in JSON, where true is not 1 and a tuple is a list."""
    return json.dumps(found, sort_keys=True) == json.dumps(wanted, sort_keys=True)
