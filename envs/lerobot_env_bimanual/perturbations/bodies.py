"""Axes that change what the arms handle: `friction`, `mass`, `nudge`, `size`, `stiffness`."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.perturbations.axis import Axis, HookContext, Start, data, register
from lerobot_env_bimanual.props.prop import DISTRACTOR
from lerobot_env_bimanual.robots.panda_pair import PANDA_PAIR
from lerobot_env_bimanual.task import TaskSpec
from lerobot_env_bimanual.world.scene import Scene
from lerobot_env_bimanual.world.scene_view import SceneView

FREE = mujoco.mjtJoint.mjJNT_FREE
HINGED = (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE)
ARM_JOINTS = {name for arm in ARMS for name in (*PANDA_PAIR.joint_names(arm), *PANDA_PAIR.finger_names(arm))}
CM_PER_M = 100
RAY_STEP_M = 1e-6
"""A ray goes on this far below a surface that it has hit."""
NUDGE_TICKS = (10, 20)
"""Half-open range of the tick from which a nudge may happen, half a second to one: the expert is then on the way to its
first keypose, so a policy that observes after each keypose sees the nudge before anything is touched."""
N_DIRECTIONS = 12
MAX_SINKING_M = 5e-4
"""A shifted thing may sink this much deeper into what does not move; more is a collision."""
EDGE_M = 0.005
"""A shifted thing lies this far from the edge of its support; a nearer one may tip over it."""


def free_roots(model: mujoco.MjModel) -> NDArray[np.intp]:
    """Indices of the bodies with a free joint, without distractors."""
    roots = model.jnt_bodyid[model.jnt_type == FREE]
    is_handled = [not model.body(root).name.startswith(DISTRACTOR) for root in roots]
    return roots[np.array(is_handled, dtype=bool)].astype(np.intp)


def free_bodies(model: mujoco.MjModel) -> NDArray[np.bool_]:
    """(nbody,) bodies with a free joint, and those below them, without distractors."""
    return np.isin(model.body_rootid, free_roots(model))


def joints_of_props(scene: SceneView) -> NDArray[np.bool_]:
    """(njnt,) hinges and slides that are not the arms': of doors, drawers, buttons and lids."""
    model = scene.model
    return np.isin(model.jnt_type, HINGED) & (scene.arm_of_body[model.jnt_bodyid] < 0)


def _free_roots_of_spec(model: mujoco.MjSpec) -> list[mujoco.MjsBody]:
    bodies = (joint.parent for joint in model.joints if joint.type == FREE)
    return [body for body in bodies if not body.name.startswith(DISTRACTOR)]


def _has_free_bodies(task: TaskSpec, model: mujoco.MjSpec) -> bool:
    return bool(_free_roots_of_spec(model))


def _has_joints(task: TaskSpec, model: mujoco.MjSpec) -> bool:
    return any(joint.type in HINGED and joint.name not in ARM_JOINTS for joint in model.joints)


def _scale_friction(start: Start) -> None:
    """Scale the friction of all surfaces and pairs.

    For two touching surfaces MuJoCo uses the friction of the one with priority (the grippers' rubber, wet glaze, the
    ball), else the larger friction; explicit contact pairs override both. Scaling only a thing's own value would change few
    contacts or none. Scaling all values by one factor scales each contact by that factor, whichever rule applies to it.
    """
    model, factor = start.scene.model, start.magnitude
    start.scene.alter(geom_friction=model.geom_friction * factor, pair_friction=model.pair_friction * factor)


register(Axis(**data("friction"), begin=_scale_friction))


def _scale_mass(start: Start) -> None:
    model = start.scene.model
    factors = np.where(free_bodies(model), start.magnitude, 1.0)
    start.scene.alter(body_mass=model.body_mass * factors, body_inertia=model.body_inertia * factors[:, None])


register(Axis(**data("mass"), applies_to=_has_free_bodies, begin=_scale_mass))


def _stiffen(start: Start) -> None:
    model = start.scene.model
    factors = np.where(joints_of_props(start.scene), start.magnitude, 1.0)
    of_dofs = factors[model.dof_jntid]
    start.scene.alter(
        jnt_stiffness=model.jnt_stiffness * factors,
        dof_damping=model.dof_damping * of_dofs,
        dof_frictionloss=model.dof_frictionloss * of_dofs,
    )


register(Axis(**data("stiffness"), applies_to=_has_joints, begin=_stiffen))


def _enlarge(model: mujoco.MjSpec, magnitude: float) -> None:
    """Scale shapes, places and inertias of the bodies that move freely."""
    meshes: set[str] = set()
    for body in (each for root in _free_roots_of_spec(model) for each in (root, *root.find_all("body"))):
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


def _lift_enlarged(start: Start) -> None:
    """Lift enlarged bodies out of their support: scale heights above bodies that are not free, and boxes of conditions."""
    scene = start.scene
    for root in free_roots(scene.model):
        name = scene.model.body(root).name
        scene.scales[name] = start.magnitude
        pose = scene.pose(name)
        scene.place(name, pose.translated((0, 0, (start.magnitude - 1) * _height_above_support(scene, pose))))


