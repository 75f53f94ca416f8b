"""Filters of the voxel stem that the instruction writes."""

from torch import Tensor, nn

from lerobot_policy_bimanual.nn.activation import init_linear
from lerobot_policy_bimanual.peract.voxel_grid import GRID_CHANNELS


class LanguageFilters(nn.Linear):
    """What the words add to the weights and biases of the voxel stem, sample by sample.

    A dynamic filter (De Brabandere et al., arXiv 1605.09673): "the red one" becomes a detector of red, which looks at every
    voxel. Through the latents alone a small network does not learn that from a hundred demonstrations (docs/learning.md).

    Args:
        language_dim: width of the language tokens.
        channels: channels of the stem.
    """

    def __init__(self, language_dim: int, channels: int):
        super().__init__(language_dim, channels * (GRID_CHANNELS + 1))
        self.channels = channels
        init_linear(self)

    def forward(self, input: Tensor) -> Tensor:
        """Language tokens (b, tokens, dim) to filters (b, channels, GRID_CHANNELS + 1), the bias last."""
        return super().forward(input.mean(dim=1)).unflatten(1, (self.channels, GRID_CHANNELS + 1))
