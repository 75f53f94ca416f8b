"""Reads exported datasets back, without decoding an image and without importing LeRobot or torch.

Files may come from a stranger or be damaged: whatever is not as it should be is a `DatasetError` or a
`SchemaMismatch` that says what and where.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.provenance import Provenance
from lerobot_bimanual.dataset.schema import SCHEMA_VERSION, VIEWS, View
from lerobot_bimanual.episode import EpisodeMeta
from lerobot_bimanual.errors import BimanualError, DatasetError, SchemaMismatch
from lerobot_bimanual.files import read_json

INFO_FILE = Path("meta", "info.json")
DATA_PATH = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
VIDEO_PATH = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
"""Where LeRobot's tools store tables and videos; other places, which could lie anywhere, are not read."""

MAX_TABLE_BYTES = 2**31
"""Of one Parquet file before compression; LeRobot begins another one at 100 MB."""

IMAGE_TYPES = ("video", "image")
MAX_HINTS = 3
"""Datasets that an error message names."""

TIMESTAMP, FRAME_INDEX, EPISODE_INDEX, INDEX, TASK_INDEX = (
    "timestamp",
    "frame_index",
    "episode_index",
    "index",
    "task_index",
)
BOOKKEEPING: dict[str, str] = {
    TIMESTAMP: "float32",
    FRAME_INDEX: "int64",
    EPISODE_INDEX: "int64",
    INDEX: "int64",
    TASK_INDEX: "int64",
}
"""Columns that LeRobot adds to every dataset, and by which it finds a row's images and sentence."""

COLUMN_TYPES: dict[str, pa.DataType] = {
    **{
        key: pa.float32() if len(names) == 1 else pa.list_(pa.float32())
        for key, names in schema.VECTORS.items()
    },
    **{key: pa.type_for_alias(dtype) for key, dtype in (schema.SCALARS | BOOKKEEPING).items()},
}
"""Arrow type of every column that is not an image; LeRobot stores a vector of one number as a scalar."""


@dataclass(frozen=True)
class RecordedEpisode:
    """Everything but the images of one stored episode.

    Attributes:
        index: episode index in its dataset.
        meta: what the episode is.
        columns: schema key -> (rows, n) float32 of a vector, or (rows,) of a scalar.
        bookkeeping: LeRobot's own column -> (rows,).
    """

    index: int
    meta: EpisodeMeta
    columns: dict[str, NDArray]
    bookkeeping: dict[str, NDArray]

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.columns[schema.TICK])


class RecordedDataset:
    """A dataset that this package wrote, one view of it.

    Copies that LeRobot's tools made (merged, split, without some images, with further columns) are read too, as
    long as all vectors and scalars of the schema are there.

    Attributes:
        root: folder with `meta/info.json`.
        info: content of that file.
        view: which rows are stored.
        cameras: cameras with an RGB image, in stored order.
        has_depth: whether there are depth images.
        provenance: where the dataset comes from, if it still says so.

    Raises:
        DatasetError: there is no dataset at `root`, or its table of episodes is damaged.
        SchemaMismatch: the dataset is not ours, or of another schema version; the message lists what differs.
    """

    def __init__(self, root: str | Path):
        self.root = Path(root)
        self.info = read_info(self.root)
        check_features(self.info["features"], self.root)
        images = {k: f for k, f in self.info["features"].items() if f["dtype"] in IMAGE_TYPES}
        self.view: View = "frames" if any(f["dtype"] == "video" for f in images.values()) else "keyframes"
        self.cameras = tuple(
            key.removeprefix(schema.IMAGE_PREFIX) for key, f in images.items() if not is_depth(f)
        )
        self.has_depth = any(map(is_depth, images.values()))
        self.provenance = Provenance.of_dataset(self.root)
        columns = [EPISODE_INDEX, "length", "tasks", "data/chunk_index", "data/file_index"]
        self._index = episode_table(self.root, columns)

    def __len__(self) -> int:
        """Number of episodes."""
        return self._index.num_rows

    def episode(self, index: int) -> RecordedEpisode:
        """Read one episode.

        Raises:
            DatasetError: there is no such episode, or its entry or its file is damaged.
        """
        if not 0 <= index < len(self):
            raise DatasetError(f"{self.root} has episodes 0 to {len(self) - 1}, but not {index}")
        entry = self._index.slice(index, 1).to_pylist()[0]
        tasks = entry["tasks"]
        if not (isinstance(tasks, list) and len(tasks) == 1 and isinstance(tasks[0], str)):
            raise DatasetError(
                f"the table of episodes gives episode {index} the tasks {tasks}, not one sentence"
            )
        path = data_file(self.root, self.info, entry)
        table = read_table(path, columns=[*COLUMN_TYPES], filters=[(EPISODE_INDEX, "=", index)])
        if table.num_rows != entry["length"] or not table.num_rows:
            raise DatasetError(
                f"episode {index} of {self.root} has {table.num_rows} rows in {path.name}, but its metadata says "
                f"{entry['length']}: the dataset is incomplete, generate it again"
            )
        arrays = {key: _to_numpy(table, key, path) for key in COLUMN_TYPES}
        bookkeeping = {key: arrays.pop(key) for key in BOOKKEEPING}
        meta = EpisodeMeta(
            task=str(arrays[schema.TASK_NAME][0]),
            variation=int(arrays[schema.VARIATION][0]),
            split=str(arrays[schema.SPLIT][0]),
            seed=int(arrays[schema.SEED][0]),
            instruction=tasks[0],
        )
        return RecordedEpisode(index, meta, arrays, bookkeeping)

    def episodes(self, indices: Iterable[int] | None = None) -> Iterator[RecordedEpisode]:
        """Read some episodes, or all of them, one after the other."""
        yield from map(self.episode, range(len(self)) if indices is None else indices)