def _height_above_support(scene: Scene, pose: Pose) -> float:
    """Distance from a pose down to the first thing that does not move freely, m."""
    is_free = free_bodies(scene.model)
    point, found = pose.position.copy(), np.zeros(1, dtype=np.int32)
    down, normal = np.array([0.0, 0.0, -1.0]), np.zeros(3)
    while (distance := mujoco.mj_ray(scene.model, scene.data, point, down, None, 1, -1, found, normal)) >= 0:
        is_inside = normal[2] < 0  # the ray began inside a body, such as the table, and leaves it below
        surface_m = point[2] if is_inside else point[2] - distance
        if not is_free[scene.model.geom_bodyid[found[0]]]:
            return float(pose.position[2] - surface_m)
        point[2] -= distance
        point[2] -= RAY_STEP_M
    return 0.0


register(Axis(**data("size"), applies_to=_has_free_bodies, build=_enlarge, begin=_lift_enlarged))


@dataclass(frozen=True)
class Shift:
    """A nudge that has been drawn and not yet happened: its earliest tick, and its way (2,) along the table, m."""

    earliest_tick: int
    shift_m: NDArray[np.float64]


type Neighbours = dict[tuple[int, int], float]
"""Tree and geom that touch a thing -> the smallest distance, m; negative where they overlap."""


def _draw_nudge(start: Start[Shift | None]) -> None:
    """Draw a tick and a way after which the task can still be done; without such a way there is no nudge."""
    rng, scene, most = start.rng, start.scene, 0
    earliest_tick = int(rng.integers(*NUDGE_TICKS))
    angles_rad = rng.uniform(0, 2 * np.pi) + 2 * np.pi * rng.permutation(N_DIRECTIONS) / N_DIRECTIONS
    shifts_m = start.magnitude / CM_PER_M * np.stack([np.cos(angles_rad), np.sin(angles_rad)], axis=1)
    for shift_m in shifts_m:
        moved = _shift(scene, shift_m)
        if len(moved) > most and start.is_feasible():
            most = len(moved)
            start.remember(Shift(earliest_tick, shift_m))
        _move(scene, moved, -shift_m)
        if most == len(free_roots(scene.model)):
            break


def _nudge(context: HookContext[Shift | None]) -> None:
    """Shift what can be shifted, once; velocities stay as they are."""
    drawn, scene = context.memory, context.scene
    if drawn is None or context.progress.ticks < drawn.earliest_tick or _is_touched(scene):
        return
    if _shift(scene, drawn.shift_m):
        context.remember(None)
        context.progress.disturbances += 1


def _is_touched(scene: Scene) -> bool:
    names = [scene.model.body(root).name for root in free_roots(scene.model)]
    return any(scene.arm_touches(arm, name) for arm in ARMS for name in names)


def _shift(scene: Scene, shift_m: NDArray[np.float64]) -> list[int]:
    """Shift (2,) all things that move freely, except those that cannot be; returns the bodies that were moved."""
    moved = free_roots(scene.model).tolist()
    before = _neighbours(scene, moved)
    heights_m = {root: _height_m(scene, root) for root in moved}
    ahead_m = EDGE_M * shift_m / np.linalg.norm(shift_m)
    _move(scene, moved, shift_m)
    while moved:
        after = _neighbours(scene, moved)
        stuck = [
            root
            for root in moved
            if not _can_stay(before[root], after[root], moved)
            or _height_m(scene, root, ahead_m) > heights_m[root] + MAX_SINKING_M  # beyond an edge
        ]
        if not stuck:
            break
        _move(scene, stuck, -shift_m)
        moved = [root for root in moved if root not in stuck]
    return moved


def _height_m(scene: Scene, root: int, ahead_m: Iterable[float] = (0, 0)) -> float:
    """Height of a thing above its support, or above what is below a place (2,) ahead of it."""
    pose = scene.pose(scene.model.body(root).name)
    return _height_above_support(scene, pose.translated((*ahead_m, 0)))


def _move(scene: Scene, roots: list[int], shift_m: NDArray[np.float64]) -> None:
    for root in roots:
        name = scene.model.body(root).name
        scene.place(name, scene.pose(name).translated((*shift_m, 0)))


def _neighbours(scene: Scene, roots: list[int]) -> dict[int, Neighbours]:
    """The neighbours of each thing."""
    model, contact = scene.model, scene.data.contact
    trees = model.body_rootid[model.geom_bodyid]
    found: dict[int, Neighbours] = {root: {} for root in roots}
    for pair, distance_m in zip(contact.geom.tolist(), contact.dist.tolist(), strict=True):
        for geom, other in (pair, pair[::-1]):
            if trees[geom] in found:
                touched = found[trees[geom]]
                key = (int(trees[other]), other)
                touched[key] = min(distance_m, touched.get(key, 0.0))
    return found


def _can_stay(before: Neighbours, after: Neighbours, moved: list[int]) -> bool:
    """Whether a moved thing still touches all unmoved things that it touched before, and sinks into none."""
    kept = {key for key in before if key[0] not in moved} <= after.keys()
    return kept and all(
        distance_m > before.get(key, 0.0) - MAX_SINKING_M
        for key, distance_m in after.items()
        if key[0] not in moved
    )


register(Axis(**data("nudge"), applies_to=_has_free_bodies, begin=_draw_nudge, disturb=_nudge))
