"""The axis `clutter`: things on the table that no task uses, where neither a hand nor a door passes."""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.geometry.workspace import TABLE_HEIGHT_M
from lerobot_bimanual.keypose import BimanualKeypose
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.perturbations.axis import Axis, Start, data, register
from lerobot_env_bimanual.perturbations.bodies import joints_of_props
from lerobot_env_bimanual.props.prop import DISTRACTOR
from lerobot_env_bimanual.stage import home_keypose, stages_and_targets
from lerobot_env_bimanual.task import PlacementArea
from lerobot_env_bimanual.world.arena import TABLE_CENTRE_XY_M, TABLE_HALF_SIZE_M
from lerobot_env_bimanual.world.scene import Scene

type Points = NDArray[np.float64]

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
"""On the floor behind a wall: things for which there is no place on the table."""
PARKING_PITCH_M = 0.2
EDGE_M = 0.06
AREA = PlacementArea(TABLE_CENTRE_XY_M, tuple(np.subtract(TABLE_HALF_SIZE_M[:2], EDGE_M)), np.pi)
N_PLACES = 60
"""Places that are drawn for each thing."""

MIN_GAP_M = 0.04
"""Distance to everything on the table, and to the ways of doors and drawers."""
MIN_HAND_GAP_M = 0.10
"""Distance to the ways of the hands' middle planes near the table; what they push and carry is within it."""
NEAR_TABLE_M = 0.16
"""Parts of a hand that are higher pass above the things, which are at most 6 cm high."""
HAND_M = np.array([(0.0, 0.0, 0.01), (0.0, -0.10, -0.07), (0.0, 0.10, -0.07), (0.0, 0.0, -0.20)])
"""Points of a hand in the frame of its tool centre point: fingertips, both ends of the palm, flange."""
SHARES = np.linspace(0.0, 1.0, 9)
"""Shares of a stage's way, and of a joint's range, that are checked."""
DIRECTIONS = np.stack([f(np.arange(32) * np.pi / 16) for f in (np.cos, np.sin)])
"""(2, 32) horizontal unit vectors."""


class Obstacles:
    """All things on the table, the space that doors and drawers sweep, and the paths of the hands in each stage."""

    def __init__(self, scene: Scene, stages: Sequence[tuple[BimanualKeypose, BimanualKeypose]]):
        self._centres, self._rotations, self._half_m = map(np.concatenate, zip(*_boxes(scene), strict=True))
        low = [points for start, end in stages if len(points := _low_points(start, end))]
        self._reaches = np.array([(points @ DIRECTIONS).max(axis=0) for points in low]).reshape(
            -1, DIRECTIONS.shape[1]
        )
        self._added: list[tuple[Points, float]] = []

    def add(self, position: Points, radius_m: float) -> None:
        """Add a thing within a sphere."""
        self._added.append((position, radius_m))

    def is_clear(self, position: Points, radius_m: float) -> bool:
        """Whether a sphere at a position (3,) is far enough from everything."""
        if any(np.linalg.norm(position - other) < radius_m + r + MIN_GAP_M for other, r in self._added):
            return False
        local = np.einsum("nij,ni->nj", self._rotations, position - self._centres)
        distances_m = np.linalg.norm(np.maximum(np.abs(local) - self._half_m, 0), axis=1)
        if (distances_m < radius_m + MIN_GAP_M).any():
            return False
        # A point is outside a convex hull if in some direction it is further out than all of the hull.
        beyond_m = (position[:2] @ DIRECTIONS - self._reaches).max(axis=1, initial=-np.inf)
        return bool((beyond_m > radius_m + MIN_HAND_GAP_M).all())


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
    is_distractor = np.array([model.body(body).name.startswith(DISTRACTOR) for body in range(model.nbody)])
    geoms = np.flatnonzero((model.geom_bodyid > 0) & ~is_distractor[model.geom_bodyid])
    swinging = np.flatnonzero(joints_of_props(scene) & (model.jnt_limited > 0))
    for share in SHARES:
        data.qpos[:] = scene.data.qpos
        lower, upper = model.jnt_range[swinging].T
        data.qpos[model.jnt_qposadr[swinging]] = lower + share * (upper - lower)
        mujoco.mj_kinematics(model, data)
        rotations = data.geom_xmat[geoms].reshape(-1, 3, 3)
        centres = data.geom_xpos[geoms] + np.einsum("nij,nj->ni", rotations, model.geom_aabb[geoms, :3])
        yield centres, rotations, model.geom_aabb[geoms, 3:]


def _add_parked(model: mujoco.MjSpec, magnitude: float) -> None:
    """Add the things, out of sight."""
    for index, (shape, size, rgba) in enumerate(THINGS[: int(magnitude)]):
        x, y = PARKED_M
        position = (x, y + index * PARKING_PITCH_M, _half_height(index))
        body = model.worldbody.add_body(name=f"{DISTRACTOR}{index}", pos=position)
        body.add_freejoint()
        body.add_geom(type=shape, size=size, rgba=rgba, mass=MASS_KG)


def _place(start: Start) -> None:
    """Place the things one after the other; then remove the last ones until the arms can do the task."""
    scene, placed = start.scene, []
    obstacles = Obstacles(scene, list(_stages(start)))
    for index in range(int(start.magnitude)):
        name = f"{DISTRACTOR}{index}"
        parked = scene.pose(name)
        poses = [AREA.sample(start.rng, TABLE_HEIGHT_M + _half_height(index)) for _ in range(N_PLACES)]
        free = (pose for pose in poses if obstacles.is_clear(pose.position, _radius(index)))
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
    """Radius of the sphere around a thing, m."""
    shape, size, _ = THINGS[index]
    return float(np.linalg.norm(size if shape == BOX else size[:2]))


def _stages(start: Start) -> Iterator[tuple[BimanualKeypose, BimanualKeypose]]:
    """Both ends of every stage of the script; of a planned stage, whose way is not known, its end alone."""
    script, last = start.task.script_for_plan(start.progress.variation), home_keypose(start.scene)
    for stage, target in stages_and_targets(script, start.scene):
        yield (target if stage.planned else last), target
        last = target


register(Axis(**data("clutter"), build=_add_parked, begin=_place))
