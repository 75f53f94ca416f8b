"""The verb `accuracy`: how far a policy's keyposes are from an expert's, over a dataset."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path


@dataclass
class PolicyAccuracyConfig:
    """Options of the verb `accuracy`."""

    checkpoint: Path = field(kw_only=True)  # folder pretrained_model of a trained keypose policy
    dataset: Path = field(kw_only=True)  # folder of a dataset that `generate` made, either view


def policy_accuracy(config: PolicyAccuracyConfig) -> None:
    """Measure how far a keypose policy's predictions are from the labels of a dataset.

    Prints, for each keypose of the task and each arm, the distance of the predicted hand from the expert's in
    centimetres (mean, median, 90 % quantile, worst), the angle between them, and how often the gripper or the
    collision flag is wrong. On demonstrations that were not trained on this tells what a policy cannot do yet;
    success tells whether it matters.

    Examples:
        lerobot-bimanual dataset generate --task=lift_ball --split=val --episodes=20 --view=keyframes --root=data/val
        lerobot-bimanual policy accuracy --checkpoint=outputs/peract2/checkpoints/last/pretrained_model --dataset=data/val
    """
    from lerobot_bimanual.dataset.reader import find_view
    from lerobot_policy_bimanual.checkpoint.folder import require_checkpoint

    require_checkpoint(config.checkpoint)
    find_view(config.dataset)

    from lerobot_policy_bimanual.inspection.accuracy import measure
    from lerobot_policy_bimanual.inspection.loading import load_policy, open_dataset

    policy, preprocess = load_policy(config.checkpoint)
    dataset = open_dataset(config.dataset, policy.config)
    measure(policy, preprocess, dataset).print(f"{policy.name} on {config.dataset}")
