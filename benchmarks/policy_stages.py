"""The stages of PerAct2 that `policies.py` measures, each beside its written-out formulation."""

from collections.abc import Callable
from typing import Any

import torch
from policy_jobs import Job, Setting, index_loss, make_network, surfaces
from torch import Tensor

from lerobot_bimanual.geometry.workspace import VOXEL_WORKSPACE
from lerobot_policy_bimanual.peract import reference
from lerobot_policy_bimanual.peract.config import PATCH
from lerobot_policy_bimanual.peract.pooling import pool
from lerobot_policy_bimanual.peract.voxel_grid import voxelise

TITLES = {
    "voxelise": "points to voxels, five 256 px cameras",
    "tokens": "stem and patches",
    "perceiver": "perceiver",
    "upsample": "upsampling convolution, one arm",
    "skip": "skip convolution, both arms",
    "logits": "logits, one arm",
    "pool": "pooling, one map",
    "loss": "loss, both arms",
}
"""Of each method of `Stages`."""

Function = Callable[..., Tensor]
Compared = tuple[Job, Job | None]
"""Ours, and the written-out formulation where there is one."""


class Stages:
    """Makes the jobs of single stages of the full-size network."""

    def __init__(self, setting: Setting):
        self._setting = setting
        self._config, self._network = make_network(setting)
        self._parameters = dict(self._network.named_parameters())
        self._head: Any = self._network.translation

    def voxelise(self) -> Compared:
        """Where five cameras see something."""
        cloud = surfaces(self._setting.batch, 256, self._setting.device)
        return lambda: voxelise(cloud, cloud, workspace=VOXEL_WORKSPACE, voxels=self._setting.voxels), None

    def tokens(self) -> Compared:
        """From the voxel grid."""
        network, leaky, conv = self._network, reference.leaky, reference.conv

        def written(grid: Tensor) -> Tensor:
            stem = leaky(conv(grid, *self._weights("stem.conv")))
            return leaky(conv(stem, *self._weights("patchify.conv"), stride=5, padding=2))

        return self._compare(lambda grid: network.patchify(network.stem(grid)), written, self._volume(10))

    def perceiver(self) -> Compared:
        """From all tokens to the answers for the patches."""
        words, heads = self._config.language_tokens, self._config.heads
        patches = (self._setting.voxels // PATCH) ** 3
        tokens = torch.randn(self._setting.batch, words + patches, self._config.token_dim)
        return self._compare(
            lambda x: self._network.perceiver(x, x[:, words:]),
            lambda x: torch.stack(reference.trunk(self._parameters, x, 2, heads)),
            tokens.to(self._setting.device),
        )

    def upsample(self) -> Compared:
        """From patches to voxels."""
        upsample, weights = self._head.upsample, self._weights("translation.upsample.conv")
        return self._compare(
            lambda x: upsample(x, upsample.kernel()),
            lambda x: reference.upsampled_conv(x, *weights),
            self._volume(self._config.channels, self._setting.voxels // PATCH),
        )

    def skip(self) -> Compared:
        """The join with the stem."""
        join, weights = self._head.join, self._weights("translation.join.conv")

        def ours(stem: Tensor, *fine: Tensor) -> Tensor:
            half = join.skip_half(stem)
            return torch.stack([join(half, x) for x in fine])

        def written(stem: Tensor, *fine: Tensor) -> Tensor:
            joined = [reference.conv(torch.cat([stem, x], dim=1), *weights) for x in fine]
            return torch.stack([reference.leaky(x) for x in joined])

        channels, border = self._config.channels, 2  # our upsampling brings the border along
        stem = self._volume(channels)
        bordered = [self._volume(channels, self._setting.voxels + border) for _ in range(2)]
        plain = [self._volume(channels) for _ in range(2)]
        return self._job(ours, stem, *bordered), self._job(written, *_channels_first(stem, *plain))

    def logits(self) -> Compared:
        """One number per voxel."""
        weights = self._weights("translation.logits.0")
        voxels = self._volume(self._config.channels)
        return self._compare(self._head.logits[0], lambda x: reference.conv(x, *weights), voxels)

    def pool(self) -> Compared:
        """Spatial softmax and maximum."""
        return self._compare(pool, reference.pool, self._volume(self._config.channels))

    def loss(self) -> Compared:
        """Cross-entropies of voxel and pose."""
        batch, size, device = self._setting.batch, self._setting.voxels, self._setting.device
        voxel = torch.full((batch, 2, 3), size // 2, device=device)
        classes = torch.ones(batch, 2, 5, dtype=torch.long, device=device)
        logits = torch.randn(batch, 2, size, size, size, device=device)
        return self._compare(
            lambda x, y: index_loss(x, y, voxel, classes),
            lambda x, y: reference.one_hot_loss(x, y, voxel, classes),
            logits,
            torch.randn(batch, 2, 220, device=device),
        )

    def _weights(self, name: str) -> tuple[Tensor, Tensor]:
        return self._parameters[f"{name}.weight"], self._parameters[f"{name}.bias"]

    def _volume(self, channels: int, size: int | None = None) -> Tensor:
        """A random map with its channels last in memory, as ours are."""
        size = size or self._setting.voxels
        x = torch.randn(self._setting.batch, channels, size, size, size, device=self._setting.device)
        return x.to(memory_format=torch.channels_last_3d)

    def _compare(self, ours: Function, written: Function, *inputs: Tensor) -> Compared:
        return self._job(ours, *inputs), self._job(written, *_channels_first(*inputs))

    def _job(self, function: Function, *inputs: Tensor) -> Job:
        """Forward, and backward to the inputs and all parameters if that is measured."""
        backward = self._setting.backward

        def job() -> None:
            output = function(*(x.detach().requires_grad_(backward) for x in inputs))
            if backward:
                output.backward(torch.ones_like(output))

        return job


def _channels_first(*maps: Tensor) -> list[Tensor]:
    """As the written-out formulation has them."""
    return [x.contiguous() for x in maps]
