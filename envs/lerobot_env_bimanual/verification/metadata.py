"""Checks of a dataset as a whole: its files, what describes them, and where it says it comes from."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import yaml

from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.card import CARD_FILE, dataset_card
from lerobot_bimanual.dataset.picture import PICTURE_FILE
from lerobot_bimanual.dataset.provenance import PROVENANCE_FILE, Provenance
from lerobot_bimanual.dataset.reader import (
    BOOKKEEPING,
    DATA_PATH,
    IMAGE_TYPES,
    INFO_FILE,
    VIDEO_PATH,
    RecordedDataset,
    data_file,
    read_info,
    video_file,
)
from lerobot_bimanual.dataset.seal import HARMLESS, SEAL_FILE, seal_problems
from lerobot_bimanual.versions import STAMPED_PACKAGES
from lerobot_env_bimanual.options import MAX_IMAGE_SIDE, MIN_IMAGE_SIDE
from lerobot_env_bimanual.verification.bookkeeping import BOOKKEEPING_CHECKS, TASKS_FILE, Bookkeeping
from lerobot_env_bimanual.verification.fault import Fault
from lerobot_env_bimanual.verification.plan import check_plan
from lerobot_env_bimanual.verification.statistics import STATISTICS_FILE, check_dataset_statistics
from lerobot_env_bimanual.verification.subtasks import LANGUAGE_FEATURES, check_subtasks

NAMED_FILES = (CARD_FILE, SEAL_FILE, INFO_FILE, STATISTICS_FILE, TASKS_FILE, PROVENANCE_FILE, PICTURE_FILE)
"""Files that every dataset has, besides tables and videos."""


def check_seal(root: Path) -> Iterator[Fault]:
    """Every file is as it was published."""
    yield from map(Fault, seal_problems(root))


def check_files(root: Path) -> Iterator[Fault]:
    """The files that the tables name are there, and no other, which a loader might read."""
    info, entries = read_info(root), Bookkeeping(root).entries
    videos = [key for key, feature in info["features"].items() if feature["dtype"] == "video"]
    wanted = {str(path) for path in NAMED_FILES}
    for entry in entries:
        wanted.add(data_file(root, info, entry).relative_to(root).as_posix())
        wanted.update(video_file(root, info, entry, key).relative_to(root).as_posix() for key in videos)
    found = {
        path.relative_to(root).as_posix()
        for path in root.rglob("*")
        if not path.is_dir() and path.relative_to(root).parts[0] not in HARMLESS
    }
    found -= {name for name in found if re.fullmatch(r"meta/episodes/chunk-\d{3}/file-\d{3}\.parquet", name)}
    for name in sorted(wanted - found):
        yield Fault(f"{name} is missing")
    for name in sorted(found - wanted):
        yield Fault(f"{name} belongs to nothing in the dataset")


def check_description(root: Path) -> Iterator[Fault]:
    """Every field of `meta/info.json` but the features is what LeRobot writes for these episodes."""
    from lerobot.datasets.dataset_metadata import CODEBASE_VERSION
    from lerobot.datasets.utils import (
        DEFAULT_CHUNK_SIZE,
        DEFAULT_DATA_FILE_SIZE_IN_MB,
        DEFAULT_VIDEO_FILE_SIZE_IN_MB,
    )

    info, books = read_info(root), Bookkeeping(root)
    has_videos = any(feature["dtype"] == "video" for feature in info["features"].values())
    wanted = {
        "codebase_version": CODEBASE_VERSION,
        "fps": schema.FPS,
        "robot_type": schema.ROBOT_TYPE,
        "total_episodes": len(books.entries),
        "total_frames": sum(entry["length"] for entry in books.entries),
        "total_tasks": len(books.sentences),
        "splits": {"train": f"0:{len(books.entries)}"},
        "data_path": DATA_PATH,
        "video_path": VIDEO_PATH if has_videos else None,
        "chunks_size": DEFAULT_CHUNK_SIZE,
        "data_files_size_in_mb": DEFAULT_DATA_FILE_SIZE_IN_MB,
        "video_files_size_in_mb": DEFAULT_VIDEO_FILE_SIZE_IN_MB,
    }
    for name in sorted((wanted.keys() | info.keys()) - {"features"}):
        if name not in info:
            yield Fault(f"{name} is missing, but must be {wanted[name]!r}")
        elif name not in wanted:
            yield Fault(f"{name} is nothing that LeRobot writes here")
        elif not _same(info[name], wanted[name]):
            yield Fault(f"{name} is {info[name]!r}, not {wanted[name]!r}")


def check_schema(root: Path) -> Iterator[Fault]:
    """The declared features are the schema's for this view, with LeRobot's own and one size for all cameras."""
    dataset = RecordedDataset(root)
    features = dataset.info["features"]
    sizes = {tuple(f["shape"][:2]) for f in features.values() if f["dtype"] in IMAGE_TYPES}
    if len(sizes) != 1:
        yield Fault(f"images have the sizes {sorted(sizes)}, but must have one")
        return
    height, width = sizes.pop()
    if not MIN_IMAGE_SIDE <= min(height, width) <= max(height, width) <= MAX_IMAGE_SIDE:
        yield Fault(f"images have {height}x{width} pixels, beyond {MIN_IMAGE_SIDE} to {MAX_IMAGE_SIDE}")
    wanted = expected_features(dataset.cameras, height, width, dataset.view, dataset.has_depth)
    if features.keys() & LANGUAGE_FEATURES.keys():
        wanted |= LANGUAGE_FEATURES
    for key in sorted(wanted.keys() - features.keys()):
        yield Fault(f"{key} is missing")
    for key in sorted(features.keys() - wanted.keys()):
        yield Fault(f"{key} is not in the schema")
    for key in sorted(wanted.keys() & features.keys()):
        for aspect, found, ours in _differences(features[key], wanted[key]):
            yield Fault(f"{aspect} of {key} is {found!r}, not {ours!r}")


def expected_features(
    cameras: tuple[str, ...], height: int, width: int, view: schema.View, depth: bool = True
) -> dict[str, dict[str, Any]]:
    """LeRobot's feature table of a dataset that `generate` made, with all that LeRobot adds to the schema."""
    table = schema.features(cameras, height, width, view, depth)
    for feature in table.values():
        if feature["dtype"] in IMAGE_TYPES:
            is_depth = bool(feature.get("info"))
            feature["info"] = {"is_depth_map": True, "depth_unit": "mm"} if is_depth else {}
            if view == "frames":
                feature["info"] |= _coding(is_depth, height, width)
    return table | {key: {"dtype": dtype, "shape": (1,), "names": None} for key, dtype in BOOKKEEPING.items()}


