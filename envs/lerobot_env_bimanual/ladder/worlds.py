"""Versions of the worlds of many rungs, each found out by an episode of its own, on several cores."""

from __future__ import annotations

from collections.abc import Sequence

from lerobot_env_bimanual.experts.world_version import world_version
from lerobot_env_bimanual.ladder.controls import RungKey
from lerobot_env_bimanual.ladder.rungs import perturb_text
from lerobot_env_bimanual.workers import WorkerPool


def worlds_of(task: str, rungs: Sequence[RungKey], pool: WorkerPool) -> dict[RungKey, str]:
    """Versions of a task's world on rungs, with a progress bar."""
    places = [(task, perturb_text(*rung)) for rung in rungs]
    return dict(zip(rungs, pool.map(_world, places, f"{task}: worlds", "rung"), strict=True))


def _world(place: tuple[str, str]) -> str:
    return world_version(*place)
