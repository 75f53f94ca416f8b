"""Where on the table a small thing would be in somebody's way."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.geometry.workspace import TABLE_HEIGHT_M
from lerobot_bimanual.keypose import BimanualKeypose
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.perturbations.axes._free_bodies import DISTRACTOR
from lerobot_env_bimanual.perturbations.axes._joints import joints_of_things
from lerobot_env_bimanual.world.scene import Scene

type Points = NDArray[np.float64]

APART_M = 0.04
"""From everything that stands there, and from the way of all that is hinged."""
CLEAR_OF_HANDS_M = 0.10
"""From the way of the hands' middle planes near the table; what they push and carry is taken along."""
NEAR_TABLE_M = 0.16
"""Whatever of a hand is higher passes above; the things are 6 cm high at most."""
HAND_M = np.array([(0.0, 0.0, 0.01), (0.0, -0.10, -0.07), (0.0, 0.10, -0.07), (0.0, 0.0, -0.20)])
"""Points of a hand in the frame of its tool centre point: fingertips, both ends of the palm, flange."""
SHARES = np.linspace(0.0, 1.0, 9)
"""Where along a stage hands, and along their travel joints, are looked at."""
AROUND = np.stack([f(np.arange(32) * np.pi / 16) for f in (np.cos, np.sin)])
"""(2, 32) horizontal directions."""


class Obstacles:
    """What stands on the table, doors and drawers on their way, and the ways of hands near the table.

    Args:
        scene: whose things have been placed.
        stages: both ends of each stage of a script.
    """

    def __init__(self, scene: Scene, stages: Sequence[tuple[BimanualKeypose, BimanualKeypose]]):
        self._centres, self._rotations, self._half_m = map(np.concatenate, zip(*_boxes(scene), strict=True))
        low = [points for start, end in stages if len(points := _low_points(start, end))]
        self._reaches = np.array([(points @ AROUND).max(axis=0) for points in low]).reshape(
            -1, AROUND.shape[1]
        )
        self._added: list[tuple[Points, float]] = []

    def add(self, position: Points, radius_m: float) -> None:
        """Put another small thing there."""
        self._added.append((position, radius_m))

    def leave_free(self, position: Points, radius_m: float) -> bool:
        """Whether a small thing would be in nobody's way at a position (3,)."""
        if any(np.linalg.norm(position - other) < radius_m + r + APART_M for other, r in self._added):
            return False
        local = np.einsum("nij,ni->nj", self._rotations, position - self._centres)
        distances_m = np.linalg.norm(np.maximum(np.abs(local) - self._half_m, 0), axis=1)
        if (distances_m < radius_m + APART_M).any():
            return False
        # A point is outside a convex hull if in some direction it is further out than all of the hull.
        beyond_m = (position[:2] @ AROUND - self._reaches).max(axis=1, initial=-np.inf)
        return bool((beyond_m > radius_m + CLEAR_OF_HANDS_M).all())


def _low_points(start: BimanualKeypose, end: BimanualKeypose) -> Points:
    """(n, 2) where the hands come near the table between two keyposes."""
    points = []
    for arm in ARMS:
        a, b = start[arm].pose.apply(HAND_M), end[arm].pose.apply(HAND_M)
        points.append(a + SHARES[:, None, None] * (b - a))
    found = np.concatenate(points).reshape(-1, 3)
    return found[found[:, 2] < TABLE_HEIGHT_M + NEAR_TABLE_M, :2]


def _boxes(scene: Scene) -> Iterator[tuple[Points, Points, Points]]:
    """Boxes around all geoms but those of table, room and distractors, with each hinge and slide on its way.

    Yields:
        Centres (n, 3), rotations (n, 3, 3) and half sizes (n, 3), m.
    """
    model, data = scene.model, mujoco.MjData(scene.model)
    is_ours = np.array([model.body(body).name.startswith(DISTRACTOR) for body in range(model.nbody)])
    geoms = np.flatnonzero((model.geom_bodyid > 0) & ~is_ours[model.geom_bodyid])
    swinging = np.flatnonzero(joints_of_things(scene) & (model.jnt_limited > 0))
    for share in SHARES:
        data.qpos[:] = scene.data.qpos
        lower, upper = model.jnt_range[swinging].T
        data.qpos[model.jnt_qposadr[swinging]] = lower + share * (upper - lower)
        mujoco.mj_kinematics(model, data)
        rotations = data.geom_xmat[geoms].reshape(-1, 3, 3)
        centres = data.geom_xpos[geoms] + np.einsum("nij,nj->ni", rotations, model.geom_aabb[geoms, :3])
        yield centres, rotations, model.geom_aabb[geoms, 3:]
