"""Contact sheet of perturbations: a row per axis, with its levels side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.dataset import schema
from lerobot_bimanual.perturbation_levels import MAX_LEVEL
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.episode.observations import env_key
from lerobot_env_bimanual.perturbations.registry import get_axis
from lerobot_env_bimanual.rendering.layout import Panel, contact_sheet

SIDE_PIXELS = 256
MAX_DEPTH_MM = 2500
"""White in pictures of depth."""
HOLE = (190, 40, 120)
"""Colour of pixels without depth."""
SHRINK = 2


@dataclass(frozen=True)
class Row:
    """An axis, as one episode of one task shows it.

    Attributes:
        axis: its name.
        task: registered task name.
        seed: of the episode, of the split `val`.
    """

    axis: str
    task: str
    seed: int


def draw_row(row: Row) -> list[Panel]:
    """All five cameras at the start of the episode, at levels 0 to 3; depth images if colours do not change.

    No panels if no image changes.

    Raises:
        InvalidChoice: the axis finds nothing to change in the task.
    """
    axis = get_axis(row.axis)
    views = [_views(row, level) for level in range(MAX_LEVEL + 1)]
    changed = [kind for kind, first in views[0].items() if not np.array_equal(first, views[-1][kind])]
    if not changed:
        return []
    captions = [
        f"{axis.name}: 0",
        *(f"level {level}: {axis.levels[level - 1]:g}" for level in range(1, len(views))),
    ]
    return [Panel(view[changed[0]], caption) for view, caption in zip(views, captions, strict=True)]


def axes_sheet(row: Row, panels: Sequence[Panel]) -> Image.Image:
    """One sheet of the panels of many rows; all show the same episode as `row`."""
    lines = (
        f"{row.task}, val seed {row.seed}: front camera large, the others beside it",
        "a row per axis, its levels from left to right; depth in grey, pink if it was not measured",
    )
    sheet = contact_sheet("axes and levels", lines, panels, MAX_LEVEL + 1)
    return sheet.reduce(SHRINK)


def _views(row: Row, level: int) -> dict[str, NDArray[np.uint8]]:
    env = BimanualEnv(row.task, split="val", image_size=SIDE_PIXELS, perturb=f"{row.axis}:{level}")
    observation, _ = env.reset(seed=row.seed)
    env.close()
    return {
        "rgb": _side_by_side([observation["pixels"][camera] for camera in CAMERA_NAMES]),
        "depth": _side_by_side([_depth_picture(observation, camera) for camera in CAMERA_NAMES]),
    }


def _depth_picture(observation: dict[str, Any], camera: str) -> NDArray[np.uint8]:
    depth_mm = observation[env_key(schema.depth_key(camera))][0]
    grey = (255 * np.clip(depth_mm / MAX_DEPTH_MM, 0, 1)).astype(np.uint8)
    return np.where(depth_mm[..., None] > schema.UNMEASURED_MM, grey[..., None], np.array(HOLE, np.uint8))


def _side_by_side(images: Sequence[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    """The first image, and beside it the other four at half its size."""
    large, *small = images
    small = [np.asarray(Image.fromarray(image).reduce(2)) for image in small]
    return np.hstack([large, np.vstack([np.hstack(small[:2]), np.hstack(small[2:])])])
