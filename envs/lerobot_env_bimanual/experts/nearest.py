"""The baseline that looks a scene up: the keyposes of the training demonstration whose scene is most alike.

It is told where everything is, and how large, and does nothing but remember. What it solves can be learned by heart.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.errors import PlacementFailure
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.episode.rehearsal import Rehearsal
from lerobot_env_bimanual.experts.runner import home_keypose
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.world.scene_view import SceneView

DEMONSTRATIONS = 100
"""Training demonstrations of each variation that are remembered."""
METRES_PER_RAD = 0.1
"""A thing that is turned by one rad is as far away as one that is shifted by this."""


@dataclass(frozen=True, eq=False)
class Layout:
    """Where the bodies of all props are, and how large.

    Attributes:
        positions_m: (n, 3) world frame.
        quats_wxyz: (n, 4) world frame.
        sizes_m: (n, 3) extents in the body's own frame.
    """

    positions_m: NDArray[np.float64]
    quats_wxyz: NDArray[np.float64]
    sizes_m: NDArray[np.float64]

    @classmethod
    def of(cls, env: BimanualEnv) -> Layout:
        """That of the present scene."""
        model, data = env.scene.model, env.scene.data
        roots = [model.body(prop.name).id for prop in env.scene.props]
        bodies = np.flatnonzero(np.isin(model.body_rootid, roots))
        return cls(
            data.xpos[bodies].copy(),
            data.xquat[bodies].copy(),
            np.array([_size_m(env.scene, body) for body in bodies]),
        )

    def distance_m(self, other: Layout) -> float:
        """How unlike two layouts are: the root of the summed squares of all shifts, turns and differences in size."""
        if len(self.positions_m) != len(other.positions_m):
            return np.inf
        cosines = np.abs((self.quats_wxyz * other.quats_wxyz).sum(axis=1)).clip(max=1.0)
        parts = (
            self.positions_m - other.positions_m,
            self.sizes_m - other.sizes_m,
            2 * METRES_PER_RAD * np.arccos(cosines),
        )
        return float(np.sqrt(sum(np.square(part).sum() for part in parts)))


def nearest_keyposes(env: BimanualEnv) -> NDArray[np.float32]:
    """Keyposes (n, 18) of the nearest of `DEMONSTRATIONS` training demonstrations of the episode's variation."""
    here, bank = Layout.of(env), demonstrations(env.task, env.variation, env.options.setting)
    return min(bank, key=lambda known: here.distance_m(known[0]))[1]


@lru_cache(maxsize=8)
def demonstrations(task: str, variation: int, setting: str) -> list[tuple[Layout, NDArray[np.float32]]]:
    """Layout and keyposes (n, 18) of each training demonstration of a variation, rehearsed without physics."""
    env, bank = BimanualEnv(task, variation=variation, split="train", obs="state", setting=setting), []
    for seed in range(DEMONSTRATIONS):
        try:
            env.reset(seed=seed)
        except PlacementFailure:
            continue
        bank.append((Layout.of(env), rehearsed_keyposes(env)))
    env.close()
    return bank


def rehearsed_keyposes(env: BimanualEnv) -> NDArray[np.float32]:
    """The expert's keyposes (n, 18) in the present scene, as a rehearsal without physics goes through them."""
    stages: list[Stage] = []

    def noted(view: SceneView) -> Iterator[Stage]:
        for stage in env.task_definition.script(view, env.progress.variation):
            stages.append(stage)
            yield stage

    Rehearsal(env.scene).infeasibility(noted)
    keypose, keyposes = home_keypose(env.scene), []
    for stage in stages:
        keypose = stage.keypose(keypose)
        keyposes.append(keypose.to_vector())
    return np.array(keyposes)


def _size_m(view: SceneView, body: int) -> NDArray[np.float64]:
    """Extents (3,) of a body's geoms along its own axes."""
    model = view.model
    geoms = np.flatnonzero(model.geom_bodyid == body)
    if not len(geoms):
        return np.zeros(3)
    rotations = np.zeros((len(geoms), 9))
    for rotation, geom in zip(rotations, geoms, strict=True):
        mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
    frames = rotations.reshape(-1, 3, 3)
    middles = model.geom_pos[geoms] + (frames @ model.geom_aabb[geoms, :3, None])[..., 0]
    half_m = (np.abs(frames) @ model.geom_aabb[geoms, 3:, None])[..., 0]
    return (middles + half_m).max(axis=0) - (middles - half_m).min(axis=0)
