"""Ways to corrupt a copy of the small dataset of `conftest.py`, each by name, with the check that finds it.

A corruption of a single episode changes episode 1, whose rows follow those of episode 0 in the first file.
The checksums are written again, so that another check has to find the corruption.
"""

import io
import json
import os
import shutil
import struct
import zlib
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import av
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from PIL import ExifTags, Image

from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.provenance import PROVENANCE_FILE
from lerobot_bimanual.dataset.schema import VIEWS, View
from lerobot_bimanual.joint_action import CONTROL_HZ

ROWS, ENTRIES = "data/chunk-000/file-000.parquet", "meta/episodes/chunk-000/file-000.parquet"
TASKS = "meta/tasks.parquet"
FRONT, WRIST = schema.image_key("front"), schema.image_key("left_wrist")
FRONT_DEPTH = schema.depth_key("front")
VIDEO = f"videos/{FRONT}/chunk-000/file-000.mp4"
NEXT_VIDEO, WRIST_VIDEO = VIDEO.replace("file-000", "file-001"), VIDEO.replace(FRONT, WRIST)
FRAMES: tuple[View, ...] = ("frames",)
KEYFRAMES: tuple[View, ...] = ("keyframes",)

type Change = Callable[[Path], object]


class Corruption(NamedTuple):
    """One way to corrupt a dataset: its name, the check that finds it, and what is done to the folder of which views."""

    name: str
    check: str
    change: Change
    views: tuple[View, ...] = VIEWS


def column(key, value: Callable[[Any], Any], rows: Sequence[int] | slice = slice(None), file=ROWS) -> Change:
    """Changes cells of a column in some rows of episode 1."""

    def change(root: Path) -> None:
        table = pq.read_table(root / file)
        values = table[key].to_pylist()
        for row in np.flatnonzero(np.array(table["episode_index"]) == 1)[rows]:
            values[row] = value(values[row])
        field = table.schema.field(key)
        table = table.set_column(table.column_names.index(key), field, pa.array(values, field.type))
        pq.write_table(table, root / file)

    return change


entry = partial(column, file=ENTRIES)
"""Changes a cell of the entry of episode 1 in the table of episodes."""


def plus(amount: float) -> Callable[[list[float]], list[float]]:
    """Adds to the first number of a vector."""
    return lambda vector: [vector[0] + amount, *vector[1:]]


def rewrite(path: Path, change: Callable[[dict], object]) -> None:
    """Change the content of a JSON file in place."""
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))


def json_file(name: str, change: Callable[[dict], object]) -> Change:
    """Changes the content of a JSON file in place."""
    return lambda root: rewrite(root / name, change)


info = partial(json_file, "meta/info.json")
provenance = partial(json_file, str(PROVENANCE_FILE))


def table(change: Callable[[pa.Table], pa.Table]) -> Change:
    """Changes the table of rows as a whole."""
    return lambda root: pq.write_table(change(pq.read_table(root / ROWS)), root / ROWS)


def video_replaced_by(other: str) -> Change:
    """Replaces the first front video by another one of the dataset."""
    return lambda root: shutil.copyfile(root / other, root / VIDEO)


def another_sentence(root: Path) -> None:
    """Another instruction, wherever LeRobot's tools look for it."""
    for path, key, value in ((ENTRIES, "tasks", ["drop it"]), (TASKS, "task", "drop it")):
        told = pq.read_table(root / path)
        field = told.schema.field(key)
        values = pa.array([value] * len(told), field.type)
        pq.write_table(told.set_column(told.column_names.index(key), field, values), root / path)


def pixels(key: str, change: Callable[[np.ndarray], np.ndarray], rows: slice = slice(None)) -> Change:
    """Changes images of the view `keyframes`."""

    def other(cell: dict) -> dict:
        image = Image.open(io.BytesIO(cell["bytes"]))
        stored = io.BytesIO()
        Image.fromarray(change(np.array(image))).save(stored, format=image.format)
        return cell | {"bytes": stored.getvalue()}

    return column(key, other, rows)


def turned(cell: dict) -> dict:
    """The same pixels, which readers turn by 180 degrees because the image's metadata say so."""
    image, stored = Image.open(io.BytesIO(cell["bytes"])), io.BytesIO()
    metadata = image.getexif()
    metadata[ExifTags.Base.Orientation] = 3
    image.save(stored, format=image.format, exif=metadata)
    return cell | {"bytes": stored.getvalue()}


def one_pixel(amount: int) -> Callable[[np.ndarray], np.ndarray]:
    """Adds to one number of an image."""

    def change(image: np.ndarray) -> np.ndarray:
        image.flat[40] = int(image.flat[40]) + amount
        return image

    return change


def encoded_again(change: Callable[[list[np.ndarray]], list[np.ndarray]], streams: int = 1) -> Change:
    """Changes the frames of the front video and encodes them as before, perhaps in several streams."""

    def rewrite(root: Path) -> None:
        container = av.open(str(root / VIDEO))
        frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
        container.close()
        with av.open(str(root / VIDEO), "w") as container:
            for _ in range(streams):
                stream = container.add_stream("libx264", rate=CONTROL_HZ, options={"crf": "18"})
                stream.height, stream.width, stream.pix_fmt = *frames[0].shape[:2], "yuv420p"
            made = container.streams.video
            for image in change(frames):
                frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(image), "rgb24")
                container.mux([packet for each in made for packet in each.encode(frame)])
            container.mux([packet for each in made for packet in each.encode()])

    return rewrite


