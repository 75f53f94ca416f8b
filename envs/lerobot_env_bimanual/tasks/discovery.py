"""Where tasks are found: the modules of this folder, and those that other distributions announce.

Nothing is imported here but names, so that a plugin can list its tasks without loading MuJoCo.
"""

import pkgutil
from importlib.metadata import entry_points
from pathlib import Path

TASKS_GROUP = "lerobot_bimanual.tasks"
"""Entry-point group of tasks in other distributions: `name_of_the_task = "module.that.registers_it"`."""

_FOLDER = Path(__file__).parent
_NOT_TASKS = ("discovery", "registry")


def task_modules() -> dict[str, str]:
    """Name of every task and the module that registers it; a task of this folder wins over one of its name."""
    announced = {entry.name: entry.module for entry in entry_points(group=TASKS_GROUP)}
    here = (module.name for module in pkgutil.iter_modules([str(_FOLDER)]))
    own = {
        name: f"{__package__}.{name}" for name in here if not name.startswith("_") and name not in _NOT_TASKS
    }
    return announced | own
