"""How much the five cameras see of the objects, and of what each arm goes to next.

An arm's target is the object that its fingertips are nearest to at the end of a move, around the nearest point. What
already rides in that hand is the target only if the hand brings it to nothing else. It is looked for in the state before
the move, in which a policy has to choose where to go.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_bimanual.cameras import CAMERA_NAMES, unproject
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.runner import Move, run_expert
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.world.cameras import calibration
from lerobot_env_bimanual.world.rendering import Renderer
from lerobot_env_bimanual.world.scene import Scene, SceneState
from lerobot_env_bimanual.world.scene_view import SceneView

IMAGE_SIZE = 256
"""Side of the images whose pixels are counted."""
MIN_PIXELS = 20
"""Of a target that a camera sees: five of an image with half the side."""
MIN_VIEWS = 2
"""In which a target ought to be seen."""
NEAR_M = 0.10
"""Around the point that a hand goes to: so much of the object is its target."""
REACH_M = 0.15
"""From the fingertips: what is further away at the end of a move is not what the arm went to."""
MOVED_M = 0.01
MOVED_RAD = np.deg2rad(5.0)
"""Less than both is no move of an arm."""


@dataclass(frozen=True, eq=False)
class Target:
    """What an arm goes to.

    Attributes:
        item: index into `Items.names`.
        point_m: (3,) world, where on the object the hand will arrive, with the object still where it is.
    """

    item: int
    point_m: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Sight:
    """What the cameras see before one move of an expert, in pixels of images of `IMAGE_SIZE`.

    Attributes:
        seed: of the episode.
        step: number of the move, from 0.
        move: its name.
        items: per object its pixels (5,), camera by camera.
        targets: per arm that moves to something the object's name and the target's pixels (5,).
    """

    seed: int
    step: int
    move: str
    items: Mapping[str, NDArray[np.int_]]
    targets: Mapping[Arm, tuple[str, NDArray[np.int_]]]

    def views(self, arm: Arm) -> int:
        """Number of cameras that see an arm's target."""
        return int(np.count_nonzero(self.targets[arm][1] >= MIN_PIXELS))


@dataclass(frozen=True)
class TargetViews:
    """How well an arm's target is seen before the same move of several episodes.

    Attributes:
        names: the objects that it was.
        least_views: cameras that saw it when the fewest did.
        seen: episodes in which at least `MIN_VIEWS` cameras saw it.
        episodes: in which the arm moves to something.
    """

    names: tuple[str, ...]
    least_views: int
    seen: int
    episodes: int


@dataclass(frozen=True)
class Moment:
    """What the cameras see before the same move of several episodes.

    Attributes:
        step: number of the move; 0 is the first, before which stands the start.
        move: its name.
        items: per object the median of its pixels in each camera.
        targets: per arm, by its name.
    """

    step: int
    move: str
    items: dict[str, tuple[int, ...]]
    targets: dict[str, TargetViews]


class Items:
    """The objects of a model: what moves by itself, doors and buttons too, and what stands still.

    Args:
        scene: whose model it is.

    Attributes:
        names: of their root bodies.
        of_geom: (ngeom + 1,) the object that each geom belongs to; -1 of arms and room, and in the last place.
    """

    def __init__(self, scene: SceneView):
        model = scene.model
        root = np.where(model.body_treeid >= 0, model.tree_bodyadr[model.body_treeid], model.body_rootid)
        no_items = {0, *(model.body(scene.arm_pair.base_body(arm)).id for arm in ARMS)}
        is_item = ~np.isin(model.body_rootid, list(no_items))
        roots = np.unique(root[model.geom_bodyid][is_item[model.geom_bodyid]])
        self.names = [model.body(int(body)).name for body in roots]
        item_of_body = np.where(is_item, np.searchsorted(roots, root), -1)
        self.of_geom = np.append(item_of_body[model.geom_bodyid], -1)

    def held(self, scene: SceneView, arm: Arm) -> set[int]:
        """The objects in a hand."""
        return {item for item, name in enumerate(self.names) if scene.held(arm, name)}

    def nearest(self, scene: SceneView, arm: Arm, items: set[int]) -> tuple[float, int, NDArray[np.float64]]:
        """The geom of some objects that a hand's fingertips are nearest to.

        Returns:
            Distance in m, at most `REACH_M`; the geom, -1 if none is nearer; its nearest point (3,), world.
        """
        nearest = (REACH_M, -1, np.zeros(3))
        ends = np.empty(6)
        for pad in (scene.model.geom(f"{arm.value}_pad{side}").id for side in (1, 2)):
            for geom in np.flatnonzero(np.isin(self.of_geom[:-1], list(items))):
                distance_m = mujoco.mj_geomDistance(scene.model, scene.data, pad, int(geom), REACH_M, ends)
                if distance_m < nearest[0]:
                    nearest = (distance_m, int(geom), ends[3:].copy())
        return nearest


