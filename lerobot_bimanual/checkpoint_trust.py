"""Whether a program may load a checkpoint: the package of policies checks it, and is not imported by name."""

import importlib
from pathlib import Path

from lerobot_bimanual.distributions import entries
from lerobot_bimanual.errors import BimanualError

CHECKER = "policy check"
"""The command whose module has a function `require_safe`."""


def require_safe(folder: Path) -> None:
    """Refuse a checkpoint that LeRobot's loader should not be given.

    Raises:
        BimanualError: it is damaged, may run a program of its own, or nothing that is installed can tell.
    """
    checker = entries("lerobot_bimanual.commands").get(CHECKER)
    if checker is None:
        raise BimanualError(
            f"nothing here can tell whether {folder} runs a program of its own: install lerobot_policy_bimanual, or, where "
            "you trust its source, give --trust_checkpoint=true"
        )
    importlib.import_module(checker.module).require_safe(folder)
