"""Convolutions that see far across flat views of the voxel features."""

from collections.abc import Sequence

import torch.nn.functional as F  # noqa: N812
from torch import Tensor, nn

from lerobot_policy_bimanual.nn.activation import LEAK


class ProjectionConv2d(nn.Conv2d):
    """A 3 x 3 convolution, and dilated ones that add what lies further away.

    Every layer reaches as many voxels further as its dilation. With 3 and 9 after the first one any place up to 13
    voxels away on either side is reached, each in one way: half of a grid of 25.

    Args:
        channels: channels of the projections.
        width: channels of what is made of them.
        dilations: of the layers after the first; none for the 3 x 3 convolution alone.
    """

    def __init__(self, channels: int, width: int, dilations: Sequence[int]):
        super().__init__(channels, width, 3, padding=1)
        self.far = nn.ModuleList(
            nn.Conv2d(width, width, 3, padding=dilation, dilation=dilation) for dilation in dilations
        )

    def forward(self, input: Tensor) -> Tensor:
        """(b, channels, v, v) to (b, width, v, v)."""
        features = super().forward(input)
        for layer in self.far:
            features = features + layer(F.leaky_relu(features, LEAK))
        return features
