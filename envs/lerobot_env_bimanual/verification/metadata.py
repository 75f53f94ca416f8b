"""Checks of a dataset as a whole: its tables have the schema's columns, and it says where it comes from."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator

import pyarrow as pa
import pyarrow.parquet as pq

from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.provenance import STAMPED_PACKAGES
from lerobot_bimanual.dataset.reader import RecordedDataset, episode_table
from lerobot_env_bimanual.verification.fault import Fault

IMAGE_TYPES = ("video", "image")


def check_schema(dataset: RecordedDataset) -> Iterator[Fault]:
    """The declared features are the schema's for this view, with one size for all cameras."""
    features = dataset.info["features"]
    sizes = {tuple(f["shape"][:2]) for f in features.values() if f["dtype"] in IMAGE_TYPES}
    if len(sizes) != 1:
        yield Fault(f"images have the sizes {sorted(sizes)}, but must have one")
        return
    height, width = sizes.pop()
    expected = schema.features(dataset.cameras, height, width, dataset.view)
    for key in sorted(expected.keys() - features.keys()):
        yield Fault(f"{key} is missing")
    for key in sorted(features.keys() - expected.keys() - _bookkeeping()):
        yield Fault(f"{key} is not in the schema")
    for key in sorted(expected.keys() & features.keys()):
        for aspect in ("dtype", "shape"):
            found, wanted = features[key][aspect], expected[key][aspect]
            if found != (list(wanted) if isinstance(wanted, tuple) else wanted):
                yield Fault(f"{aspect} of {key} is {found}, not {wanted}")


def check_tables(dataset: RecordedDataset) -> Iterator[Fault]:
    """Every file has a column of the declared type for every feature that is not a video, and no other."""
    features = {key: f for key, f in dataset.info["features"].items() if f["dtype"] != "video"}
    for path in sorted(dataset.root.glob("data/*/*.parquet")):
        place = path.relative_to(dataset.root)
        columns = {field.name: field.type for field in pq.read_schema(path)}
        if columns.keys() != features.keys():
            yield Fault(
                f"{place} differs from the declared features by {sorted(columns.keys() ^ features.keys())}"
            )
        for key in sorted(columns.keys() & features.keys()):
            if features[key]["dtype"] not in IMAGE_TYPES and _element(columns[key]) != features[key]["dtype"]:
                yield Fault(f"{key} in {place} holds {columns[key]}, not {features[key]['dtype']}")


def check_totals(dataset: RecordedDataset) -> Iterator[Fault]:
    """The table of episodes has as many episodes and rows as the dataset claims."""
    info = dataset.info
    rows = sum(episode_table(dataset.root, ["episode_index", "length"])["length"].to_pylist())
    for name, found in (("total_episodes", len(dataset)), ("total_frames", rows)):
        if info[name] != found:
            yield Fault(f"{name} is {info[name]}, but the table of episodes has {found}")


def check_provenance(dataset: RecordedDataset) -> Iterator[Fault]:
    """It tells view, versions and one key per episode, and no episode is there twice."""
    provenance = dataset.provenance
    if provenance is None:
        yield Fault("the dataset does not say where it comes from: meta/bimanual.json is missing")
        return
    if provenance.schema_version != schema.SCHEMA_VERSION:
        yield Fault(f"it has schema version {provenance.schema_version}, not {schema.SCHEMA_VERSION}")
    if provenance.view != dataset.view:
        yield Fault(f"it claims the view {provenance.view!r}, but holds {dataset.view!r}")
    if missing := [package for package in STAMPED_PACKAGES if package not in provenance.versions]:
        yield Fault(f"the versions of {', '.join(missing)} are missing")
    if len(provenance.episodes) != len(dataset):
        yield Fault(f"it lists {len(provenance.episodes)} episodes, but there are {len(dataset)}")
    for key, count in Counter(provenance.episodes).items():
        if count > 1:
            yield Fault(f"{key} is there {count} times")


METADATA_CHECKS: dict[str, Callable[[RecordedDataset], Iterator[Fault]]] = {
    "schema": check_schema,
    "table columns": check_tables,
    "totals": check_totals,
    "provenance": check_provenance,
}


def _bookkeeping() -> set[str]:
    """Columns that LeRobot adds to every dataset."""
    from lerobot.utils.constants import DEFAULT_FEATURES

    return set(DEFAULT_FEATURES)


def _element(kind: pa.DataType) -> str:
    """Name of a column's element type, as LeRobot spells it."""
    if pa.types.is_list(kind) or pa.types.is_fixed_size_list(kind):
        kind = kind.value_type
    return {"float": "float32", "double": "float64"}.get(str(kind), str(kind))
