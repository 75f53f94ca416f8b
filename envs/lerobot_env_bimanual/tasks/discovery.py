"""Where tasks are found: the modules of this folder, and those that other distributions announce.

Nothing is imported here but names, so that a plugin can list its tasks without loading MuJoCo.
"""

import functools
import pkgutil
from pathlib import Path

from lerobot_bimanual.distributions import entries

TASKS_GROUP = "lerobot_bimanual.tasks"
"""Entry-point group of tasks in other distributions: `name_of_the_task = "module.that.registers_it"`."""

_FOLDER = Path(__file__).parent
_NOT_TASKS = ("discovery", "registry")


@functools.cache
def task_modules() -> dict[str, str]:
    """Name of every task and the module that registers it; a task of this folder wins over one of its name."""
    announced = {name: entry.module for name, entry in entries(TASKS_GROUP).items()}
    here = (module.name for module in pkgutil.iter_modules([str(_FOLDER)]))
    own = {
        name: f"{__package__}.{name}" for name in here if not name.startswith("_") and name not in _NOT_TASKS
    }
    return announced | own
