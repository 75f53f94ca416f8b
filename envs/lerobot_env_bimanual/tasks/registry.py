"""The tasks by name, in suites, and as Gymnasium ids such as `bimanual/LiftBall-v0`.

Names are known without loading MuJoCo, so that a plugin can list its tasks quickly.
"""

from __future__ import annotations

import inspect
import itertools
import pkgutil
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import gymnasium as gym

from lerobot_bimanual.errors import InvalidChoice
from lerobot_env_bimanual.registry import Registry

if TYPE_CHECKING:
    from lerobot_env_bimanual.task import Task

ALL = "all"
TWO_ARMED = "two_armed"
"""Suite of the tasks that one arm alone cannot do, according to the PerAct2 paper."""

_FILES = (module.name for module in pkgutil.iter_modules([str(Path(__file__).parent)]))
TASKS: Registry[type[Task]] = Registry(
    kind="task",
    group="lerobot_bimanual.tasks",
    own={name: f"{__package__}.{name}" for name in _FILES if not name.startswith("_") and name != "registry"},
)


def register[T: Task](task_class: type[T]) -> type[T]:
    """Class decorator: add a task to the registry.

    Raises:
        ValueError: another task has the same name or id, or its data contradict each other.
    """
    from lerobot_env_bimanual.task import OWN_IDS

    spec = task_class.spec
    _check(task_class())
    if task_class.__module__ != TASKS.own.get(spec.name):
        if spec.name in TASKS.own:
            raise ValueError(f"name is {spec.name!r}, which belongs to a built-in task: choose another one")
        if spec.id < OWN_IDS:
            raise ValueError(
                f"id is {spec.id}, but ids below {OWN_IDS} belong to built-in tasks: leave id out"
            )
    for other in TASKS.loaded.values():
        if other.spec.id == spec.id:
            raise ValueError(f"task {spec.name!r} has the id of {other.spec.name!r}; ids must be unique")
    TASKS.add(spec.name, task_class)
    return task_class


def _check(task: Task) -> None:
    """Raise a `ValueError` for data whose episodes would seem right but be wrong."""
    from lerobot_env_bimanual.props.prop import DISTRACTOR

    spec = task.spec
    for name in ("instructions", "suites", "props", "success", "variations", "varied", "plans"):
        if not isinstance(given := getattr(spec, name), tuple):
            raise ValueError(f"{name} is {given!r:.80}, but must be a tuple: one alone has a comma behind it")
    if any(not isinstance(props, tuple) for props in spec.varied):
        raise ValueError(
            "varied must be a tuple of sets of props, each a tuple: one alone has a comma behind it"
        )
    if spec.horizon_ticks < 1:
        raise ValueError(f"horizon_ticks is {spec.horizon_ticks}, but must be at least 1")
    for name in ("instructions", "variations", "plans"):
        if not getattr(spec, name):
            raise ValueError(f"{name} are empty, but an episode has one")
    for prop in itertools.chain(spec.props, *spec.varied):
        if prop.name.startswith(DISTRACTOR):
            raise ValueError(f"a prop is called {prop.name!r}, but such names belong to the axis clutter")
    indices = [variation.index for variation in spec.variations]
    if indices != [*range(len(indices))]:
        raise ValueError(f"variations have the indices {indices}, but must have {[*range(len(indices))]}")
    for variation in spec.variations:
        try:
            spec.instructions_for(variation)
        except LookupError as error:
            raise ValueError(
                f"an instruction names {error}, which variation {variation.index} has no word for"
            ) from error
        if not isinstance(conditions := task.conditions(variation), tuple):
            raise ValueError(f"conditions are {conditions!r:.80}, but must be a tuple")
        names = [condition.name for condition in conditions]
        if not names:
            raise ValueError("success is empty, so that every episode would be solved at once")
        if twice := {name for name in names if names.count(name) > 1}:
            raise ValueError(
                f"conditions must have different names, but two are called {', '.join(sorted(twice))}"
            )
        for plan in range(len(spec.plans)):
            try:
                inspect.signature(task.script_for_plan(variation, plan))
            except ValueError as error:
                raise ValueError(f"plans are {spec.plans}, but script has no argument `plan`") from error


def list_tasks() -> tuple[str, ...]:
    """Names of all tasks, sorted; one of another distribution may turn out to be broken when it is loaded."""
    return TASKS.names


def get_task(name: str) -> Task:
    """A fresh instance of the task called `name`.

    Raises:
        InvalidChoice: no such task; the message lists those that exist.
        BimanualError: it belongs to another distribution, and cannot be loaded.
    """
    return TASKS.get(name)()


def list_suites() -> dict[str, tuple[str, ...]]:
    """Each suite with the names of its tasks, both sorted; without tasks that cannot be loaded."""
    suites: dict[str, list[str]] = {ALL: []}
    for name, task in TASKS.all().items():
        spec = task.spec
        for suite in (ALL, *spec.suites, *((TWO_ARMED,) if spec.needs_both_arms else ())):
            suites.setdefault(suite, []).append(name)
    return {suite: tuple(suites[suite]) for suite in sorted(suites)}


def resolve_tasks(selection: str | Sequence[str]) -> tuple[str, ...]:
    """Names of the tasks that a selection means, in its order and without repetitions.

    Args:
        selection: task and suite names, comma separated or as a sequence, e.g. `"push_box,lift_ball"`, `"all"`.

    Raises:
        InvalidChoice: a name is neither a task nor a suite, or the selection is empty.
    """
    names = selection.split(",") if isinstance(selection, str) else selection
    names = [name.strip() for name in names] or [""]
    tasks, chosen = list_tasks(), dict[str, None]()
    for name in names:  # only a suite needs all tasks to be loaded
        suites = {} if name in tasks and name != ALL else list_suites()
        if name not in tasks and name not in suites:
            raise InvalidChoice("task", name, (*tasks, *suites))
        chosen.update(dict.fromkeys(suites.get(name, (name,))))
    return tuple(chosen)


def gym_id(task: str) -> str:
    """Gymnasium id of a task, e.g. `bimanual/LiftBall-v0` of `lift_ball`."""
    return f"bimanual/{''.join(word.capitalize() for word in task.split('_'))}-v0"


def register_gym_ids() -> None:
    """Register every task with Gymnasium, without importing its module."""
    for task in list_tasks():
        if gym_id(task) not in gym.registry:
            entry_point = "lerobot_env_bimanual.vector.gym_env:make_env"
            gym.register(gym_id(task), entry_point=entry_point, kwargs={"task": task})