def repainted(frames: list[np.ndarray]) -> list[np.ndarray]:
    """A thing of 5 x 5 pixels has another colour in every frame."""
    for image in frames:
        image[10:15, 14:19] = image[10:15, 14:19, ::-1] // 2 + np.array([127, 0, 60], np.uint8)
    return frames


def png(width: int, height: int) -> bytes:
    """A PNG whose header claims a size, without pixels."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + header + chunk(b"IDAT", zlib.compress(b"")) + chunk(b"IEND", b"")


CORRUPTIONS = (
    Corruption("a feature is missing", "readable", info(lambda i: i["features"].pop("tick"))),
    Corruption("a wrong timestamp", "readable", column("timestamp", lambda value: value + 0.5, [0])),
    Corruption("a wrong frame index", "readable", column("frame_index", lambda value: value + 1, [0])),
    Corruption("a wrong row index", "readable", column("index", lambda value: value + 3, [0])),
    Corruption("a wrong task index", "readable", column("task_index", lambda value: value + 1)),
    Corruption("a wrong first row", "readable", entry("dataset_from_index", lambda value: value + 1)),
    Corruption("a wrong end of rows", "readable", entry("dataset_to_index", lambda value: value + 1)),
    Corruption("an episode without a length", "readable", entry("length", lambda _: None)),
    Corruption("a row twice", "readable", table(lambda t: pa.concat_tables([t, t.slice(len(t) - 1)]))),
    Corruption("rounded keyposes", "replay", provenance(lambda p: p["settings"].update(discretise=100))),
    Corruption(
        "another seed in the provenance", "replay", provenance(lambda p: p["episodes"][1].update(seed=500))
    ),
    Corruption(
        "another unit of depth",
        "readable",
        info(lambda i: i["features"][FRONT_DEPTH]["info"].update(depth_unit="m")),
        KEYFRAMES,
    ),
    Corruption("a column is missing", "readable", table(lambda t: t.drop_columns([schema.SEED]))),
    Corruption("an empty cell", "readable", column(schema.TICK, lambda _: None, [2])),
    Corruption("another seed in a row", "replay", column(schema.SEED, lambda _: 77, [3])),
    Corruption("another sentence", "replay", another_sentence),
    Corruption("one state hash", "replay", column(schema.STATE_HASH, lambda v: v ^ 1, [2])),
    Corruption("one tick", "replay", column(schema.TICK, lambda v: v + 1, [-1])),
    Corruption("one action by 1e-6", "replay", column(schema.ACTION, plus(1e-6), [2])),
    Corruption("a keyframe too many", "replay", column(schema.KEYFRAME, lambda _: True, [0])),
    Corruption("not a number", "replay", column(schema.STATE, plus(float("nan")), [2])),
    Corruption("video is gone", "images complete", lambda root: (root / VIDEO).unlink(), FRAMES),
    Corruption("video is cut off", "images complete", lambda root: os.truncate(root / VIDEO, 2000), FRAMES),
    Corruption("video of another length", "images complete", video_replaced_by(NEXT_VIDEO), FRAMES),
    Corruption("video of another camera", "rendered RGB", video_replaced_by(WRIST_VIDEO), FRAMES),
    Corruption("video is a tick late", "rendered RGB", encoded_again(lambda f: [f[0], *f[:-1]]), FRAMES),
    Corruption("a repainted thing", "rendered RGB", encoded_again(repainted), FRAMES),
    Corruption("a second stream", "images complete", encoded_again(list, streams=2), FRAMES),
    Corruption(
        "a brighter video",
        "rendered RGB",
        encoded_again(lambda frames: [np.clip(f, 0, 249) + np.uint8(6) for f in frames]),
        FRAMES,
    ),
    Corruption("an image is missing", "images complete", column(FRONT, lambda _: None, [1]), KEYFRAMES),
    Corruption(
        "an image claims gigabytes",
        "images complete",
        column(FRONT, lambda cell: cell | {"bytes": png(60_000, 60_000)}, [1]),
        KEYFRAMES,
    ),
    Corruption("a turned image", "rendered RGB", column(FRONT, turned, slice(3, 4)), KEYFRAMES),
    Corruption("turned depth", "rendered depth", column(FRONT_DEPTH, turned, slice(3, 4)), KEYFRAMES),
    Corruption("one pixel of colour", "rendered RGB", pixels(FRONT, one_pixel(1), slice(3, 4)), KEYFRAMES),
    Corruption("depth beyond its range", "rendered depth", pixels(FRONT_DEPTH, one_pixel(9000)), KEYFRAMES),
    Corruption("a depth pixel", "rendered depth", pixels(FRONT_DEPTH, one_pixel(-1), slice(3, 4)), KEYFRAMES),
)
