"""The command `task new`."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path


@dataclass
class TaskNewConfig:
    """Flags of the command `task new`."""

    name: str = field(kw_only=True)  # of the task, such as stack_two_cups
    output: Path | None = None  # new folder; by default one of that name, here


def task_new(config: TaskNewConfig) -> None:
    """Write a distribution with a task of your own, which works as it is.

    Its one file has a block, where it stands, an expert that raises it and what counts as success; a test plays the expert.
    The task's number comes from its name. Once it is installed, every command, Gymnasium and LeRobot know it.

    Examples:
        lerobot-bimanual task new --name=raise_block
    """
    from lerobot_bimanual.errors import BimanualError
    from lerobot_bimanual.new_distribution import write_distribution
    from lerobot_bimanual.terminal import show_next
    from lerobot_env_bimanual.tasks.registry import list_tasks

    if config.name in list_tasks():
        raise BimanualError(f"a task {config.name!r} is installed already: choose another --name")
    folder = config.output or Path(config.name)
    write_distribution(Path(__file__).parents[1] / "new_task", "raise_block", config.name, folder)
    show_next("pip", "install", "--no-build-isolation", "--no-deps", "-e", folder)
