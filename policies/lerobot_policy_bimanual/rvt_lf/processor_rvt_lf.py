"""Pre- and post-processing of RVT-LF: LeRobot's standard steps; the geometry happens in the policy."""

from typing import Any

import torch
from lerobot.processor import PolicyAction, PolicyProcessorPipeline, make_default_pre_post_processors

from lerobot_policy_bimanual.rvt_lf.configuration_rvt_lf import RVTLFConfig


def make_rvt_lf_pre_post_processors(
    config: RVTLFConfig, dataset_stats: dict[str, dict[str, torch.Tensor]] | None = None
) -> tuple[
    PolicyProcessorPipeline[dict[str, Any], dict[str, Any]],
    PolicyProcessorPipeline[PolicyAction, PolicyAction],
]:
    """Rename, batch and move to the device; bring the keypose back to the CPU. Nothing is normalised."""
    return make_default_pre_post_processors(config, dataset_stats)
