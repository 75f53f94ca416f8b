"""Versions of worlds: a short hash of what a task's world does, not of the text of its code.

Reports and results are true of one world. Moving a comment or a file leaves its version as it is; another friction,
planner, placement law or success condition changes it.

Motion plans differ in the last bit between families of processors, so only values that such a bit cannot change are
hashed: the compiled model's numbers to six digits, and, from one episode of the expert, what was drawn, how long each
motion took, and the arms' positions before anything was touched.
"""

from __future__ import annotations

import functools
import hashlib
import itertools
import logging
import multiprocessing
import platform
from collections.abc import Iterable, Iterator
from dataclasses import fields
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from lerobot_bimanual.arms import ARMS, JOINTS_PER_ARM
from lerobot_bimanual.distributions import SIMULATION_PACKAGES, installed_versions, libc_mismatch
from lerobot_bimanual.errors import BimanualError, InvalidChoice, PlacementFailure
from lerobot_bimanual.results.evaluation import VERSION_DIGITS
from lerobot_env_bimanual.conditions import OnTheWay
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.episode.progress import draw_episode
from lerobot_env_bimanual.experts.runner import Move, expert, run_episode
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.options import STANDARD
from lerobot_env_bimanual.registry import checked_perturbation
from lerobot_env_bimanual.robots.panda_pair import FINGERS
from lerobot_env_bimanual.task import Task
from lerobot_env_bimanual.tasks.registry import list_tasks

if TYPE_CHECKING:
    from lerobot_bimanual.dataset.provenance import Provenance

CERTIFIED_MUJOCO = "3.17.0"
"""Version of MuJoCo for whose worlds this repository has expert reports and results."""
PROBE_SPLIT, PROBE_SEED = "val", 0
SILENT_S = 2.0
"""Worlds are versioned without a progress bar for this long."""

MODEL_PARTS = frozenset(
    ["body", "jnt", "dof", "geom", "site", "cam", "light", "tendon", "eq", "actuator", "pair", "exclude"]
)
"""Prefixes of the model's arrays that define its elements and how they move; the rest is bookkeeping."""
NOISY = ("body_iquat",)
"""Axes of inertia, which in round bodies depend on the last bit."""
NEARLY_ZERO = 1e-9
ARM_POSITIONS = len(ARMS) * (JOINTS_PER_ARM + len(FINGERS))
"""Number of the arms' positions, which come first in a scene's positions."""
OPTIONS = ("timestep", "integrator", "cone", "impratio", "gravity", "density", "iterations", "tolerance")


@functools.cache
def world_version(task: str, perturb: str = "", setting: str = STANDARD) -> str:
    """Version of a task's world; plays one episode of its expert with each set of props, half a second or two.

    Args:
        task: its name.
        perturb: perturbations of the world, `AXIS:LEVEL,...`. Of an axis that is only seen, the magnitude counts.
        setting: "standard" or "varied".

    Raises:
        InvalidChoice: there is no such task, axis or level.
    """
    _say_if_uncertified()
    env = BimanualEnv(task, split=PROBE_SPLIT, obs="state", perturb=perturb, setting=setting)
    digest = hashlib.sha256()
    perturbed = (f"{axis} {magnitude}" for axis, magnitude in env.perturbations.magnitudes.items())
    seeds = _probe_seeds(env)
    of_sets = (fact for seed in seeds for fact in (*_episode_facts(env, seed), *_model_facts(env)))
    for fact in (*_task_facts(env.task_definition), *of_sets, *perturbed):
        digest.update(fact.encode() + b"\n")
    env.close()
    return digest.hexdigest()[:VERSION_DIGITS]


@functools.cache
def _say_if_uncertified() -> None:
    """Warn, once and not again in worker processes, where MuJoCo has another version than that of the published expert reports."""
    installed = mujoco.mj_versionString()
    if installed != CERTIFIED_MUJOCO and multiprocessing.parent_process() is None:
        logging.getLogger(__name__).warning(
            "MuJoCo %s is installed, but the published expert reports and results hold for MuJoCo %s, whose worlds differ. "
            "`lerobot-bimanual expert evaluate` measures the experts with the installed version",
            installed,
            CERTIFIED_MUJOCO,
        )


def simulation_versions() -> dict[str, str]:
    """Versions of everything that decides the outcome of an episode."""
    return installed_versions(SIMULATION_PACKAGES) | {"python": platform.python_version()}


