"""The demonstrator that has several plans: which one it takes, no picture tells, and both arms must take the same.

It demonstrates only where all plans of the task can be done. Neither scene nor success depend on the plan, which is drawn from a
stream of its own. A dataset has equally many demonstrations of each, see `lerobot_env_bimanual.generation.plan`.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lerobot_bimanual.codec import KeyposeCodec
from lerobot_bimanual.errors import PlacementFailure
from lerobot_bimanual.keypose import BimanualKeypose
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.episode.rehearsal import Rehearsal
from lerobot_env_bimanual.experts.runner import Move, expert, home_keypose
from lerobot_env_bimanual.options import SETTINGS, SPLITS
from lerobot_env_bimanual.task import TaskSpec
from lerobot_env_bimanual.worlds import CODECS

PLANS_KEY = (0, 1)
"""Makes the stream another one than those of variations and layouts, whose keys have one number."""


def drawn_plan(spec: TaskSpec, split: str, seed: int, setting: str) -> int:
    """Number of the plan that a seed's demonstration follows, all equally likely, whatever its scene.

    Args:
        spec: of the task.
        split: "train", "val" or "test".
        seed: of the episode.
        setting: "standard" or "varied".
    """
    entropy = [SPLITS[split], spec.id, seed, SETTINGS[setting]]
    rng = np.random.default_rng(np.random.SeedSequence(entropy, spawn_key=PLANS_KEY))
    return int(rng.integers(len(spec.plans)))


def plan_of(env: BimanualEnv) -> int:
    """Number of the plan of the present episode's demonstration."""
    return drawn_plan(env.task_definition.spec, env.options.split, env.progress.seed, env.options.setting)


def infeasible_plan(env: BimanualEnv) -> str | None:
    """The first plan that the arms cannot do from the present state, and why; None if they can do all of them."""
    rehearsal, variation = Rehearsal(env.scene, CODECS), env.progress.variation
    for plan, name in enumerate(env.task_definition.spec.plans):
        if reason := rehearsal.infeasibility(env.task_definition.by_plan(variation, plan)):
            return f"plan {name!r}: {reason}"
    return None


def keyposes_by(env: BimanualEnv, plan: int) -> list[BimanualKeypose]:
    """The keyposes of a plan from the start on, as its script gives them while nothing moves."""
    script, target, found = (
        env.task_definition.by_plan(env.progress.variation, plan),
        home_keypose(env.scene),
        [],
    )
    for stage in script(env.scene):
        target = stage.keypose(target)
        found.append(target)
    return found


def demonstrator(env: BimanualEnv, codec: KeyposeCodec | None = None) -> Iterator[Move]:
    """The expert by the plan that is drawn.

    Args:
        env: right after the reset.
        codec: round every keypose to its voxels and bins.

    Raises:
        PlacementFailure: not all plans can be done here.
    """
    if infeasible := infeasible_plan(env):
        raise PlacementFailure(infeasible)
    yield from expert(codec, plan_of(env))(env)
