"""Layers of PerAct and RVT: LeakyReLU, attention, feed-forward, filters that depend on the instruction, marks of places."""

import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor, nn

LEAK = 0.02
"""Slope of every LeakyReLU (PerAct2 code; not PyTorch's 0.01)."""

GOAL_SIGMA = 3.0
"""Width of the mark of another arm's goal, in voxels or pixels."""


def activate(x: Tensor) -> Tensor:
    """LeakyReLU of the PerAct family, in place: callers hand over a fresh tensor."""
    return F.leaky_relu(x, LEAK, inplace=True)


def init_activated(layer: nn.Conv2d | nn.Conv3d | nn.Linear) -> None:
    """Set Kaiming-uniform weights and zero bias, for layers followed by `activate`."""
    nn.init.kaiming_uniform_(layer.weight, a=LEAK, nonlinearity="leaky_relu")
    nn.init.zeros_(layer.bias)  # type: ignore[arg-type]


def init_linear(layer: nn.Conv2d | nn.Conv3d | nn.Linear) -> None:
    """Set Xavier-uniform weights and zero bias, for layers without activation."""
    nn.init.xavier_uniform_(layer.weight)
    nn.init.zeros_(layer.bias)  # type: ignore[arg-type]


class Attention(nn.Module):
    """Pre-norm multi-head attention of `dim` queries to `context_dim` tokens, or to themselves."""

    def __init__(
        self, dim: int, *, context_dim: int | None = None, heads: int, head_dim: int, dropout: float = 0.0
    ):
        super().__init__()
        self.heads = heads
        self.dropout = dropout
        self.norm = nn.LayerNorm(dim)
        self.norm_context = None if context_dim is None else nn.LayerNorm(context_dim)
        self.query = nn.Linear(dim, heads * head_dim, bias=False)
        self.key_value = nn.Linear(context_dim or dim, 2 * heads * head_dim, bias=False)
        self.out = nn.Linear(heads * head_dim, dim)

    def forward(self, x: Tensor, context: Tensor | None = None, mask: Tensor | None = None) -> Tensor:
        """Attend, without residual.

        Args:
            x: (b, n, dim).
            context: (b, m, context_dim); `x` itself if None.
            mask: (b, m) bool, False at tokens to overlook.

        Returns:
            (b, n, dim).
        """
        x = self.norm(x)
        context = x if self.norm_context is None or context is None else self.norm_context(context)
        q, k, v = (
            t.unflatten(-1, (self.heads, -1)).transpose(1, 2)  # (b, heads, tokens, head_dim)
            for t in (self.query(x), *self.key_value(context).chunk(2, dim=-1))
        )
        attended = F.scaled_dot_product_attention(
            q,
            k,
            v,
            attn_mask=None if mask is None else mask[:, None, None, :],
            dropout_p=self.dropout if self.training else 0.0,
        )
        return self.out(attended.transpose(1, 2).flatten(2))


class FeedForward(nn.Module):
    """Pre-norm GEGLU feed-forward, without residual."""

    def __init__(self, dim: int, multiplier: int):
        super().__init__()
        self.norm = nn.LayerNorm(dim)
        self.widen = nn.Linear(dim, 2 * multiplier * dim)
        self.narrow = nn.Linear(multiplier * dim, dim)

    def forward(self, x: Tensor) -> Tensor:
        """(b, n, dim) -> (b, n, dim)."""
        value, gate = self.widen(self.norm(x)).chunk(2, dim=-1)
        return self.narrow(value * F.gelu(gate))


class Block(nn.Module):
    """Self-attention and feed-forward, each with its residual."""

    def __init__(self, dim: int, *, heads: int, multiplier: int, dropout: float):
        super().__init__()
        self.attention = Attention(dim, heads=heads, head_dim=dim // heads, dropout=dropout)
        self.feed_forward = FeedForward(dim, multiplier)

    def forward(self, x: Tensor) -> Tensor:
        """(b, n, dim) -> (b, n, dim)."""
        x = x + self.attention(x)
        return x + self.feed_forward(x)


class LanguageFilters(nn.Linear):
    """Language-conditioned filters: what an instruction adds to the weights and biases of a pointwise layer.

    A dynamic filter network (De Brabandere et al., arXiv 1605.09673): "the red item" becomes a detector of red at every
    voxel or pixel. From a hundred demonstrations a small network does not learn that through attention alone
    (docs/learning.md). From the mean (b, dim) of the language tokens it computes (b, outputs * (inputs + 1)) for a layer that
    reads `inputs` channels and writes `outputs`, the bias after each output's weights. Input and output are those of any
    linear layer, so that adapters fit.
    """

    def __init__(self, language_dim: int, inputs: int, outputs: int):
        super().__init__(language_dim, outputs * (inputs + 1))
        init_linear(self)


def gaussian_1d(index: Tensor, size: int) -> Tensor:
    """Closeness (..., size) float32 of the positions 0 to `size` - 1 of an axis to positions `index` (...).

    1 at the position itself, falling off as a Gaussian with standard deviation `GOAL_SIGMA`.
    """
    distance = torch.arange(size, device=index.device) - index[..., None]
    return torch.exp(-((distance / GOAL_SIGMA) ** 2) / 2)
