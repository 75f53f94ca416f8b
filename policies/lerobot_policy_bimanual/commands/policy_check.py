"""The command `policy check`: what a checkpoint holds, and whether it may be loaded."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path


@dataclass
class PolicyCheckConfig:
    """Options of the command `policy check`."""

    checkpoint: Path = field(kw_only=True)  # folder pretrained_model of a trained policy


def policy_check(config: PolicyCheckConfig) -> None:
    """Check a checkpoint before anything loads it.

    LeRobot's loader calls whatever class the processor files of a checkpoint name. This command only reads: the config
    and the ranges of its values, the names of the processor steps, and the weights, which must be finite and, for
    policies of this package, those of the network that the config describes. It prints what the checkpoint is, or says
    what is wrong and exits with 1.

    Examples:
        lerobot-bimanual policy check --checkpoint=outputs/peract2/checkpoints/last/pretrained_model
    """
    from lerobot_bimanual.terminal import show_next
    from lerobot_policy_bimanual.checkpoint.folder import require_checkpoint

    require_checkpoint(config.checkpoint)

    from lerobot_policy_bimanual.checkpoint.check import check_checkpoint

    found = check_checkpoint(config.checkpoint)
    print(f"{found.config.type} with {found.parameters:,} numbers, all finite")
    for file, steps in found.steps.items():
        print(f"{file}: {', '.join(steps)}")
    show_next("lerobot-bimanual", "task", "view", "--task=lift_ball", f"--checkpoint={config.checkpoint}")
