"""Find the folder of a checkpoint, without importing LeRobot and torch."""

from pathlib import Path
from shlex import quote

from lerobot_bimanual.errors import BimanualError

CONFIG_FILE = "config.json"
TRAIN_CONFIG_FILE = "train_config.json"
CHECKPOINT_SUBFOLDERS = ("pretrained_model", "last/pretrained_model", "checkpoints/last/pretrained_model")
"""Paths of a checkpoint below folders of a training that users may give instead of the checkpoint."""


def require_checkpoint(folder: Path) -> None:
    """Refuse a folder in which LeRobot has saved no policy; the error names the one that may be meant."""
    if (folder / CONFIG_FILE).is_file():
        return
    inside = [folder / path for path in CHECKPOINT_SUBFOLDERS if (folder / path / CONFIG_FILE).is_file()]
    advice = (
        f"Do you mean {inside[0]}?"
        if inside
        else "Give the folder `pretrained_model` of a training, as in "
        "outputs/peract2/checkpoints/last/pretrained_model"
    )
    raise BimanualError(f"no checkpoint at {folder}: {folder / CONFIG_FILE} does not exist. {advice}")


def require_checkpoint_if_local(path: str) -> None:
    """Call `require_checkpoint`, unless the path can only be `owner/name` on the Hub; LeRobot accepts that or a folder."""
    if Path(path).parent.is_dir() or path.count("/") != 1:
        require_checkpoint(Path(path))


def how_to_resume(training: Path) -> str:
    """The part of a message that says how to resume the training in this folder."""
    config = next(
        filter(Path.is_file, (training / path / TRAIN_CONFIG_FILE for path in CHECKPOINT_SUBFOLDERS)), None
    )
    if config is None:
        return f"there is no checkpoint at {training / CHECKPOINT_SUBFOLDERS[-1]}"
    return f"to go on from the last checkpoint give {quote(f'--config_path={config}')} --resume=true"
