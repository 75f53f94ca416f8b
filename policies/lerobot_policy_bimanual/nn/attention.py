"""Pre-norm attention and feed-forward, as PerAct and RVT both use them."""

import torch.nn.functional as F  # noqa: N812
from torch import Tensor, nn


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
