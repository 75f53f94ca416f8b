"""Patterns that table, floor and walls may have, painted by arithmetic; each repeats without a seam."""

import functools
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from lerobot_env_bimanual.world.textures import noise, to_image

type Pattern = Callable[[NDArray, NDArray], NDArray]
"""How dark (0..1) a place is; rows and columns go from 0 to 1."""


def _clouds(rows: NDArray, columns: NDArray) -> NDArray:
    coarse, fine = (noise(cells, (len(rows), len(rows)), (cells, cells)) for cells in (4, 16))
    return np.clip(1.4 * (0.7 * coarse + 0.3 * fine) - 0.2, 0, 1)


PATTERNS: Mapping[str, Pattern] = {
    "checks": lambda rows, columns: (np.floor(4 * rows) + np.floor(4 * columns)) % 2,
    "stripes": lambda rows, columns: np.sin(8 * np.pi * (rows + columns)) > 0,
    "dots": lambda rows, columns: np.hypot((4 * rows) % 1 - 0.5, (4 * columns) % 1 - 0.5) < 0.3,
    "clouds": _clouds,
}


@functools.cache  # of every task
def paint(pattern: str, side: int, contrast: float) -> NDArray[np.uint8]:
    """A grey image (side, side, 3) of a pattern, to be coloured by the geom that wears it.

    Args:
        pattern: one of `PATTERNS`.
        side: pixels.
        contrast: by how much its darkest places are darker than white.
    """
    rows, columns = np.mgrid[0:side, 0:side] / side
    light = 1 - contrast * PATTERNS[pattern](rows, columns).astype(float)
    return to_image(np.repeat(light[..., None], 3, axis=-1))
