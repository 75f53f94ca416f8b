"""Checks the dataset folder of a training before LeRobot and torch are imported."""

from collections.abc import Sequence
from pathlib import Path

from lerobot_bimanual.dataset.calibration import Calibration
from lerobot_bimanual.dataset.provenance import Provenance, check_version
from lerobot_bimanual.dataset.reader import INFO_FILE, missing_dataset_error, read_info, views_below
from lerobot_bimanual.errors import DatasetError


def check_dataset(root: Path, episodes: Sequence[int] = (0,)) -> None:
    """Refuse a folder without the dataset of a training, for which LeRobot would then look on the Hub.

    Args:
        root: the folder.
        episodes: some episodes that it must have.

    Raises:
        DatasetError: the folder is the one above the views, or has no dataset, or one that lacks some of `episodes`, is of
            another schema, or has a damaged calibration.
        BadRecord: its provenance is damaged.
    """
    if views := views_below(root):
        raise DatasetError(
            f"--dataset.root={root} holds the views of a dataset, but must be one of them: give "
            f"{' or '.join(f'--dataset.root={view}' for view in views)}. Keypose policies learn from `keyframes`, "
            "policies of joint actions from `frames`"
        )
    if not (root / INFO_FILE).is_file():
        raise missing_dataset_error(
            root, "--dataset.root", ". To train on one of the Hub, leave out --dataset.root"
        )
    info = read_info(root)
    features = info["features"]
    check_version(features, root)
    Provenance.of_dataset(root)
    Calibration.of_features(features)
    total = info["total_episodes"]
    if outside := [number for number in episodes if not 0 <= number < total]:
        raise DatasetError(f"{root} has episodes 0 to {total - 1}, but --dataset.episodes names {outside[0]}")
