"""Axis-aligned boxes of space: where props may lie, and what the voxel grid covers."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Vector3 = tuple[float, float, float]

TABLE_HEIGHT_M = 0.75
"""Height of the table top above the floor (decoded from RLBench's task files)."""


@dataclass(frozen=True)
class Workspace:
    """A box in world coordinates, metres.

    Attributes:
        lower: smallest x, y, z.
        upper: largest x, y, z.
    """

    lower: Vector3
    upper: Vector3

    @property
    def size(self) -> NDArray[np.float64]:
        """Edge lengths (3,) in metres."""
        return np.subtract(self.upper, self.lower)

    @property
    def center(self) -> NDArray[np.float64]:
        """Midpoint (3,) in metres."""
        return np.add(self.upper, self.lower) / 2

    def contains(self, points: ArrayLike) -> np.bool_ | NDArray[np.bool_]:
        """Whether points (..., 3) lie inside: lower edge included, upper edge not, as voxels are counted."""
        points = np.asarray(points)
        return ((points >= self.lower) & (points < self.upper)).all(axis=-1)

    def sample(self, rng: np.random.Generator) -> NDArray[np.float64]:
        """One uniform point (3,)."""
        return rng.uniform(self.lower, self.upper)


VOXEL_WORKSPACE = Workspace((-0.3, -0.5, 0.6), (0.7, 0.5, 1.6))
"""The cubic metre that the policies voxelise (PerAct2 code, scene bounds)."""
