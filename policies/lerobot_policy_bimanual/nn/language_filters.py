"""Filters of a network's first layer that the instruction writes."""

from torch import Tensor, nn

from lerobot_policy_bimanual.nn.activation import init_linear


class LanguageFilters(nn.Linear):
    """What the words add to the weights and biases of a layer that looks at single voxels or pixels, sample by sample.

    A dynamic filter (De Brabandere et al., arXiv 1605.09673): "the red item" becomes a detector of red, which looks
    everywhere. That through attention alone a small network does not learn from a hundred demonstrations
    (docs/learning.md).

    Args:
        language_dim: width of the language tokens.
        inputs: channels that the layer reads.
        outputs: channels that it writes.
    """

    def __init__(self, language_dim: int, inputs: int, outputs: int):
        super().__init__(language_dim, outputs * (inputs + 1))
        self.shape = (outputs, inputs + 1)
        init_linear(self)

    def forward(self, input: Tensor) -> Tensor:
        """Language tokens (b, tokens, dim) to filters (b, outputs, inputs + 1), the bias last."""
        return super().forward(input.mean(dim=1)).unflatten(1, self.shape)
