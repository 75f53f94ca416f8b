"""Damages of a dataset, each by name, with the check that finds it: those of an audit, and further ones.

A damage changes a copy of the small dataset of `conftest.py`, whose files it seals anew, so that no seal tells. Episode
1 is damaged where one episode is; it stands in the first file of rows, after episode 0.
"""

import io
import json
import shutil
import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from PIL import Image

from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.provenance import PROVENANCE_FILE
from lerobot_bimanual.dataset.schema import VIEWS, View

FIRST, SECOND = "data/chunk-000/file-000.parquet", "data/chunk-000/file-001.parquet"
ENTRIES, TASKS = "meta/episodes/chunk-000/file-000.parquet", "meta/tasks.parquet"
FRONT, FRONT_DEPTH, WRIST = (
    schema.image_key("front"),
    schema.depth_key("front"),
    schema.image_key("left_wrist"),
)
BOTH, FRAMES, KEYFRAMES = VIEWS, ("frames",), ("keyframes",)
REPLAYED = ("replay", "replayed keyposes", "replayed actions", "replayed observations")
SIMULATED = (*REPLAYED, "rendered RGB", "rendered depth")
"""Checks for which an episode is played."""

type Change = Callable[[Path], object]


@dataclass(frozen=True)
class Damage:
    """One way to damage a dataset.

    Attributes:
        name: what is done.
        check: that finds it.
        change: does it to the folder of a view.
        views: to which it can be done.
    """

    name: str
    check: str
    change: Change
    views: tuple[View, ...] = BOTH


def edit(root: Path, file: str, key: str, change: Callable[[list, np.ndarray], object]) -> None:
    """Change a column of a table in place; `change` gets its values and the rows of episode 1."""
    table = pq.read_table(root / file)
    values = table[key].to_pylist()
    change(values, np.flatnonzero(np.array(table["episode_index"]) == 1))
    put(root, file, table, key, pa.array(values, table.schema.field(key).type))


def put(root: Path, file: str, table: pa.Table, key: str, values: pa.Array) -> None:
    """Write a table with another column."""
    place = table.column_names.index(key)
    pq.write_table(
        table.set_column(place, table.schema.field(key).with_type(values.type), values), root / file
    )


def column(key: str, change: Callable[[list, np.ndarray], object], file: str = FIRST) -> Change:
    return lambda root: edit(root, file, key, change)


def each(value: Callable[[Any], Any]) -> Callable[[list, np.ndarray], object]:
    """Changes every row of episode 1."""

    def change(values: list, rows: np.ndarray) -> None:
        for row in rows:
            values[row] = value(values[row])

    return change


def at(place: int, value: Callable[[Any], Any]) -> Callable[[list, np.ndarray], object]:
    """Changes one row of episode 1."""

    def change(values: list, rows: np.ndarray) -> None:
        values[rows[place]] = value(values[rows[place]])

    return change


def element(index: int, value: Callable[[float], float]) -> Callable[[list], list]:
    return lambda vector: [*vector[:index], value(vector[index]), *vector[index + 1 :]]


def entry(key: str, value: Callable[[Any], Any]) -> Change:
    """Changes the entry of episode 1."""
    return column(key, at(0, value), ENTRIES)


def json_file(name: str, change: Callable[[Any], Any]) -> Change:
    """Changes a JSON file in place, or to what `change` returns."""

    def rewrite(root: Path) -> None:
        content = json.loads((root / name).read_text())
        other = change(content)
        (root / name).write_text(json.dumps(content if other is None else other))

    return rewrite


def info(change: Callable[[Any], Any]) -> Change:
    return json_file("meta/info.json", change)


def fields(**values: Any) -> Change:
    return info(lambda content: content.update(values))


def without(*names: str) -> Callable[[dict], None]:
    def remove(content: dict) -> None:
        for name in names[:-1]:
            content = content[name]
        del content[names[-1]]

    return remove


