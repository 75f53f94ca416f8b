"""Normal noise for images, cut from one long table: drawing it anew would cost as much as the image itself."""

import functools
import math

import numpy as np
from numpy.typing import DTypeLike, NDArray

PLACES = 2**16
"""Where a cut may begin."""


def normal(shape: tuple[int, ...], sigma: float, rng: np.random.Generator, dtype: DTypeLike) -> NDArray:
    """Normally distributed numbers.

    Args:
        shape: of the result, which must not be written to.
        sigma: their standard deviation.
        rng: draws where in the table they stand.
        dtype: floats, or integers to which they are rounded.
    """
    count, start = math.prod(shape), int(rng.integers(PLACES))
    return _table(count, sigma, np.dtype(dtype))[start : start + count].reshape(shape)


@functools.lru_cache(maxsize=16)
def _table(count: int, sigma: float, dtype: np.dtype) -> NDArray:
    """The same numbers in every process."""
    numbers = np.random.default_rng(0).standard_normal(PLACES + count, dtype=np.float32) * np.float32(sigma)
    return np.rint(numbers).astype(dtype) if np.issubdtype(dtype, np.integer) else numbers.astype(dtype)
