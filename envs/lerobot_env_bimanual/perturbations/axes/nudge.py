"""Somebody shifts what lies on the table, while the arms are at work."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS
from lerobot_env_bimanual.episode.progress import EpisodeProgress
from lerobot_env_bimanual.episode.reset import EpisodeStart
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.perturbations.axes._free_bodies import free_roots, has_free_bodies
from lerobot_env_bimanual.perturbations.axis import Axis, Group
from lerobot_env_bimanual.perturbations.registry import register
from lerobot_env_bimanual.task import TaskSpec
from lerobot_env_bimanual.world.scene import Scene

CM_PER_M = 100
NOT_BEFORE_TICKS = (10, 20)
"""Half-open range of the tick from which it may happen, half a second to one: an expert is then on the way to its first
keypose, so whoever looks after each keypose sees it before anything is touched."""
DIRECTIONS = 12
DEEPER_M = 5e-4
"""By how much a shifted thing may sink deeper into what does not move; more is a collision."""

type Neighbours = dict[tuple[int, int], float]
"""Tree and geom that touch a thing -> the least distance, m; negative where they overlap."""


@register
class Nudge(Axis):
    """Whoever looks again can answer; whoever plans once goes to where things were.

    All things that move freely are shifted by the same way, so nothing that stands on something falls, as long as no hand
    touches one of them. What is hemmed in by furniture or a hand, or would lose its support, stays.
    """

    name = "nudge"
    group = Group.TIME
    levels = (1, 2, 3)
    unit = "centimetres"
    summary = "once, after 0.5 to 1 s, all loose things that no hand touches are shifted the same way along the table"
    source = "chosen here: from a sleeve that brushes a thing to a hand that pushes it aside"

    def applies_to(self, task: TaskSpec, model: mujoco.MjSpec) -> bool:
        """Whether anything moves freely."""
        return has_free_bodies(model)

    def begin(self, start: EpisodeStart, magnitude: float, rng: np.random.Generator) -> None:
        """Draw when and where to, so that the task can still be done from there; nowhere if there is no such way."""
        not_before = int(rng.integers(*NOT_BEFORE_TICKS))
        angles_rad = rng.uniform(0, 2 * np.pi) + 2 * np.pi * rng.permutation(DIRECTIONS) / DIRECTIONS
        shifts_m = magnitude / CM_PER_M * np.stack([np.cos(angles_rad), np.sin(angles_rad)], axis=1)
        scene, most = start.scene, 0
        for shift_m in shifts_m:
            moved = _shift(scene, shift_m)
            if len(moved) > most and start.is_feasible():
                most = len(moved)
                start.progress.memory[self.name] = {"not_before": not_before, "shift_m": shift_m}
            _put(scene, moved, -shift_m)
            if most == len(free_roots(scene.model)):
                break

    def disturb(
        self, scene: Scene, progress: EpisodeProgress, magnitude: float, rng: np.random.Generator
    ) -> None:
        """Shift what can be shifted, once; it lies as still there as it did before."""
        drawn = progress.memory.get(self.name)
        if drawn is None or progress.ticks < drawn["not_before"] or _is_touched(scene):
            return
        if _shift(scene, drawn["shift_m"]):
            del progress.memory[self.name]


def _is_touched(scene: Scene) -> bool:
    names = [scene.model.body(root).name for root in free_roots(scene.model)]
    return any(scene.arm_touches(arm, name) for arm in ARMS for name in names)


def _shift(scene: Scene, shift_m: NDArray[np.float64]) -> list[int]:
    """Shift (2,) all things that move freely, but for those that cannot be; returns the bodies that were moved."""
    moved = free_roots(scene.model).tolist()
    before = _neighbours(scene, moved)
    _put(scene, moved, shift_m)
    while moved:
        after = _neighbours(scene, moved)
        stuck = [root for root in moved if not _may_stand(before[root], after[root], moved)]
        if not stuck:
            break
        _put(scene, stuck, -shift_m)
        moved = [root for root in moved if root not in stuck]
    return moved


def _put(scene: Scene, roots: list[int], shift_m: NDArray[np.float64]) -> None:
    for root in roots:
        name = scene.model.body(root).name
        scene.place(name, scene.pose(name).translated((*shift_m, 0)))


def _neighbours(scene: Scene, roots: list[int]) -> dict[int, Neighbours]:
    """What touches each thing."""
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


def _may_stand(before: Neighbours, after: Neighbours, moved: list[int]) -> bool:
    """Whether what was moved still touches what it touched, of all that was not moved, and sinks into nothing."""
    kept = {key for key in before if key[0] not in moved} <= after.keys()
    return kept and all(
        distance_m > before.get(key, 0.0) - DEEPER_M
        for key, distance_m in after.items()
        if key[0] not in moved
    )