def setting(path: tuple[str, ...], value: Any) -> Callable[[dict], None]:
    def put_value(content: dict) -> None:
        for name in path[:-1]:
            content = content[name]
        content[path[-1]] = value

    return put_value


def provenance(change: Callable[[Any], Any]) -> Change:
    return json_file(str(PROVENANCE_FILE), change)


def stats(change: Callable[[Any], Any]) -> Change:
    return json_file("meta/stats.json", change)


def content(name: str, data: bytes) -> Change:
    def write(root: Path) -> None:
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_bytes(data)

    return write


def gone(name: str) -> Change:
    return lambda root: (root / name).unlink()


def truncated(name: str) -> Change:
    return lambda root: (root / name).write_bytes((root / name).read_bytes()[:-100])


def copied(source: str, target: str) -> Change:
    return lambda root: shutil.copyfile(root / source, root / target)


def rows(change: Callable[[pa.Table], pa.Table], file: str = FIRST) -> Change:
    return lambda root: pq.write_table(change(pq.read_table(root / file)), root / file)


def everywhere(key: str, value: Callable[[Any], Any]) -> Change:
    """Changes all rows of the first file."""
    return column(key, lambda values, _: values.__setitem__(slice(None), [value(v) for v in values]))


def pixels(key: str, change: Callable[[np.ndarray], np.ndarray]) -> Change:
    """Changes every image of episode 1."""

    def other(cell: dict) -> dict:
        image = Image.open(io.BytesIO(cell["bytes"]))
        stored = io.BytesIO()
        Image.fromarray(change(np.array(image))).save(stored, format=image.format)
        return cell | {"bytes": stored.getvalue()}

    return column(key, each(other))


def swapped(key: str, other: str) -> Change:
    """Exchanges the images of two cameras, in the table or as videos."""

    def swap(root: Path) -> None:
        if (root / "videos").exists():
            for file in sorted((root / "videos" / key).rglob("*.mp4")):
                twin = Path(str(file).replace(key, other))
                one, two = file.read_bytes(), twin.read_bytes()
                file.write_bytes(two)
                twin.write_bytes(one)
            return
        table = pq.read_table(root / FIRST)
        one, two = table[key].combine_chunks(), table[other].combine_chunks()
        put(root, FIRST, table, key, two)
        put(root, FIRST, pq.read_table(root / FIRST), other, one)

    return swap


def png_of(width: int, height: int) -> Callable[[Any], Any]:
    """Put a PNG into a cell that claims a size and has no pixels."""
    return lambda cell: cell | {"bytes": png(width, height)}


def png(width: int, height: int, body: bytes = b"") -> bytes:
    """A PNG whose header claims a size."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", header)
        + chunk(b"IDAT", zlib.compress(body))
        + chunk(b"IEND", b"")
    )


def foreign_rows(table: pa.Table) -> pa.Table:
    some = table.slice(0, 3)
    place = some.column_names.index("episode_index")
    return pa.concat_tables(
        [table, some.set_column(place, some.schema.field(place), pa.array([77] * 3, pa.int64()))]
    )


def exchanged_episodes(table: pa.Table) -> pa.Table:
    first = np.array(table["episode_index"]) == 0
    return pa.concat_tables([table.filter(pa.array(~first)), table.filter(pa.array(first))])


def with_nulls(key: str) -> Change:
    return column(key, at(2, lambda _: None))


def negated(vector: list) -> list:
    return [*vector[:3], *(-q for q in vector[3:7]), *vector[7:]]


def one_of_list(table: pa.Table, key: str = schema.STATE) -> pa.Table:
    """Takes a number from one row and gives it to the next: as many numbers as before."""
    values = table[key].to_pylist()
    values[-2], values[-1] = values[-2][:-1], [*values[-1], 0.0]
    place = table.column_names.index(key)
    return table.set_column(place, key, pa.array(values, pa.list_(pa.float32())))
