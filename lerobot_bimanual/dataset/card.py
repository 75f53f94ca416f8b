"""Dataset card, `README.md`: what is needed to use a dataset and to make it again."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.decoding import ImageReader
from lerobot_bimanual.dataset.provenance import Provenance
from lerobot_bimanual.dataset.reader import RecordedDataset, read_info
from lerobot_bimanual.errors import DatasetError
from lerobot_bimanual.files import write_file
from lerobot_bimanual.keypose import ARM_KEYPOSE_NAMES
from lerobot_bimanual.pages import render

if TYPE_CHECKING:
    import pandas as pd

CARD_FILE = Path("README.md")
PICTURE_FILE = Path("meta", "first_episode.jpg")
PICTURE_CAMERA = "front"
TILE_HEIGHT, GAP = 160, 4
"""Sizes in the picture, in pixels."""

LICENSE = "apache-2.0"
TAGS = ("LeRobot", "bimanual", "mujoco", "simulation", "rgbd", "depth", "keyframe", "keypose")

MEANINGS = {
    schema.STATE: "measured joints in rad and gripper opening, 0 closed to 1 open",
    schema.EE_POSE: "tool centre points in the world: metres, quaternion wxyz; z is the approach, y the opening",
    schema.GRIPPER_FINGERS: "travel of each finger in metres, 0 closed",
    schema.KEYPOSE_STEP: "keyposes completed so far",
    schema.CAMERA_EXTRINSICS: "world_T_camera of every camera, 4x4 row-major, OpenCV axes (x right, y down, z forward)",
    schema.CAMERA_INTRINSICS: "pinhole matrix of every camera in pixels, 3x3 row-major",
    schema.NEXT_KEYPOSE: "the keypose under way: **the label** of keypose policies",
    schema.ACTION: "joint targets in rad and gripper command of the tick, 0 closed to 1 open",
    schema.KEYFRAME: "first observation after a completed keypose, or last row of the episode",
    schema.TICK: "control tick within the episode",
    schema.STATE_HASH: "first 64 bits of the hash of the simulation's state after the tick",
    schema.TASK_NAME: "recipe of the episode: task ...",
    schema.SPLIT: "... split of the seed ...",
    schema.VARIATION: "... variation ...",
    schema.SEED: "... and seed",
}
"""Each column in words."""


def write_card(root: Path, repo_id: str, tags: Sequence[str] = ()) -> None:
    """Write the card of a dataset from its metadata and provenance, and the picture that it shows.

    Args:
        root: folder of the dataset.
        repo_id: LeRobot's name of the dataset.
        tags: further tags, by which the Hub finds datasets.

    Raises:
        DatasetError: the dataset has no provenance.
        UnwritableOutput: its folder cannot be written.
    """
    provenance = Provenance.of_dataset(root)
    if provenance is None:
        raise DatasetError(f"{root} has no provenance, so there is nothing to write a card from")
    _write_picture(root)
    text = dataset_card(provenance, read_info(root), repo_id, tags)
    write_file(root / CARD_FILE, text)


def dataset_card(provenance: Provenance, info: dict, repo_id: str, tags: Sequence[str] = ()) -> str:
    """Text of the card.

    Args:
        provenance: where the dataset comes from.
        info: content of LeRobot's `meta/info.json`.
        repo_id: LeRobot's name of the dataset.
        tags: further tags.
    """
    import pandas as pd

    fractions = provenance.settings.get("intermediate")
    counts = Counter((key.task, key.variation) for key in provenance.episodes)
    rows = [
        {"task": task, "variation": variation, "episodes": count}
        for (task, variation), count in sorted(counts.items())
    ]
    return render(
        "lerobot_bimanual.dataset",
        "card.md",
        tags=[*dict.fromkeys((*TAGS, *tags))],
        repo_id=repo_id,
        picture=PICTURE_FILE.as_posix(),
        info=info,
        provenance=provenance,
        intermediate=fractions if isinstance(fractions, list | tuple) else (),  # of any file that was found
        episodes=pd.DataFrame(rows),
        columns=_columns(info),
        schema=schema,
        keypose_names=ARM_KEYPOSE_NAMES,
        cameras=CAMERA_NAMES,
        versions=", ".join(f"{package} {version}" for package, version in provenance.versions.items()),
        seeds=[key.seed for key in provenance.episodes],
        license=LICENSE,
    )


def _columns(info: dict) -> pd.DataFrame:
    import pandas as pd

    rows = []
    for key, feature in info["features"].items():
        meaning = MEANINGS.get(key)
        if meaning is None and feature["dtype"] in ("video", "image"):
            is_depth = (feature.get("info") or {}).get("is_depth_map")
            meaning = "depth along the optical axis" if is_depth else "RGB"
        if meaning is not None:  # the others are LeRobot's own bookkeeping
            shape = " x ".join(map(str, feature["shape"]))
            rows.append({"column": f"`{key}`", "type": feature["dtype"], "shape": shape, "meaning": meaning})
    return pd.DataFrame(rows)


def _write_picture(root: Path) -> None:
    """Draw the first episode in one strip, from the start over every keypose to the end.

    It is seen by the front camera, or by the first camera that the dataset stores.

    Raises:
        UnwritableOutput: the picture cannot be written.
    """
    dataset = RecordedDataset(root)
    camera = PICTURE_CAMERA if PICTURE_CAMERA in dataset.cameras else dataset.cameras[0]
    shown = {0, *np.flatnonzero(dataset.episode(0).columns[schema.KEYFRAME]).tolist()}
    images = ImageReader(root).images(0, schema.image_key(camera))
    tiles = [_tile(image) for row, image in enumerate(images) if row in shown]
    lefts = np.cumsum([0, *(tile.width + GAP for tile in tiles)]).tolist()
    strip = Image.new("RGB", (lefts[-1] - GAP, TILE_HEIGHT), "white")
    for tile, left in zip(tiles, lefts, strict=False):  # the last left is where another tile would begin
        strip.paste(tile, (left, 0))
    drawn = BytesIO()
    strip.save(drawn, "JPEG", quality=85)
    write_file(root / PICTURE_FILE, drawn.getvalue())  # through no link, which may lead into the Hub's cache


def _tile(rgb: NDArray[np.uint8]) -> Image.Image:
    height, width, _ = rgb.shape
    return Image.fromarray(rgb).resize((round(width * TILE_HEIGHT / height), TILE_HEIGHT))
