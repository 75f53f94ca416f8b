"""The command `policy check`: what a checkpoint holds, and whether it may be loaded."""

from dataclasses import dataclass, field
from pathlib import Path


@dataclass
class PolicyCheckConfig:
    """Options of the command `policy check`."""

    checkpoint: Path = field(kw_only=True)  # folder pretrained_model of a trained policy


def policy_check(config: PolicyCheckConfig) -> None:
    """Check a checkpoint before anything loads it.

    LeRobot's loader calls whatever class the processor files of a checkpoint name, and looks up what its policy and steps
    name, which may bring programs with it. This command only reads: the config and the ranges of its values, the
    processor steps with their options, and the weights, which must be finite and, for policies of this package, those of
    the network that the config describes. It prints what the checkpoint is, or says what is wrong and exits with 1. It
    exits with 3 if it cannot tell whether loading is safe: the checkpoint has a policy, step or option outside the list of
    those that load nothing by name. The message names it.

    Examples:
        lerobot-bimanual policy check --checkpoint=outputs/peract2/checkpoints/last/pretrained_model
    """
    from lerobot_bimanual.checkpoint_folder import require_checkpoint
    from lerobot_bimanual.terminal import show_next

    require_checkpoint(config.checkpoint)

    from lerobot_policy_bimanual.checkpoint.check import check_checkpoint

    found = check_checkpoint(config.checkpoint)
    print(f"{found.config.type} with {found.parameters:,} numbers, all finite")
    for file, steps in found.steps.items():
        print(f"{file}: {', '.join(steps)}")
    show_next("lerobot-bimanual", "task", "view", "--task=lift_ball", f"--checkpoint={config.checkpoint}")


def require_safe(folder: Path) -> None:
    """Check a checkpoint for a program that is about to load it, as `check_checkpoint` does."""
    from lerobot_policy_bimanual.checkpoint.check import check_checkpoint

    check_checkpoint(folder)
