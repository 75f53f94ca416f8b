"""What a checked checkpoint is, in a few lines."""

from lerobot_policy_bimanual.checkpoint.check import CheckedCheckpoint
from lerobot_policy_bimanual.keypose.config import LEARNED_LANGUAGE, KeyposePolicyConfig

OWN = "config, its ranges, processor steps and their options, names, shapes, types and values of all weights"
LEROBOTS = "config, names of processor steps (all LeRobot's own), values of all weights (finite)"


def summary(checkpoint: CheckedCheckpoint) -> str:
    """Lines for a person: what it is, what was checked, and what was not."""
    config, weights = checkpoint.config, checkpoint.weights
    lines = {
        "policy": config.type,
        "weights": f"{weights.parameters:,} numbers in {weights.tensors} tensors, {' and '.join(weights.dtypes)}",
    }
    if isinstance(config, KeyposePolicyConfig):
        time = f"{config.keypose_horizon} keyposes" if config.use_keypose_step else "no count of keyposes"
        lines["sizes"] = f"{config.voxel_size} voxels per axis, {time}"
        lines["cameras"] = ", ".join(config.cameras)
        unchecked = ""
        if config.language_encoder != LEARNED_LANGUAGE:
            unchecked = f"{config.language_encoder}, a text tower that is loaded beside the checkpoint"
    else:
        lines["cameras"] = ", ".join(config.image_features) or "none"
        unchecked = (
            "whether the weights fit the network, the options of the steps; what else the policy downloads"
        )
    lines |= {file.removesuffix(".json"): ", ".join(steps) for file, steps in checkpoint.steps.items()}
    lines["checked"] = OWN if isinstance(config, KeyposePolicyConfig) else LEROBOTS
    if unchecked:
        lines["not checked"] = unchecked
    width = max(map(len, lines)) + 2
    return "\n".join(f"{what:<{width}}{text}" for what, text in lines.items())