def read_info(root: Path) -> dict[str, Any]:
    """LeRobot's description of a dataset, `meta/info.json`, whose features have a type and a shape each.

    Raises:
        DatasetError: it is missing or damaged.
    """
    path = root / INFO_FILE
    try:
        info = read_json(path)
    except BimanualError as error:
        raise DatasetError(f"no LeRobot dataset at {root}: cannot read {path} ({error})") from error
    features = info.get("features") if isinstance(info, dict) else None
    if not isinstance(features, dict):
        raise DatasetError(
            f"{path} does not describe the features of a dataset: restore it, or generate it again"
        )
    if wrong := [key for key, feature in features.items() if not _is_feature(feature)]:
        raise DatasetError(
            f"{path} does not give type, shape and info of {', '.join(wrong)}: restore it, or generate it again"
        )
    return info


def is_depth(feature: dict[str, Any]) -> bool:
    """Whether an image feature is depth."""
    return bool((feature.get("info") or {}).get("is_depth_map"))


def data_file(root: Path, info: dict[str, Any], entry: dict[str, Any]) -> Path:
    """The file of an episode's rows.

    Args:
        root: folder of the dataset.
        info: content of `meta/info.json`.
        entry: the episode's row in the table of episodes.

    Raises:
        DatasetError: the dataset names another place than LeRobot does, or no file.
    """
    return _stored_file(root, info, "data_path", DATA_PATH, entry, "data")


def video_file(root: Path, info: dict[str, Any], entry: dict[str, Any], key: str) -> Path:
    """The file of an episode's video, as `data_file` for key `key`."""
    return _stored_file(root, info, "video_path", VIDEO_PATH, entry, f"videos/{key}", video_key=key)


def frames_per_second(info: dict[str, Any]) -> int:
    """Rows per second.

    Raises:
        DatasetError: there is no such number.
    """
    fps = info.get("fps")
    if type(fps) is not int or not 0 < fps <= 1000:
        raise DatasetError(
            f"{INFO_FILE} gives the fps {fps!r}, but must give a whole number, here {schema.FPS}"
        )
    return fps


def views_below(root: Path) -> list[Path]:
    """Folders of the views that lie side by side below `root`."""
    return [root / view for view in VIEWS if (root / view / INFO_FILE).is_file()]


def find_view(root: str | Path, preferred: Sequence[View] = VIEWS) -> Path:
    """Folder of a dataset below `root`: `root` itself, or the first of `root/<view>` that exists.

    Raises:
        DatasetError: there is none.
    """
    for candidate in (Path(root), *(Path(root, view) for view in preferred)):
        if (candidate / INFO_FILE).is_file():
            return candidate
    below = datasets_below(Path(root))
    hint = f". Did you mean --root={' or --root='.join(map(str, below[:MAX_HINTS]))}?" if below else ""
    raise DatasetError(f"no dataset at {root}: {Path(root) / INFO_FILE} does not exist{hint}")


def datasets_below(root: Path) -> list[Path]:
    """Folders of datasets one or two levels below a folder."""
    return [path.parents[1] for depth in ("*", "*/*") for path in sorted(root.glob(f"{depth}/{INFO_FILE}"))]


