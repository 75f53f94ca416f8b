"""Reads exported datasets back, without decoding an image and without importing LeRobot or torch.

Files may come from a stranger or be damaged: anything wrong raises a `BimanualError` that says what is wrong and where.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray
from pydantic import Field, PositiveInt

from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.calibration import Calibration
from lerobot_bimanual.dataset.layout import check_features, column_types, view_of
from lerobot_bimanual.dataset.provenance import Provenance
from lerobot_bimanual.dataset.schema import VIEWS, View
from lerobot_bimanual.episode import EpisodeMeta
from lerobot_bimanual.errors import BimanualError, DatasetError
from lerobot_bimanual.files import read_json
from lerobot_bimanual.results.record import Record

INFO_FILE = Path("meta", "info.json")

MAX_TABLE_BYTES = 2**31
"""Of one Parquet file before compression, and of its numbers; LeRobot begins another one at 100 MB."""

IMAGE_TYPES = ("video", "image")
EPISODE_INDEX = "episode_index"
TASKS_FILE = Path("meta", "tasks.parquet")
LEROBOT_COLUMNS = {"timestamp": pa.float32()} | dict.fromkeys(
    ("frame_index", "index", "task_index"), pa.int64()
)
"""LeRobot's own columns, by which it finds a row's images, the rows before and after it, and its sentence."""
TIMESTAMP_TOLERANCE_S = 1e-4  # LeRobot's


@dataclass(frozen=True)
class RecordedEpisode:
    """Everything but the images of one stored episode.

    Attributes:
        index: episode index in its dataset.
        meta: what the episode is.
        columns: schema key -> (rows, n) float32 of a vector, or (rows,) of a scalar.
    """

    index: int
    meta: EpisodeMeta
    columns: dict[str, NDArray]

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
        calibration: what holds for all rows; None where rows hold all of it.
        provenance: where the dataset comes from, if it still says so.

    Raises:
        DatasetError: there is no dataset at `root`, its table of episodes is damaged, or it is not ours, or of another
            schema version; the message then lists what differs.
        BadRecord: its provenance is damaged.
    """

    def __init__(self, root: str | Path):
        self.root = Path(root)
        self.info = read_info(self.root)
        features = self.info["features"]
        check_features(features, self.root)
        self.view: View = view_of(features)
        images = {key: each for key, each in features.items() if each["dtype"] in IMAGE_TYPES}
        colours = [key for key, each in images.items() if not is_depth(each)]
        self.cameras = tuple(key.removeprefix(schema.IMAGE_PREFIX) for key in colours)
        self.calibration = Calibration.of_features(features)
        self.provenance = Provenance.of_dataset(self.root)
        bounds = ("dataset_from_index", "dataset_to_index")
        columns = [EPISODE_INDEX, "length", "tasks", "data/chunk_index", "data/file_index", *bounds]
        self._index, self._types = episode_table(self.root, columns), column_types(features)
        self._ends = np.cumsum(_to_numpy(self._index, "length", pa.int64(), self.root / "meta/episodes"))

    def __len__(self) -> int:
        """Number of episodes."""
        return self._index.num_rows

    def episode(self, index: int) -> RecordedEpisode:
        """Read one episode.

        Raises:
            DatasetError: there is no such episode, its entry or its file is damaged, or LeRobot would find other rows, images or
                sentences by them.
        """
        if not 0 <= index < len(self):
            raise DatasetError(f"{self.root} has episodes 0 to {len(self) - 1}, but not {index}")
        entry = self._index.slice(index, 1).to_pylist()[0]
        if not (isinstance(tasks := entry["tasks"], list) and len(tasks) == 1):
            raise DatasetError(f"meta/episodes gives episode {index} the tasks {tasks}, not one sentence")
        path = stored_file(self.root, entry, "data")
        table = read_table(
            path, columns=[*self._types, *LEROBOT_COLUMNS], filters=[(EPISODE_INDEX, "=", index)]
        )
        if table.num_rows != entry["length"] or not table.num_rows:
            raise DatasetError(
                f"episode {index} of {self.root} has {table.num_rows} rows in {path.name}, but its metadata says "
                f"{entry['length']}: the dataset is incomplete, generate it again"
            )
        if wrong := self._inconsistent_fields(index, entry, table, path):
            raise DatasetError(
                f"{', '.join(wrong)} of episode {index} of {self.root} lead LeRobot to other rows, images or sentences: generate "
                "the dataset again"
            )
        arrays = {key: _to_numpy(table, key, kind, path) for key, kind in self._types.items()}
        meta = EpisodeMeta(
            task=str(arrays[schema.TASK_NAME][0]),
            variation=int(arrays[schema.VARIATION][0]),
            split=str(arrays[schema.SPLIT][0]),
            seed=int(arrays[schema.SEED][0]),
            instruction=str(tasks[0]),
        )
        return RecordedEpisode(index, meta, arrays)

    def _inconsistent_fields(
        self, index: int, entry: dict[str, Any], table: pa.Table, path: Path
    ) -> list[str]:
        """Names of the columns and entries by which LeRobot finds an episode's rows in this file and that contradict them."""
        rows, first = np.arange(table.num_rows), self._ends[index] - table.num_rows
        places = [_to_numpy(table, name, kind, path) for name, kind in LEROBOT_COLUMNS.items()]
        timestamp_s, frame_index, position, task_index = places
        timestamp_error_s = np.abs(timestamp_s - rows / self.info["fps"])
        sentence_by_task_index = _sentences(self.root / TASKS_FILE)
        is_right = {
            "timestamp": (timestamp_error_s < TIMESTAMP_TOLERANCE_S).all(),
            "frame_index": np.array_equal(frame_index, rows),
            "index": np.array_equal(position, first + rows),
            "task_index": [sentence_by_task_index.get(number) for number in np.unique(task_index)]
            == entry["tasks"],
            "dataset_from_index": entry["dataset_from_index"] == first,
            "dataset_to_index": entry["dataset_to_index"] == self._ends[index],
        }
        return [name for name, right in is_right.items() if not right]

    def episodes(self) -> Iterator[RecordedEpisode]:
        """Read all episodes, one after the other."""
        yield from map(self.episode, range(len(self)))


