"""What is wrong with the dataset of a training, said before anything is decoded or downloaded."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from lerobot.configs.train import TrainPipelineConfig

from lerobot_bimanual.dataset.reader import INFO_FILE, views_below
from lerobot_bimanual.dataset.schema import STATE
from lerobot_bimanual.errors import DatasetError

RGB_ONLY = ("act", "diffusion", "vqbet", "tdmpc")
"""LeRobot's policies that take every image for RGB, and end in an error about channels when one is depth."""


def load_datasets[T](cfg: TrainPipelineConfig, load: Callable[[TrainPipelineConfig], T]) -> T:
    """The datasets of a training, as LeRobot loads them.

    Args:
        cfg: of the training.
        load: LeRobot's function. Where there is no dataset, it looks for one on the Hub.

    Raises:
        DatasetError: the folder is the one above a dataset, or there is none, neither here nor on the Hub.
    """
    root, repo_id = cfg.dataset.root, cfg.dataset.repo_id
    if root is None or (Path(root) / INFO_FILE).is_file():
        return load(cfg)
    if views := views_below(Path(root)):
        raise DatasetError(
            f"--dataset.root={root} holds the views of a dataset and is none of them: give "
            f"{' or '.join(f'--dataset.root={view}' for view in views)}. Keypose policies learn from `keyframes`, "
            "policies of joint actions from `frames`"
        )
    try:
        return load(cfg)
    except Exception as error:  # whatever keeps it from the Hub: a name, the network, rights
        raise DatasetError(
            f"--dataset.root={root} is no dataset ({Path(root) / INFO_FILE} does not exist), and {repo_id} could not "
            f"be downloaded to it: {' '.join(str(error).split())}"
        ) from error


def check_inputs(cfg: TrainPipelineConfig, meta: Any) -> None:
    """Check that a policy for RGB is not given depth.

    Args:
        cfg: of the training.
        meta: LeRobot's metadata of the dataset.

    Raises:
        DatasetError: it would be; the message holds the flag that names its inputs.
    """
    policy = cfg.policy
    if policy is None or policy.type not in RGB_ONLY or policy.input_features or not meta.depth_keys:
        return
    cameras = [key for key in meta.camera_keys if key not in meta.depth_keys]
    shapes = {key: ("VISUAL", _channels_first(meta.features[key]["shape"])) for key in cameras}
    if STATE in meta.features:
        shapes[STATE] = ("STATE", list(meta.features[STATE]["shape"]))
    features = {key: {"type": kind, "shape": shape} for key, (kind, shape) in shapes.items()}
    raise DatasetError(
        f"{policy.type} takes every image for RGB, and this dataset has depth, too: name its inputs, as in "
        f"--policy.input_features='{json.dumps(features)}'"
    )


def _channels_first(shape: tuple[int, int, int]) -> list[int]:
    height, width, channels = shape
    return [channels, height, width]
