"""The command `policy accuracy`: how far a policy's keyposes are from an expert's, over a dataset."""

from dataclasses import dataclass, field
from pathlib import Path


@dataclass
class PolicyAccuracyConfig:
    """Options of the command `policy accuracy`."""

    checkpoint: Path = field(kw_only=True)  # folder pretrained_model of a trained keypose policy
    root: Path = field(kw_only=True)  # folder of a dataset that `dataset generate` made, view `keyframes`
    trust_checkpoint: bool = False  # load what the checkpoint names, without `policy check`


def policy_accuracy(config: PolicyAccuracyConfig) -> None:
    """Measure how far a keypose policy's predictions are from the labels of a dataset.

    Prints, for each keypose of the task and each arm, the distance of the predicted hand from the expert's in
    centimetres (mean, median, 90 % quantile, worst), the angle between them, and how often the gripper or the
    collision flag is wrong. On demonstrations that were not trained on (split `val`), it shows what a policy cannot predict yet;
    only the success rate tells whether that matters.

    Examples:
        lerobot-bimanual dataset generate --task=lift_ball --split=val --episodes=20 --view=keyframes --root=data/val
        lerobot-bimanual policy accuracy --checkpoint=outputs/peract2/checkpoints/last/pretrained_model --root=data/val
    """
    from lerobot_bimanual.checkpoint_folder import require_checkpoint
    from lerobot_bimanual.dataset.reader import RecordedDataset, find_view
    from lerobot_bimanual.terminal import print_table, show_next

    require_checkpoint(config.checkpoint)
    folder = find_view(config.root, ("keyframes", "frames"))

    from lerobot_policy_bimanual.inspection.accuracy import measure, summary
    from lerobot_policy_bimanual.inspection.loading import load_policy, open_dataset

    policy, preprocess = load_policy(config.checkpoint, config.trust_checkpoint)
    dataset = open_dataset(folder)
    table = summary(measure(policy, preprocess, dataset))
    recorded = RecordedDataset(folder).provenance
    split = f", split {recorded.settings.get('split')}" if recorded else ""
    legend = "after: keyposes before; gripper, flag: share that is wrong"
    print_table(table, f"{policy.name} on {config.root}{split}; {legend}")
    paths = (f"--checkpoint={config.checkpoint}", f"--root={config.root}")
    show_next("lerobot-bimanual", "policy", "inspect", *paths)
