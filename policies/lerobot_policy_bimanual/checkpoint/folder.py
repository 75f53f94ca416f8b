"""Where a checkpoint lies, which can be told before LeRobot and torch are imported."""

from pathlib import Path

from lerobot_policy_bimanual.errors import CheckpointError

CONFIG_FILE = "config.json"
BELOW = ("pretrained_model", "last/pretrained_model", "checkpoints/last/pretrained_model")
"""Where the checkpoint lies in folders that are taken for it."""


def require_checkpoint(folder: Path) -> None:
    """Check that a folder is one that LeRobot saves policies in.

    Raises:
        CheckpointError: it is not; the message names the folder that may be meant.
    """
    if (folder / CONFIG_FILE).is_file():
        return
    inside = [folder / path for path in BELOW if (folder / path / CONFIG_FILE).is_file()]
    advice = (
        f"Do you mean {inside[0]}?"
        if inside
        else "Give the folder `pretrained_model` of a training, as in "
        "outputs/peract2/checkpoints/last/pretrained_model"
    )
    raise CheckpointError(f"no checkpoint at {folder}: {folder / CONFIG_FILE} does not exist. {advice}")