def world_versions(tasks: Iterable[str], perturb: str = "", setting: str = STANDARD) -> dict[str, str]:
    """The version of each task's world, see `world_version`; "none" of a task or a perturbation that is not here."""
    try:
        checked_perturbation(perturb)
    except InvalidChoice:
        return dict.fromkeys(tasks, "none")
    bar = tqdm([*tasks], "worlds", unit="task", leave=False, delay=SILENT_S)
    return {task: world_version(task, perturb, setting) if task in list_tasks() else "none" for task in bar}


def simulation_difference(provenance: Provenance | None) -> str:
    """How the simulation of a dataset differs from the installed one, in words; empty if its episodes replay here."""
    if provenance is None:
        return "the dataset does not say with which versions it was generated"
    if others := provenance.other_versions():
        packages = (f"{name} {recorded} (installed: {here})" for name, (recorded, here) in others.items())
        return f"generated with {', '.join(packages)}"
    here = world_versions(provenance.worlds, provenance.perturb, provenance.setting)
    other = [
        f"{task} in world {version} (here: {here[task]})"
        for task, version in provenance.worlds.items()
        if version != here[task]
    ]
    if other:
        return f"it holds {', '.join(other)}, where the same seeds mean other episodes"
    return libc_mismatch(provenance.versions)


def _task_facts(task: Task) -> Iterator[str]:
    """What the task asks for: sentences, and conditions with all their thresholds."""
    spec = task.spec
    yield f"{spec.name} {spec.id} horizon {spec.horizon_ticks}"
    for variation in spec.variations:
        yield f"{variation} {spec.instructions_for(variation)}"
        for condition in task.conditions(variation):
            for each in (condition, *(condition.parts if isinstance(condition, OnTheWay) else ())):
                values = {field.name: getattr(each, field.name) for field in fields(each)}
                if others := sorted(vars(each).keys() - values.keys() - {"name"}):
                    raise BimanualError(
                        f"{type(each).__name__} of {spec.name} has {', '.join(others)} outside its fields, so that versions "
                        "would not tell it from others: make the condition a frozen dataclass"
                    )
                for name, value in values.items():
                    if isinstance(value, set | frozenset) or " at 0x" in repr(value):
                        raise BimanualError(
                            f"{type(each).__name__}.{name} of {spec.name} is {value!r}, whose text differs from process to "
                            "process: a condition has numbers, texts and tuples"
                        )
                yield f"{type(each).__name__} {values}"


def _model_facts(env: BimanualEnv) -> Iterator[str]:
    """The compiled model, by six digits."""
    model = env.scene.model
    for name in OPTIONS:
        yield f"{name} {_digits(np.atleast_1d(getattr(model.opt, name)))}"
    for name in sorted(dir(model)):
        is_part = name.partition("_")[0] in MODEL_PARTS and name not in NOISY
        values = getattr(model, name) if is_part else None
        if isinstance(values, np.ndarray):
            yield f"{name} {_digits(values)}"
    yield f"mujoco {mujoco.mj_versionString()}"


def _probe_seeds(env: BimanualEnv) -> Iterator[int]:
    """The first seed of each set of props of the environment's setting."""
    spec, options, seen = env.task_definition.spec, env.options, set[int]()
    for seed in itertools.count(PROBE_SEED):
        prop_set = draw_episode(spec, options.split, seed, None, options.setting).prop_set
        if prop_set not in seen:
            seen.add(prop_set)
            yield seed
        if len(seen) == len(spec.prop_sets(options.setting)):
            return


def _episode_facts(env: BimanualEnv, seed: int) -> Iterator[str]:
    """What is drawn in one episode of the expert, where its first motion ends, and how long each takes."""
    stood: list[NDArray[np.float64]] = []

    def note(_: Move) -> None:
        if len(stood) < 2:  # at the start, and after the first motion
            stood.append(np.append(env.scene.data.time, env.scene.data.qpos))

    try:
        outcome = run_episode(env, seed, expert(), note)
    except PlacementFailure as failure:
        yield str(failure)
        return
    yield f"variation {env.variation} {env.task_description} draws {outcome.draws}"
    yield f"placed {_positions(stood[0], 4)}"
    yield f"moved {_positions(stood[-1][: 1 + ARM_POSITIONS], 3)}"
    for move in outcome.moves:
        yield f"{move.name} {move.ticks}"
    yield f"success {outcome.success} ticks {outcome.ticks}"


def _positions(values: NDArray[np.float64], decimals: int) -> str:
    return " ".join(f"{value:.{decimals}f}" for value in (np.round(values, decimals) + 0.0).tolist())


def _digits(values: NDArray) -> str:
    cleaned = np.where(np.abs(values) < NEARLY_ZERO, 0, values)
    return " ".join(f"{value:.6g}" for value in cleaned.ravel().tolist())
