"""What `policies.py` measures as a whole: the network beside its written-out formulation, and whole policies.

A job is made once and called as often as it is timed. It runs forward, and backward too where gradients are on.
"""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, cast

import draccus
import numpy as np
import torch
import torch.nn.functional as F  # noqa: N812
from lerobot.configs import PreTrainedConfig
from lerobot.policies.factory import get_policy_class
from torch import Tensor

from lerobot_bimanual.benchmark.recipe import Recipe
from lerobot_bimanual.cameras import CAMERA_NAMES, intrinsics_from_fovy
from lerobot_bimanual.dataset import schema
from lerobot_bimanual.geometry.workspace import VOXEL_WORKSPACE
from lerobot_policy_bimanual import PerAct2Config
from lerobot_policy_bimanual.peract import reference
from lerobot_policy_bimanual.peract.dense_head import DenseTranslation
from lerobot_policy_bimanual.peract.network import PerActNetwork
from lerobot_policy_bimanual.peract.voxel_grid import voxelise
from lerobot_policy_bimanual.peract2.modeling_peract2 import PerAct2Policy

EPISODE_KEYPOSES = 7
"""Of the made-up episodes; no time depends on it."""

Job = Callable[[], object]


@dataclass(frozen=True)
class Setting:
    """Sizes and circumstances of a measurement."""

    voxels: int
    batch: int
    device: str
    backward: bool


def surfaces(samples: int, image_size: int, device: str) -> Tensor:
    """Points (b, 3, 5 h w) in pixel order on wavy sheets, as five cameras would see them; six voxels in a hundred."""
    line = torch.linspace(-0.1, 1.2, image_size)
    x, y = torch.meshgrid(line, line, indexing="ij")
    sheets = [
        torch.stack([x, y, 0.1 + 0.1 * i + 0.05 * torch.sin(20 * x + i) * torch.cos(15 * y)])
        for i in range(5)
    ]
    corner = torch.tensor(VOXEL_WORKSPACE.lower)[:, None]
    return (
        (torch.cat([sheet.flatten(1) for sheet in sheets], dim=1) + corner).expand(samples, -1, -1).to(device)
    )


def make_network(setting: Setting, **options: Any) -> tuple[PerAct2Config, PerActNetwork]:
    """The full-size network, without dropout."""
    config = PerAct2Config(
        device=setting.device, voxel_size=setting.voxels, keypose_horizon=EPISODE_KEYPOSES + 1, **options
    )
    return config, cast(PerActNetwork, PerAct2Policy(config).network.eval().to(setting.device))


def index_loss(translation: Tensor, pose: Tensor, voxel: Tensor, classes: Tensor) -> Tensor:
    """What `reference.one_hot_loss` computes, by the translation's own loss and from indices."""
    loss = DenseTranslation(translation).cross_entropy(voxel).sum(1).mean()
    bins = (pose.shape[-1] - 4) // 3
    for logits, target in zip(pose.split([bins] * 3 + [2, 2], dim=-1), classes.unbind(-1), strict=True):
        loss = loss + pose.shape[1] * F.cross_entropy(logits.flatten(0, 1), target.flatten())
    return loss


def network_job(variant: str, setting: Setting) -> Job:
    """The whole network and its loss, as one of `policies.VARIANTS`."""
    options = {"checkpointing": {"activation_checkpointing": True}, "compile": {"compile": True}}
    config, network = make_network(setting, **options.get(variant, {}))
    B, V, device = setting.batch, setting.voxels, setting.device  # noqa: N806
    cloud = surfaces(B, 128, device)
    grid = voxelise(cloud, cloud, workspace=VOXEL_WORKSPACE, voxels=V)
    proprio = torch.rand(B, 8, device=device)
    language = torch.randn(B, config.language_tokens, config.language_dim, device=device)
    voxel = torch.full((B, 2, 3), V // 2, device=device)
    classes = torch.ones(B, 2, 5, dtype=torch.long, device=device)

    def job() -> None:
        if variant == "written_out":
            p = dict(network.named_parameters())
            outputs = reference.network(p, grid, proprio, language, arms=2, heads=config.heads)
            loss = reference.one_hot_loss(*outputs, voxel, classes)
        else:
            with torch.autocast(device, torch.bfloat16, enabled=variant == "bfloat16"):
                prediction = network(grid, proprio, language)
            parts = (prediction.rotation.flatten(2), prediction.gripper_open, prediction.ignore_collisions)
            translation: Any = prediction.translation
            loss = index_loss(translation.logits, torch.cat(parts, dim=-1), voxel, classes)
        if setting.backward:
            loss.backward()

    return job


def small_flags(policy_type: str) -> dict[str, str]:
    """What the small recipe of a policy says about its config, by name."""
    section = Recipe.find(policy_type, "small").sections["policy"]
    return {name: json.dumps(value) for name, value in section.items() if name != "type"}


def policy_job(policy_type: str, flags: Mapping[str, str], setting: Setting) -> Job:
    """A whole policy on five 128 px cameras: one optimiser step, or one `select_action` without gradients."""
    config = draccus.parse(
        PreTrainedConfig.get_choice_class(policy_type),
        args=[f"--device={setting.device}", *(f"--{option}={value}" for option, value in flags.items())],
    )
    stats = {schema.KEYPOSE_STEP: {"max": EPISODE_KEYPOSES}}
    policy: Any = get_policy_class(policy_type)(config, dataset_stats=stats).to(setting.device)
    batch = {
        key: value.to(setting.device) if isinstance(value, Tensor) else value
        for key, value in random_batch(setting.batch, 128).items()
    }
    if not setting.backward:
        return lambda: policy.select_action(batch)
    policy.train()
    optimizer = cast(Any, config.get_optimizer_preset()).build(policy.get_optim_params())

    def step() -> None:
        loss, _ = policy(batch)
        optimizer.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(policy.parameters(), config.optimizer_grad_clip_norm)
        optimizer.step()

    return step


def random_batch(samples: int, image_size: int) -> dict[str, Any]:
    """Five cameras looking down on noise, with labels."""
    batch: dict[str, Any] = {"task": ["lift the ball"] * samples}
    for camera in CAMERA_NAMES:
        batch[schema.image_key(camera)] = torch.rand(samples, 3, image_size, image_size)
        batch[schema.depth_key(camera)] = 500 + 1500 * torch.rand(samples, 1, image_size, image_size)
    pose = torch.tensor([[0.0, -1, 0, 0.2], [-1, 0, 0, 0], [0, 0, -1, 2.0], [0, 0, 0, 1]])
    batch[schema.CAMERA_EXTRINSICS] = pose.repeat(samples, 5, 1, 1).flatten(1)
    intrinsics = torch.tensor(intrinsics_from_fovy(np.pi / 3, image_size, image_size)).float()
    batch[schema.CAMERA_INTRINSICS] = intrinsics.repeat(samples, 5, 1, 1).flatten(1)
    batch[schema.STATE] = torch.rand(samples, 16)
    batch[schema.GRIPPER_FINGERS] = 0.04 * torch.rand(samples, 4)
    batch[schema.KEYPOSE_STEP] = torch.zeros(samples, 1)
    batch[schema.NEXT_KEYPOSE] = torch.tensor([0.2, 0.1, 1, 0, 1, 0, 0, 1, 0] * 2).repeat(samples, 1)
    return batch
