"""Things on the table that have nothing to do with the task."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.geometry.workspace import TABLE_HEIGHT_M
from lerobot_bimanual.keypose import BimanualKeypose, Keypose
from lerobot_env_bimanual.episode.reset import EpisodeStart
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.perturbations.axes._free_bodies import DISTRACTOR
from lerobot_env_bimanual.perturbations.axes._obstacles import Obstacles
from lerobot_env_bimanual.perturbations.axis import Axis, Group
from lerobot_env_bimanual.perturbations.registry import register
from lerobot_env_bimanual.placement import PlacementArea
from lerobot_env_bimanual.world.arena import TABLE_CENTRE_XY_M, TABLE_HALF_SIZE_M

BOX, CYLINDER = mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_CYLINDER
# Shape, size as MuJoCo has it in m, colour: none that an instruction names. Nothing that rolls.
THINGS = (
    (CYLINDER, (0.025, 0.030, 0.0), (0.55, 0.55, 0.57, 1.0)),
    (BOX, (0.035, 0.022, 0.018), (0.40, 0.27, 0.18, 1.0)),
    (CYLINDER, (0.035, 0.010, 0.0), (0.93, 0.92, 0.90, 1.0)),
    (BOX, (0.015, 0.015, 0.030), (0.96, 0.66, 0.72, 1.0)),
    (BOX, (0.035, 0.035, 0.008), (0.13, 0.13, 0.14, 1.0)),
    (CYLINDER, (0.015, 0.020, 0.0), (0.80, 0.72, 0.57, 1.0)),
)
MASS_KG = 0.08
PARKED_M = (-4.0, 0.0)
"""On the floor behind a wall, where those stand that find no place."""
PARKING_PITCH_M = 0.2

EDGE_M = 0.06
AREA = PlacementArea(TABLE_CENTRE_XY_M, tuple(np.subtract(TABLE_HALF_SIZE_M[:2], EDGE_M)), np.pi)
SPOTS = 60
"""Places that are drawn for each thing."""


@register
class Clutter(Axis):
    """Whoever takes every small thing for the object, or knows the table by heart, is led astray.

    They lie where neither a hand's way along the table nor a door's leads, at least 4 cm from everything, so that nothing
    is hidden from all cameras; the way through free space is planned around them. Those that find no such place are left
    out.
    """

    name = "clutter"
    group = Group.CLUTTER
    levels = (2, 4, 6)
    unit = "things, at most"
    summary = "small things of plain shapes and colours that no instruction names lie on the table, out of the hands' way"
    source = "chosen here: from a tidy desk to a used one"

    def build(self, model: mujoco.MjSpec, magnitude: float) -> None:
        """Add them, out of sight."""
        for index, (shape, size, rgba) in enumerate(THINGS[: int(magnitude)]):
            x, y = PARKED_M
            body = model.worldbody.add_body(
                name=f"{DISTRACTOR}{index}", pos=(x, y + index * PARKING_PITCH_M, _half_height(index))
            )
            body.add_freejoint()
            body.add_geom(type=shape, size=size, rgba=rgba, mass=MASS_KG)

    def begin(self, start: EpisodeStart, magnitude: float, rng: np.random.Generator) -> None:
        """Place one after the other; take the last away for as long as the arms cannot do the task beside them."""
        scene, placed = start.scene, []
        obstacles = Obstacles(scene, list(_stages(start)))
        for index in range(int(magnitude)):
            name = f"{DISTRACTOR}{index}"
            parked = scene.pose(name)
            poses = [AREA.sample(rng, TABLE_HEIGHT_M + _half_height(index)) for _ in range(SPOTS)]
            free = (pose for pose in poses if obstacles.leave_free(pose.position, _radius(index)))
            if (pose := next(free, None)) is not None:
                scene.place(name, pose)
                obstacles.add(pose.position, _radius(index))
                placed.append((name, parked))
        while placed and not start.is_feasible():
            scene.place(*placed.pop())


def _half_height(index: int) -> float:
    shape, size, _ = THINGS[index]
    return size[2] if shape == BOX else size[1]


def _radius(index: int) -> float:
    """Of the sphere around it."""
    shape, size, _ = THINGS[index]
    return float(np.linalg.norm(size if shape == BOX else size[:2]))


def _stages(start: EpisodeStart) -> Iterator[tuple[BimanualKeypose, BimanualKeypose]]:
    """Both ends of every stage of the script; where it plans its own way, its end alone."""
    scene = start.scene
    last = BimanualKeypose(*(Keypose(scene.tcp(arm), True, True) for arm in ARMS))
    for stage in start.task.script(scene, start.progress.variation):
        target = stage.keypose(last)
        yield (target if stage.planned else last), target
        last = target