def check_tables(root: Path) -> Iterator[Fault]:
    """Every file has a column of the declared type for every feature that is not a video, and no other."""
    features = {key: f for key, f in read_info(root)["features"].items() if f["dtype"] != "video"}
    for path in sorted(root.glob("data/*/*.parquet")):
        place = path.relative_to(root)
        try:
            columns = {field.name: field.type for field in pq.read_schema(path)}
        except (pa.ArrowException, OSError) as error:
            yield Fault(f"{place} is damaged: {error}")
            continue
        if columns.keys() != features.keys():
            yield Fault(
                f"{place} differs from the declared features by {sorted(columns.keys() ^ features.keys())}"
            )
        for key in sorted(columns.keys() & features.keys()):
            looked_at = features[key]["dtype"] not in (
                *IMAGE_TYPES,
                "language",
            )  # those have checks of their own
            if looked_at and _element(columns[key]) != features[key]["dtype"]:
                yield Fault(f"{key} in {place} holds {columns[key]}, not {features[key]['dtype']}")


def check_provenance(root: Path) -> Iterator[Fault]:
    """It tells view, versions, one key per episode, and the cameras and the size of the images."""
    dataset = RecordedDataset(root)
    provenance = dataset.provenance
    if provenance is None:
        yield Fault("the dataset does not say where it comes from: meta/bimanual.json is missing")
        return
    if provenance.schema_version != schema.SCHEMA_VERSION:
        yield Fault(f"it has schema version {provenance.schema_version}, not {schema.SCHEMA_VERSION}")
    if provenance.view != dataset.view:
        yield Fault(f"it claims the view {provenance.view!r}, but holds {dataset.view!r}")
    if provenance.versions.keys() != set(STAMPED_PACKAGES):
        yield Fault(
            f"it gives versions of {', '.join(provenance.versions)}, not {', '.join(STAMPED_PACKAGES)}"
        )
    if sorted(provenance.worlds) != sorted({key.task for key in provenance.episodes}):
        yield Fault(
            f"it gives worlds of {', '.join(provenance.worlds) or 'no task'}, not of the tasks it holds"
        )
    if len(provenance.episodes) != len(dataset):
        yield Fault(f"it lists {len(provenance.episodes)} episodes, but there are {len(dataset)}")
    for key, count in Counter(provenance.episodes).items():
        if count > 1:
            yield Fault(f"{key} is there {count} times")
    settings = provenance.settings
    if tuple(settings.get("cameras", ())) != dataset.cameras:
        yield Fault(
            f"its settings name the cameras {settings.get('cameras')}, but it holds {dataset.cameras}"
        )
    if settings.get("depth") is not dataset.has_depth:
        held = "depth" if dataset.has_depth else "no depth"
        yield Fault(f"its settings say depth={settings.get('depth')}, but it holds {held}")
    for key, feature in dataset.info["features"].items():
        if feature["dtype"] in IMAGE_TYPES:
            size = [settings.get("height"), settings.get("width")]
            if size != feature["shape"][:2]:
                yield Fault(
                    f"its settings ask for images of {size} pixels, but {key} has {feature['shape'][:2]}"
                )
    if dataset.view not in settings.get("views", ()):
        yield Fault(f"its settings ask for the views {settings.get('views')}, but it holds {dataset.view!r}")