def check_features(features: dict[str, dict[str, Any]], origin: object) -> None:
    """Compare the feature table of a dataset with the schema.

    Raises:
        SchemaMismatch: a vector or scalar is missing or different, or the version is another one.
    """
    expected = schema.features((), 0, 0, "frames")
    differences = []
    for key, wanted in expected.items():
        found = features.get(key)
        if found is None:
            differences.append(f"{key} is missing")
            continue
        for aspect in ("dtype", "shape", "names"):
            ours, theirs = _plain(wanted[aspect]), _plain(found.get(aspect))
            if ours != theirs:
                differences.append(f"{aspect} of {key} is {theirs}, not {ours}")
    found_version = ((features.get(schema.TASK_NAME) or {}).get("info") or {}).get(schema.VERSION_INFO)
    if found_version not in (None, SCHEMA_VERSION):
        differences.insert(0, f"its schema version is {found_version}, not {SCHEMA_VERSION}")
    if differences:
        raise SchemaMismatch(
            f"{origin} is not a dataset that this version of lerobot_bimanual reads: {'; '.join(differences)}. "
            "Generate it again, or install the version that wrote it."
        )


def episode_table(root: Path, columns: list[str] | None = None) -> pa.Table:
    """Some columns of LeRobot's table of episodes, or all, one row per episode in order.

    Raises:
        DatasetError: there is none, a file of it is damaged, or its episodes are not numbered from 0.
    """
    files = sorted(root.glob("meta/episodes/*/*.parquet"))
    if not files:
        raise DatasetError(f"{root} has no episodes: meta/episodes is empty or was never finished")
    try:
        table = pa.concat_tables([read_table(file, columns=columns) for file in files])
        table = table.sort_by(EPISODE_INDEX)
        numbers = table[EPISODE_INDEX].to_pylist()
    except (pa.ArrowException, KeyError) as error:
        raise DatasetError(f"the table of episodes, meta/episodes of {root}, is damaged: {error}") from error
    if not numbers or numbers != list(range(len(numbers))):
        raise DatasetError(f"the table of episodes of {root} does not number them from 0 without a gap")
    return table


def read_table(path: Path, **options: Any) -> pa.Table:
    """A Parquet file.

    Raises:
        DatasetError: it is missing, damaged or too large, or lacks a column that is asked for.
    """
    try:
        stored = pq.read_metadata(path)
        size = sum(stored.row_group(group).total_byte_size for group in range(stored.num_row_groups))
        if size > MAX_TABLE_BYTES:
            raise DatasetError(f"{path} holds {size} bytes of rows, more than {MAX_TABLE_BYTES >> 30} GB")
        table = pq.read_table(path, **options)
    except (pa.ArrowException, OSError, ValueError, KeyError) as error:
        raise DatasetError(
            f"{path} is missing or damaged: restore it, or generate the dataset again ({error})"
        ) from error
    if missing := [name for name in options.get("columns") or () if name not in table.column_names]:
        raise DatasetError(f"{path} lacks the columns {', '.join(missing)}")
    return table


def _stored_file(
    root: Path,
    info: dict[str, Any],
    option: str,
    place: str,
    entry: dict[str, Any],
    prefix: str,
    **names: str,
) -> Path:
    if info.get(option) != place:
        raise DatasetError(
            f"{INFO_FILE} gives the {option} {info.get(option)!r}, but LeRobot's tools write {place!r}"
        )
    numbers = {part: entry.get(f"{prefix}/{part}") for part in ("chunk_index", "file_index")}
    if not all(type(number) is int and number >= 0 for number in numbers.values()):
        raise DatasetError(f"the table of episodes gives no file of {prefix}, but {numbers}")
    return root / place.format(**numbers, **names)


def _is_feature(feature: object) -> bool:
    if not (isinstance(feature, dict) and isinstance(feature.get("dtype"), str)):
        return False
    shape = feature.get("shape")
    if not (isinstance(shape, list) and all(type(size) is int and size > 0 for size in shape)):
        return False
    if feature["dtype"] in IMAGE_TYPES and len(shape) != 3:
        return False
    return isinstance(feature.get("info"), dict | None)


def _plain(value: object) -> object:
    return list(value) if isinstance(value, tuple) else value


def _to_numpy(table: pa.Table, key: str, path: Path) -> NDArray:
    """A column as (rows,) or (rows, n)."""
    kind = COLUMN_TYPES[key]
    try:
        column = table[key].combine_chunks().cast(kind)
    except pa.ArrowException as error:
        raise DatasetError(f"{key} in {path} holds {table[key].type}, not {kind}: {error}") from error
    if column.null_count:
        raise DatasetError(f"{key} in {path} has empty cells")
    if not pa.types.is_list(kind):
        return np.asarray(column.to_numpy(zero_copy_only=False))
    size, numbers = len(schema.VECTORS[key]), column.flatten()
    if (np.diff(column.offsets) != size).any():
        raise DatasetError(f"{key} in {path} has a row whose length is not {size}")
    if numbers.null_count:
        raise DatasetError(f"{key} in {path} has empty cells")
    return np.asarray(numbers.to_numpy(zero_copy_only=False)).reshape(-1, size)
