"""The verb `check-checkpoint`: what a checkpoint is, and whether it may be loaded."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path


@dataclass
class PolicyCheckConfig:
    """Options of the verb `check-checkpoint`."""

    checkpoint: Path = field(kw_only=True)  # folder pretrained_model of a trained policy


def policy_check(config: PolicyCheckConfig) -> None:
    """Look at a checkpoint before anything loads it.

    LeRobot's loader calls whatever class the processor files of a checkpoint name. This verb only reads: the config and
    the ranges of its values, the names of the processor steps, and the weights, which must be those of the network that
    the config describes, all of them finite. It prints what the checkpoint is, or says what is wrong and exits with 1.
    Checkpoints of LeRobot's own policies are checked as far as that goes without building them.

    Examples:
        lerobot-bimanual policy check --checkpoint=outputs/peract2/checkpoints/last/pretrained_model
    """
    from lerobot_policy_bimanual.checkpoint.folder import require_checkpoint

    require_checkpoint(config.checkpoint)

    from lerobot_policy_bimanual.checkpoint.check import policy_check as check
    from lerobot_policy_bimanual.checkpoint.summary import summary

    print(summary(check(config.checkpoint)))