def sights(task: str, seeds: Sequence[int], split: str) -> Iterator[Sight]:
    """Let the expert play, and look at the scene before each of its moves.

    Args:
        task: registered task name.
        seeds: of the episodes; each draws its variation.
        split: of the seeds.
    """
    env = BimanualEnv(task, split=split, obs="state", control_mode="keypose")
    with Renderer(env.scene, CAMERA_NAMES, IMAGE_SIZE, IMAGE_SIZE) as renderer:
        for seed in seeds:
            moves: list[Move] = []
            states: list[SceneState] = []

            def note(move: Move, moves: list[Move] = moves, states: list[SceneState] = states) -> None:
                moves.append(move)
                states.append(env.scene.save_state())

            run_expert(env, seed, on_move=note)
            states.append(env.scene.save_state())
            for step, move in enumerate(moves):
                targets = find_targets(env.scene, states[step], states[step + 1])
                yield Sight(seed, step, move.name, *look(env.scene, renderer, targets))
    env.close()


def summarise(sights: Iterable[Sight]) -> tuple[Moment, ...]:
    """The moments of a task, move by move."""
    by_step: dict[int, list[Sight]] = defaultdict(list)
    for sight in sights:
        by_step[sight.step].append(sight)
    return tuple(
        Moment(
            step,
            alike[0].move,
            {
                name: tuple(
                    int(pixels) for pixels in np.median([sight.items[name] for sight in alike], axis=0)
                )
                for name in alike[0].items
            },
            {
                arm.value: _target_views(arm, having)
                for arm in ARMS
                if (having := [sight for sight in alike if arm in sight.targets])
            },
        )
        for step, alike in sorted(by_step.items())
    )


def _target_views(arm: Arm, sights: Sequence[Sight]) -> TargetViews:
    views = [sight.views(arm) for sight in sights]
    return TargetViews(
        names=tuple(sorted({sight.targets[arm][0] for sight in sights})),
        least_views=min(views),
        seen=sum(number >= MIN_VIEWS for number in views),
        episodes=len(views),
    )


def find_targets(scene: Scene, before: SceneState, after: SceneState) -> dict[Arm, Target]:
    """What each arm that moves to something goes to.

    Args:
        scene: left in the state before the move.
        before: the state before the move.
        after: the state at its end.
    """
    items = Items(scene)
    everything = set(range(len(items.names)))
    scene.restore_state(before)
    start = {arm: scene.tcp(arm) for arm in ARMS}
    held = {arm: items.held(scene, arm) for arm in ARMS}
    away_m = {arm: items.nearest(scene, arm, everything - held[arm])[0] for arm in ARMS}
    scene.restore_state(after)
    ends = {}
    for arm in ARMS:
        moved_m, moved_rad = scene.tcp(arm).distance_to(start[arm])
        if moved_m < MOVED_M and moved_rad < MOVED_RAD:
            continue
        carried = held[arm] & items.held(scene, arm)
        distance_m, geom, point_m = items.nearest(scene, arm, everything - carried)
        if carried and distance_m >= away_m[arm]:
            _, geom, point_m = items.nearest(scene, arm, carried)
        if geom >= 0:
            body = scene.model.geom_bodyid[geom]
            rotation = scene.data.xmat[body].reshape(3, 3)
            ends[arm] = (geom, body, (point_m - scene.data.xpos[body]) @ rotation)
    scene.restore_state(before)
    return {
        arm: Target(
            int(items.of_geom[geom]),
            scene.data.xpos[body] + scene.data.xmat[body].reshape(3, 3) @ point_m,
        )
        for arm, (geom, body, point_m) in ends.items()
    }


def look(
    scene: Scene, renderer: Renderer, targets: Mapping[Arm, Target]
) -> tuple[dict[str, NDArray[np.int_]], dict[Arm, tuple[str, NDArray[np.int_]]]]:
    """Pixels of all objects and of the arms' targets, camera by camera; see `Sight`."""
    items = Items(scene)
    shown = np.zeros((len(items.names), len(CAMERA_NAMES)), int)
    aimed = {arm: np.zeros(len(CAMERA_NAMES), int) for arm in targets}
    extrinsics, intrinsics = (
        matrices.reshape(len(CAMERA_NAMES), -1) for matrices in calibration(scene, IMAGE_SIZE, IMAGE_SIZE)
    )
    for camera, (geoms, depth_m) in enumerate(renderer.segment().values()):
        item = items.of_geom[geoms]
        shown[:, camera] = np.bincount(item[item >= 0], minlength=len(shown))
        points_m = unproject(depth_m, intrinsics[camera].reshape(3, 3), extrinsics[camera].reshape(4, 4))
        for arm, target in targets.items():
            near = np.linalg.norm(points_m - target.point_m, axis=-1) < NEAR_M
            aimed[arm][camera] = np.count_nonzero(near & (item == target.item))
    return (
        dict(zip(items.names, shown, strict=True)),
        {arm: (items.names[target.item], aimed[arm]) for arm, target in targets.items()},
    )
