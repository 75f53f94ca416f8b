"""Load a trained policy, and a dataset that it can read, both as LeRobot loads them."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

from lerobot.configs import PreTrainedConfig
from lerobot.datasets import LeRobotDataset
from lerobot.policies.factory import get_policy_class, make_pre_post_processors
from lerobot.utils.collate import lerobot_collate_fn
from lerobot.utils.import_utils import register_third_party_plugins

from lerobot_bimanual.dataset.calibration import Calibration
from lerobot_bimanual.dataset.layout import check_features
from lerobot_bimanual.dataset.reader import read_info
from lerobot_bimanual.dataset.schema import ACTION
from lerobot_policy_bimanual.checkpoint.check import check_checkpoint
from lerobot_policy_bimanual.errors import CheckpointError
from lerobot_policy_bimanual.keypose.config import KeyposePolicyConfig
from lerobot_policy_bimanual.keypose.dataset_fit import check_label
from lerobot_policy_bimanual.keypose.observation import with_calibration
from lerobot_policy_bimanual.keypose.policy import KeyposePolicy

Batch = dict[str, Any]


def load_policy(checkpoint: Path, trusted: bool = False) -> tuple[KeyposePolicy, Callable[[Batch], Batch]]:
    """The policy of a folder `pretrained_model`, and its preprocessor, on the device that there is.

    Args:
        checkpoint: the folder.
        trusted: whether what it names may be loaded, without a check.

    Raises:
        CheckpointError: there is no checkpoint, it is damaged or not to be trusted, or its policy does not predict
            keyposes.
    """
    register_third_party_plugins()
    config = PreTrainedConfig.from_pretrained(checkpoint) if trusted else check_checkpoint(checkpoint).config
    if not isinstance(config, KeyposePolicyConfig):
        known = PreTrainedConfig.get_known_choices().items()
        fit = ", ".join(name for name, kind in known if issubclass(kind, KeyposePolicyConfig))
        raise CheckpointError(
            f"{checkpoint} holds the policy {config.type!r}, which is not built on `KeyposePolicy`, whose predictions this "
            f"command reads. Policies that are: {fit}"
        )
    if config.use_peft:
        raise CheckpointError(
            f"{checkpoint} holds an adapter, which only LeRobot's programs load: give a whole checkpoint"
        )
    # One prediction does not pay for compiling, and there may be fewer devices of its kind than in training.
    config = replace(config, compile=False, device=str(config.device).partition(":")[0])
    policy = cast(KeyposePolicy, get_policy_class(config.type).from_pretrained(checkpoint, config=config))
    overrides = {"device_processor": {"device": config.device}}
    preprocess, _ = make_pre_post_processors(
        config, pretrained_path=str(checkpoint), preprocessor_overrides=overrides
    )
    return policy, preprocess


def batch_of(dataset: LeRobotDataset, rows: Iterable[int]) -> Batch:
    """Rows as LeRobot's loaders collate them, with the calibration that holds for all rows."""
    found: list[Any] = [dataset[row] for row in rows]
    return with_calibration(
        cast(Batch, lerobot_collate_fn(found)), Calibration.of_features(dataset.meta.features)
    )


def open_dataset(root: Path) -> LeRobotDataset:
    """Open a dataset of keyposes.

    Raises:
        DatasetError: it is not such a dataset.
    """
    features = read_info(root)["features"]
    check_features(features, root)
    check_label(features[ACTION]["shape"])
    return LeRobotDataset(f"local/{root.name}", root=root)