class _Feature(Record, extra="ignore"):
    """The fields of a LeRobot feature that are read here."""

    dtype: str
    shape: Annotated[list[PositiveInt], Field(min_length=1)]
    info: dict[str, Any] | None = None


class _Info(Record, extra="ignore"):
    """The fields of LeRobot's `meta/info.json` that are read here."""

    fps: Annotated[int, Field(gt=0, le=1000)]
    features: dict[str, _Feature]
    total_episodes: PositiveInt


def read_info(root: Path) -> dict[str, Any]:
    """LeRobot's description of a dataset, `meta/info.json`; one that is missing or damaged is a DatasetError."""
    path = root / INFO_FILE
    try:
        _Info.read(path)
        return read_json(path)
    except BimanualError as error:
        views = " or ".join(map(str, views_below(root)))
        remedy = f"Give {views}" if views else "Restore the file, or generate the dataset again"
        raise DatasetError(f"no LeRobot dataset at {root}: {error}. {remedy}") from error


def is_depth(feature: dict[str, Any]) -> bool:
    """Whether an image feature is depth."""
    return bool((feature.get("info") or {}).get("is_depth_map"))


def stored_file(root: Path, entry: dict[str, Any], kind: str) -> Path:
    """Where LeRobot's tools store an episode's rows, kind `data`, or its video, kind `videos/KEY`.

    Raises:
        DatasetError: `entry`, the episode's row in the table of episodes, names no such file.
    """
    try:
        chunk, file = (int(entry[f"{kind}/{part}"]) for part in ("chunk_index", "file_index"))
    except (TypeError, ValueError) as error:
        raise DatasetError(f"the table of episodes gives no file of {kind}: {error}") from error
    return root / kind / f"chunk-{chunk:03d}/file-{file:03d}.{'parquet' if kind == 'data' else 'mp4'}"


def views_below(root: Path) -> list[Path]:
    """Folders of the views that lie side by side below `root`."""
    return [root / view for view in VIEWS if (root / view / INFO_FILE).is_file()]


def find_view(root: str | Path, preferred: Sequence[View] = VIEWS) -> Path:
    """Folder of a dataset: `root` itself, or the first of `root/<view>` that exists; otherwise a DatasetError."""
    for candidate in (Path(root), *(Path(root, view) for view in preferred)):
        if (candidate / INFO_FILE).is_file():
            return candidate
    raise missing_dataset_error(root, "--root")


def missing_dataset_error(root: str | Path, flag: str, otherwise: str = "") -> DatasetError:
    """The error for a missing dataset at `root`; it suggests one below `root` for `flag`, or ends with `otherwise`."""
    below = [path for depth in ("*", "*/*") for path in sorted(Path(root).glob(f"{depth}/{INFO_FILE}"))]
    hint = f". Did you mean {flag}={below[0].parents[1]}?" if below else otherwise
    return DatasetError(f"no dataset at {root}: {Path(root) / INFO_FILE} does not exist{hint}")


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
        DatasetError: it is missing, damaged or too large, or lacks a requested column.
    """
    try:
        stored = pq.read_metadata(path)
        groups = map(stored.row_group, range(stored.num_row_groups))
        chunks = [group.column(index) for group in groups for index in range(group.num_columns)]
        # Runs of equal numbers take no bytes in the file, but 8 each when they are read.
        size = sum(max(chunk.total_uncompressed_size, 8 * chunk.num_values) for chunk in chunks)
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


def _sentences(path: Path) -> dict[int, str]:
    """LeRobot's table of sentences by their numbers; one that is damaged is a DatasetError."""
    table = read_table(path, columns=["task_index", "task"])
    return dict(zip(_to_numpy(table, "task_index", pa.int64(), path), table["task"].to_pylist(), strict=True))


def _to_numpy(table: pa.Table, key: str, kind: pa.DataType, path: Path) -> NDArray:
    """A column as (rows,) or (rows, n)."""
    try:
        column = table[key].combine_chunks().cast(kind)
    except pa.ArrowException as error:
        raise DatasetError(f"{key} in {path} holds {table[key].type}, not {kind}: {error}") from error
    is_vector = pa.types.is_fixed_size_list(kind)
    values = column.flatten() if is_vector else column
    if column.null_count or values.null_count:
        raise DatasetError(f"{key} in {path} has empty cells")
    array = np.asarray(values.to_numpy(zero_copy_only=False))
    return array.reshape(len(column), -1) if is_vector else array
