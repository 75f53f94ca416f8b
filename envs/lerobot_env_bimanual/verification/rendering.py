"""Compares stored images of some rows with new ones of the same ticks, rendered from the episode as it was played again."""

from collections.abc import Iterable
from itertools import product
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.dataset import feature_table, schema
from lerobot_bimanual.dataset.reader import RecordedEpisode
from lerobot_bimanual.episode import Demonstration
from lerobot_bimanual.keypose_layout import POSITION

RGB, DEPTH = "rendered RGB", "rendered depth"

ALL_ROWS = -1

BLOCK = 8
"""Side in pixels of the blocks in which a frame of a video is compared: a whole frame hides what is small."""

MAX_BLOCK_ERROR, MAX_OFFSET = 350.0, 3.0
"""Largest mean squared error of a block, and largest error of a frame's mean, of decoded to new images, in grey levels.

The new image's colours are halved in resolution first, as H.264 stores them (4:2:0). Measured on sound videos at 32 and 64
pixels, every frame of three tasks and some of four others: up to 296 and 1.9. Compared with the image of the tick before,
half of the frames have a block beyond 1000.
"""


def draw_rows(episode: RecordedEpisode, count: int, seed: int) -> list[int]:
    """Rows whose images are compared, ascending: one in each of `count` parts of the episode, or `ALL_ROWS`.

    Any row may be drawn, and one where the hands move fast is likelier: there neighbouring images differ. The draw depends on
    the seed and the episode's index.
    """
    rows = len(episode)
    if count == ALL_ROWS or count >= rows:
        return list(range(rows))
    hands = episode.columns[schema.EE_POSE].astype(np.float64).reshape(rows, len(ARMS), -1)[..., POSITION]
    moved_m = np.linalg.norm(np.diff(hands, axis=0, prepend=hands[:1]), axis=-1).sum(axis=1)  # (rows,)
    chances = np.nan_to_num(moved_m, posinf=0.0) + np.nan_to_num(moved_m, posinf=0.0).mean() / 4 + 1e-6
    rng = np.random.default_rng([seed, episode.index])
    parts = np.array_split(np.arange(rows), count)
    return [int(rng.choice(part, p=chances[part] / chances[part].sum())) for part in parts]


def new_images(
    episode: RecordedEpisode, played: Demonstration, rows: Iterable[int]
) -> dict[int, dict[str, Any]]:
    """Row -> its images by key, of the episode as it was played again; depth in whole millimetres, as datasets store it."""
    ticks = episode.columns[schema.TICK].tolist()
    return {
        row: {
            key: image if image.dtype == np.uint8 else feature_table.stored_depth(image[0])
            for key, image in played.images(ticks[row]).items()
        }
        for row in rows
        if 0 <= ticks[row] < played.rows
    }


def difference(image: NDArray, new: NDArray, is_video: bool) -> str:
    """How a stored image differs from a new one, as part of a sentence; empty if it does not.

    Depth and images in tables must be equal in every pixel. Colours of videos are lossy, so every block of a frame must only
    be close to the new image's.
    """
    if image.dtype == np.uint16:
        error_mm = int(np.abs(image.astype(np.int32) - new).max())
        return f"is wrong by up to {error_mm} mm" if error_mm else ""
    if is_video:
        text = _unlike(image, new)
        return f"is unlike a new image: {text}" if text else ""
    pixels = int((image != new).any(axis=-1).sum())
    return f"differs from a new image in {pixels} pixels" if pixels else ""


def _unlike(frame: NDArray[np.uint8], new: NDArray[np.uint8]) -> str:
    """What tells a decoded frame of a video from a new image, beyond what coding loses; empty if nothing does."""
    halved = av.VideoFrame.from_ndarray(np.ascontiguousarray(new), format="rgb24").reformat(format="yuv420p")
    error = frame.astype(np.float32) - halved.to_ndarray(format="rgb24")
    if (offset := float(np.abs(error.mean(axis=(0, 1))).max())) > MAX_OFFSET:
        return f"its mean is off by {offset:.1f} grey levels"
    height, width = (side // BLOCK for side in error.shape[:2])
    # Blocks from the first pixel on, and those up to the last one: together they reach every edge and corner.
    rows, columns = ((slice(side // BLOCK * BLOCK), slice(side % BLOCK, None)) for side in error.shape[:2])
    squared = np.square(error).mean(axis=-1)
    blocks = (squared[place].reshape(height, BLOCK, width, BLOCK) for place in product(rows, columns))
    worst = max(float(each.mean(axis=(1, 3)).max(initial=0.0)) for each in blocks)
    text = f"a block of {BLOCK} pixels is off by {worst**0.5:.0f} grey levels"
    return text if worst > MAX_BLOCK_ERROR else ""
