"""What the arms handle is larger."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual.episode.reset import EpisodeStart
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.perturbations.axes._free_bodies import (
    free_bodies,
    free_roots,
    free_roots_of,
    has_free_bodies,
)
from lerobot_env_bimanual.perturbations.axis import Axis, Group
from lerobot_env_bimanual.perturbations.registry import register
from lerobot_env_bimanual.task import TaskSpec
from lerobot_env_bimanual.world.scene import Scene

BEYOND_M = 1e-6


@register
class Size(Axis):
    """Hands meet things earlier and grip them wider; whoever knows sizes by heart presses too deep."""

    name = "size"
    group = Group.BODIES
    levels = (1.01, 1.025, 1.05)
    unit = "times the length, width and height"
    summary = "all things that move freely are larger, about where they stand, and weigh what they weighed"
    source = "chosen here: from a thing's tolerance to the next make of it"

    def applies_to(self, task: TaskSpec, model: mujoco.MjSpec) -> bool:
        """Whether anything moves freely."""
        return has_free_bodies(model)

    def build(self, model: mujoco.MjSpec, magnitude: float) -> None:
        """Scale shapes, places and inertias of the bodies that move freely."""
        meshes: set[str] = set()
        for body in _all_below(free_roots_of(model)):
            body.inertia = np.multiply(body.inertia, magnitude**2)
            body.ipos = np.multiply(body.ipos, magnitude)
            for joint in body.joints:
                joint.pos = np.multiply(joint.pos, magnitude)
            for site in body.sites:
                site.pos, site.size = np.multiply(site.pos, magnitude), np.multiply(site.size, magnitude)
            for geom in body.geoms:
                geom.pos, geom.size = np.multiply(geom.pos, magnitude), np.multiply(geom.size, magnitude)
                geom.fromto = np.multiply(geom.fromto, magnitude)
                geom.density /= magnitude**3
                meshes.update(filter(None, [geom.meshname]))
            for child in body.bodies:
                child.pos = np.multiply(child.pos, magnitude)
        for name in meshes:
            mesh = model.mesh(name)
            mesh.scale = np.multiply(mesh.scale, magnitude)

    def begin(self, start: EpisodeStart, magnitude: float, rng: np.random.Generator) -> None:
        """Lift what would stick in its support: heights above what does not move freely grow, too."""
        scene = start.scene
        for root in free_roots(scene.model):
            name = scene.model.body(root).name
            pose = scene.pose(name)
            scene.place(name, pose.translated((0, 0, (magnitude - 1) * _height_above_support(scene, pose))))


def _all_below(bodies: list[mujoco.MjsBody]) -> Iterator[mujoco.MjsBody]:
    for body in bodies:
        yield body
        yield from _all_below(body.bodies)


def _height_above_support(scene: Scene, pose: Pose) -> float:
    """How far below a pose the first thing lies that does not move freely."""
    is_free = free_bodies(scene.model)
    point, found = pose.position.copy(), np.zeros(1, dtype=np.int32)
    down = np.array([0.0, 0.0, -1.0])
    while (distance := mujoco.mj_ray(scene.model, scene.data, point, down, None, 1, -1, found)) >= 0:
        point[2] -= distance
        if not is_free[scene.model.geom_bodyid[found[0]]]:
            return float(pose.position[2] - point[2])
        point[2] -= BEYOND_M
    return 0.0