def check_card(root: Path) -> Iterator[Fault]:
    """The card is the one that is written from provenance and description; name and further tags are free."""
    provenance = Provenance.of_dataset(root)
    if provenance is None:
        return  # the check of the provenance says so
    text = (root / CARD_FILE).read_text(encoding="utf-8", errors="replace")
    form = re.match(r"---\n(.*?)\n---\n\n# ([^\n]*)\n", text, re.DOTALL)
    front = yaml.safe_load(form[1]) if form else None
    if form is None or not isinstance(front, dict):
        yield Fault(f"{CARD_FILE} is not the card of a dataset")
        return
    wanted = dataset_card(provenance, read_info(root), form[2], [str(tag) for tag in front.get("tags") or ()])
    for number, (found, line) in enumerate(zip(text.splitlines(), wanted.splitlines(), strict=False), 1):
        if found != line:
            yield Fault(f"line {number} of {CARD_FILE} is {found[:80]!r}, not {line[:80]!r}")
            return
    if text != wanted:
        yield Fault(f"{CARD_FILE} has {len(text)} characters, not {len(wanted)}")


METADATA_CHECKS: dict[str, Callable[[Path], Iterator[Fault]]] = {
    "seal": check_seal,
    "files": check_files,
    "description": check_description,
    "schema": check_schema,
    "table columns": check_tables,
    **BOOKKEEPING_CHECKS,
    "statistics of the dataset": check_dataset_statistics,
    "provenance": check_provenance,
    "plan": check_plan,
    "subtasks": check_subtasks,
    "card": check_card,
}


def _coding(is_depth: bool, height: int, width: int) -> dict[str, Any]:
    """What LeRobot notes about the coding of our videos."""
    from lerobot_bimanual.dataset.video import depth_encoder, rgb_encoder

    encoder = depth_encoder() if is_depth else rgb_encoder()
    options = {f"video.{name}": value for name, value in asdict(encoder).items() if name != "vcodec"}
    return options | {
        "video.height": height,
        "video.width": width,
        "video.codec": encoder.vcodec,
        "video.fps": schema.FPS,
        "video.channels": 1 if is_depth else 3,
        "has_audio": False,
        "is_depth_map": is_depth,
    }


def _differences(found: Mapping[str, Any], wanted: Mapping[str, Any]) -> Iterator[tuple[str, Any, Any]]:
    """(aspect, found, wanted) of a feature's description; what is noted of its coding one by one."""
    for aspect in sorted((found.keys() | wanted.keys()) - {"info"}):
        if not _same(found.get(aspect), wanted.get(aspect)):
            yield aspect, found.get(aspect), wanted.get(aspect)
    notes, ours = found.get("info") or {}, wanted.get("info") or {}
    for note in sorted(notes.keys() | ours.keys()):
        if not _same(notes.get(note), ours.get(note)):
            yield note, notes.get(note), ours.get(note)


def _same(found: Any, wanted: Any) -> bool:
    """Equality in JSON, where true is not 1 and a tuple is a list."""
    if isinstance(wanted, tuple):
        wanted = list(wanted)
    return found == wanted and isinstance(found, bool) == isinstance(wanted, bool)


def _element(kind: pa.DataType) -> str:
    """Name of a column's element type, as LeRobot spells it."""
    if pa.types.is_list(kind) or pa.types.is_fixed_size_list(kind):
        kind = kind.value_type
    return {"float": "float32", "double": "float64"}.get(str(kind), str(kind))
