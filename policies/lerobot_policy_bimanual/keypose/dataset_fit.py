"""Sets config fields from the dataset, and compares checkpoint, config and dataset in one place for every program.

docs/policies.md has a table. `ObservationCheck` and `forward` report what a batch lacks: until then LeRobot may rename keys.
"""

import logging
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from lerobot.configs import FeatureType, PreTrainedConfig
from lerobot.utils.feature_utils import dataset_to_policy_features

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.dataset.provenance import Provenance
from lerobot_bimanual.dataset.schema import ACTION, KEYPOSE_STEP
from lerobot_bimanual.errors import DatasetError
from lerobot_bimanual.keypose_layout import ARM_KEYPOSE_DIM, KEYPOSE_DIM, POSITION
from lerobot_policy_bimanual.errors import BadConfig
from lerobot_policy_bimanual.keypose.config import KeyposePolicyConfig
from lerobot_policy_bimanual.keypose.fields import check_fields

CODE_HORIZON = 25
"""`keypose_horizon` of PerAct2's code, for all tasks."""

FIELDS_FIXED_BY_TRAINING = (
    *("workspace_lower", "workspace_upper", "use_keypose_step", "keypose_horizon"),
    *("voxel_size", "heads", "leader", "point_radius", "projection_dilations"),
    *("heatmap_dilations", "heatmap_fusion", "fine_stage_zoom"),
)
"""Fields on which the meaning of weights depends; loading compares those that give them their shapes."""

_log = logging.getLogger(__name__)


def compare_with_checkpoint(config: PreTrainedConfig, trained: PreTrainedConfig, origin: object) -> None:
    """Compare the config that a checkpoint is loaded with, flags included, with the one that it was saved with.

    Raises:
        BadConfig: a field among `FIELDS_FIXED_BY_TRAINING` differs.
    """
    for name in FIELDS_FIXED_BY_TRAINING:
        values = (getattr(each, name, None) for each in (config, trained))
        found, wanted = (tuple(value) if isinstance(value, list) else value for value in values)
        if found != wanted:
            raise BadConfig(
                f"{name} is {found}, but {origin} was trained with {wanted}: leave out --policy.{name}, give the checkpoint by "
                "--policy.path, which brings its config, or train anew"
            )


def check_label(shape: Sequence[int]) -> None:
    """Refuse actions of another shape than a keypose.

    Raises:
        DatasetError: the shape is different.
    """
    if tuple(shape) != (KEYPOSE_DIM,):
        raise DatasetError(
            f"the column {ACTION} has the shape {tuple(shape)}, but keypose policies learn from the next keypose, "
            f"{KEYPOSE_DIM} numbers: give them the view `keyframes`"
        )


def fit_config(config: KeyposePolicyConfig, meta: Any, stats: Mapping[str, Mapping[str, Any]] | None) -> None:
    """Set the fields of a config that follow from the training dataset, and warn where config and dataset do not fit.

    Args:
        config: of the policy that is made.
        meta: LeRobot's metadata of the dataset; None where nothing is trained.
        stats: the dataset's statistics; without them an unset `keypose_horizon` becomes that of PerAct2's code.

    Raises:
        BadConfig: the horizon is unset, and the statistics do not tell it.
        DatasetError: as in `check_label`.
        BadRecord: the dataset's provenance is damaged.
    """
    if meta is not None:
        check_label(meta.features.get(ACTION, {}).get("shape", ()))
        config.trained_instructions = () if meta.tasks is None else tuple(map(str, meta.tasks.index))
        provenance = Provenance.of_dataset(Path(meta.root))
        config.trained_worlds = {} if provenance is None else provenance.worlds
        before = config.input_features or {}
        stored = {
            key: each
            for key, each in dataset_to_policy_features(meta.features).items()
            if key in config.observation_keys and each.type is FeatureType.VISUAL
        }
        for key in sorted(stored.keys() & before.keys()):
            if (here := tuple(stored[key].shape)) != (trained := tuple(before[key].shape)):
                _log.warning(
                    f"images of this dataset differ from those of the policy's training: {key} is {here}, not {trained}"
                )
                break  # the others differ likewise
        config.input_features = before and before | stored  # a further camera is one more part of the cloud
    max_step = CODE_HORIZON - 1 if stats is None else np.max(stats.get(KEYPOSE_STEP, {}).get("max", np.nan))
    if not config.use_keypose_step:
        pass
    elif config.keypose_horizon is None:
        if not np.isfinite(max_step):
            raise BadConfig(
                f"keypose_horizon is not set, and the dataset's statistics have no largest {KEYPOSE_STEP} to compute it from: "
                "set --policy.keypose_horizon"
            )
        config.keypose_horizon = max(2, 1 + round(float(max_step)))
        check_fields(config)
    elif stats is not None and max_step >= config.keypose_horizon:
        _log.warning(
            f"this dataset has episodes of {max_step:.0f} keyposes, but the policy distinguishes only {config.keypose_horizon} "
            "(keypose_horizon)"
        )
    if stats and ACTION in stats:
        lower, upper = (
            np.reshape(stats[ACTION][bound], (len(ARMS), ARM_KEYPOSE_DIM))[:, POSITION]
            for bound in ("min", "max")
        )
        if (lower < config.workspace_lower).any() or (upper > config.workspace_upper).any():
            _log.warning(
                f"keyposes of this dataset reach from {lower.min(0).round(3)} to {upper.max(0).round(3)}, beyond the "
                f"workspace from {config.workspace_lower} to {config.workspace_upper} m: none outside can be predicted"
            )
