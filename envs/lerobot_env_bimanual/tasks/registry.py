"""The one list of tasks; tables, suites, gym ids and tests are all derived from it."""

from __future__ import annotations

import importlib
from collections.abc import Sequence

from lerobot_bimanual.errors import BimanualError, UnknownTask
from lerobot_env_bimanual.task import Task
from lerobot_env_bimanual.tasks.discovery import TASKS_GROUP, task_modules

_TASKS: dict[str, type[Task]] = {}
ALL = "all"
TWO_ARMED = "two_armed"
"""Suite of the tasks of which the PerAct2 paper says that one arm alone cannot do them."""


def register[T: Task](task_class: type[T]) -> type[T]:
    """Class decorator: add a task to the registry.

    Raises:
        ValueError: another task has the same name or id.
    """
    spec = task_class.spec
    for other in _TASKS.values():
        if other.spec.name == spec.name or other.spec.id == spec.id:
            raise ValueError(
                f"task {spec.name!r} (id {spec.id}) clashes with {other.spec.name!r} (id {other.spec.id}); "
                "names and ids must be unique"
            )
    _TASKS[spec.name] = task_class
    return task_class


def _load(name: str) -> type[Task]:
    """The class of a task that is registered, or found but not yet imported.

    Raises:
        BimanualError: its module cannot be imported, or does not register it.
    """
    if name not in _TASKS:
        module = task_modules()[name]
        try:
            importlib.import_module(module)
        except Exception as error:  # somebody else's module may fail in any way
            raise BimanualError(f"task {name!r} cannot be loaded from module {module!r}: {error}") from error
        if name not in _TASKS:
            raise BimanualError(
                f"module {module!r} registers no task called {name!r}; a file in tasks/, or an entry point of the "
                f"group {TASKS_GROUP!r}, bears the name of its task"
            )
    return _TASKS[name]


def list_tasks() -> tuple[str, ...]:
    """Names of all tasks, sorted."""
    return tuple(sorted({*task_modules(), *_TASKS}))


def get_task(name: str) -> Task:
    """A fresh instance of the task called `name`.

    Raises:
        UnknownTask: no such task; the message lists those that exist.
        BimanualError: it is one of somebody else's, and cannot be loaded.
    """
    if name not in list_tasks():
        raise UnknownTask(name, list_tasks())
    return _load(name)()


def list_suites() -> dict[str, tuple[str, ...]]:
    """Each suite with the names of its tasks, both sorted; a suite without a task does not exist."""
    suites: dict[str, list[str]] = {ALL: []}
    for name in list_tasks():
        spec = _load(name).spec
        for suite in (ALL, *spec.taxonomy.suites, *((TWO_ARMED,) if spec.needs_both_arms else ())):
            suites.setdefault(suite, []).append(name)
    return {suite: tuple(suites[suite]) for suite in sorted(suites)}


def resolve_tasks(selection: str | Sequence[str]) -> tuple[str, ...]:
    """Names of the tasks that a selection means, in its order and without repetitions.

    Args:
        selection: task and suite names, comma separated or as a sequence, e.g. `"push_box,lift_ball"`, `"all"`.

    Raises:
        UnknownTask: a name is neither a task nor a suite, or the selection is empty.
    """
    names = selection.split(",") if isinstance(selection, str) else selection
    names = [name.strip() for name in names]
    tasks, suites = list_tasks(), list_suites()
    chosen: dict[str, None] = {}
    for name in names:
        if name not in tasks and name not in suites:
            raise UnknownTask(name, (*tasks, *suites))
        chosen.update(dict.fromkeys(suites.get(name, (name,))))
    return tuple(chosen)
