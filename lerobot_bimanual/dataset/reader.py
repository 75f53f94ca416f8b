"""Reads exported datasets back, without decoding an image and without importing LeRobot or torch."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.provenance import Provenance
from lerobot_bimanual.dataset.schema import SCHEMA_VERSION, VIEWS, View
from lerobot_bimanual.episode import EpisodeMeta
from lerobot_bimanual.errors import BimanualError, DatasetError, SchemaMismatch
from lerobot_bimanual.json_file import read_json

INFO_FILE = Path("meta", "info.json")


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
        provenance: where the dataset comes from, if it still says so.

    Raises:
        DatasetError: there is no dataset at `root`, or its table of episodes is damaged.
        SchemaMismatch: the dataset is not ours, or of another schema version; the message lists what differs.
    """

    def __init__(self, root: str | Path):
        self.root = Path(root)
        self.info = read_info(self.root)
        check_features(self.info["features"], self.root)
        images = {k: f for k, f in self.info["features"].items() if f["dtype"] in ("video", "image")}
        self.view: View = "frames" if any(f["dtype"] == "video" for f in images.values()) else "keyframes"
        rgb_keys = [key for key in images if not (images[key].get("info") or {}).get("is_depth_map")]
        self.cameras = tuple(key.removeprefix(schema.IMAGE_PREFIX) for key in rgb_keys)
        self.provenance = Provenance.read(self.root)
        columns = ["episode_index", "length", "tasks", "data/chunk_index", "data/file_index"]
        self._index = episode_table(self.root, columns)

    def __len__(self) -> int:
        """Number of episodes."""
        return self._index.num_rows

    def episode(self, index: int) -> RecordedEpisode:
        """Read one episode.

        Raises:
            DatasetError: there is no such episode, or its file is damaged.
        """
        if not 0 <= index < len(self):
            raise DatasetError(f"{self.root} has episodes 0 to {len(self) - 1}, but not {index}")
        entry = self._index.slice(index, 1).to_pylist()[0]
        path = self.info["data_path"].format(
            chunk_index=entry["data/chunk_index"], file_index=entry["data/file_index"]
        )
        table = read_table(
            self.root / path,
            columns=[*schema.VECTORS, *schema.SCALARS],
            filters=[("episode_index", "=", index)],
        )
        if table.num_rows != entry["length"]:
            raise DatasetError(
                f"episode {index} of {self.root} has {table.num_rows} rows, but its metadata says "
                f"{entry['length']}: the dataset is incomplete, generate it again"
            )
        columns = {key: _to_numpy(table[key]) for key in table.column_names}
        meta = EpisodeMeta(
            task=str(columns[schema.TASK_NAME][0]),
            variation=int(columns[schema.VARIATION][0]),
            split=str(columns[schema.SPLIT][0]),
            seed=int(columns[schema.SEED][0]),
            instruction=entry["tasks"][0],
        )
        return RecordedEpisode(index, meta, columns)

    def episodes(self, indices: Iterable[int] | None = None) -> Iterator[RecordedEpisode]:
        """Read some episodes, or all of them, one after the other."""
        yield from map(self.episode, range(len(self)) if indices is None else indices)


def read_info(root: Path) -> dict[str, Any]:
    """LeRobot's description of a dataset, `meta/info.json`.

    Raises:
        DatasetError: it is missing or damaged.
    """
    path = root / INFO_FILE
    try:
        info = read_json(path)
    except BimanualError as error:
        raise DatasetError(f"no LeRobot dataset at {root}: cannot read {path} ({error})") from error
    if not isinstance(info, dict) or not isinstance(info.get("features"), dict):
        raise DatasetError(
            f"{path} does not describe the features of a dataset: restore it, or generate it again"
        )
    return info


def views_below(root: Path) -> list[Path]:
    """Folders of the views that lie side by side below `root`."""
    return [root / view for view in VIEWS if (root / view / INFO_FILE).is_file()]


def find_view(root: str | Path, preferred: Sequence[View] = VIEWS) -> Path:
    """Folder of a dataset below `root`: `root` itself, or the first of `root/<view>` that exists.

    Raises:
        DatasetError: there is none.
    """
    candidates = [Path(root), *(Path(root, view) for view in preferred)]
    for candidate in candidates:
        if (candidate / INFO_FILE).is_file():
            return candidate
    raise DatasetError(
        f"no dataset at {root}: none of {', '.join(str(candidate / INFO_FILE) for candidate in candidates)} exists"
    )


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


def episode_table(root: Path, columns: list[str]) -> pa.Table:
    """Some columns of LeRobot's table of episodes, one row per episode in order.

    Raises:
        DatasetError: there is none, or a file of it is damaged.
    """
    files = sorted(root.glob("meta/episodes/*/*.parquet"))
    if not files:
        raise DatasetError(f"{root} has no episodes: meta/episodes is empty or was never finished")
    table = pa.concat_tables([read_table(file, columns=columns) for file in files])
    return table.sort_by("episode_index")


def read_table(path: Path, **options: Any) -> pa.Table:
    """A Parquet file.

    Raises:
        DatasetError: it is missing or damaged.
    """
    try:
        return pq.read_table(path, **options)
    except (pa.ArrowException, OSError) as error:
        raise DatasetError(
            f"{path} is missing or damaged: restore it, or generate the dataset again ({error})"
        ) from error


def _plain(value: object) -> object:
    return list(value) if isinstance(value, tuple) else value


def _to_numpy(column: pa.ChunkedArray) -> NDArray:
    if pa.types.is_list(column.type) or pa.types.is_fixed_size_list(column.type):
        values = pa.concat_arrays([chunk.flatten() for chunk in column.chunks])
        return values.to_numpy().reshape(len(column), -1)
    return column.to_numpy()
