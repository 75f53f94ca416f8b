"""Perceiver IO: a few latents read a long sequence, think, and answer one query per token."""

import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor, nn

CROSS_HEAD_DIM = 64
"""Both cross-attentions have a single head of this width (PerAct2 code)."""


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


class PerceiverIO(nn.Module):
    """The trunk: one stream of latents per arm, which meet in one last block.

    All latents read the input together. They are then split evenly among the streams, each with weights of
    its own. With two or more streams a last block runs over all latents; it is the only place after the
    reading where the arms talk. With one stream it is left out, which is the single-arm PerAct.
    """

    def __init__(
        self,
        *,
        streams: int,
        token_dim: int,
        num_latents: int,
        latent_dim: int,
        depth: int,
        heads: int,
        multiplier: int,
        dropout: float,
    ):
        super().__init__()
        # Standard deviation 1, not the usual 0.02: the decoder has no residual, and small codes leave it
        # unable to tell its queries apart (design study: 44 cm against 8 cm of error after equal steps).
        self.latents = nn.Parameter(torch.randn(num_latents, latent_dim))
        self.read = Attention(
            latent_dim, context_dim=token_dim, heads=1, head_dim=CROSS_HEAD_DIM, dropout=dropout
        )
        self.read_feed_forward = nn.ModuleList(FeedForward(latent_dim, multiplier) for _ in range(streams))

        def block() -> Block:
            return Block(latent_dim, heads=heads, multiplier=multiplier, dropout=dropout)

        self.streams = nn.ModuleList(nn.Sequential(*(block() for _ in range(depth))) for _ in range(streams))
        self.combine = block() if streams > 1 else nn.Identity()
        self.answer = nn.ModuleList(
            Attention(token_dim, context_dim=latent_dim, heads=1, head_dim=CROSS_HEAD_DIM)
            for _ in range(streams)
        )

    def forward(self, tokens: Tensor, queries: Tensor) -> Tensor:
        """Read `tokens` (b, t, token_dim), answer `queries` (b, q, token_dim): (b, streams, q, token_dim)."""
        latents = self.latents.expand(len(tokens), -1, -1)
        latents = latents + self.read(latents, tokens)
        parts = []
        for part, feed_forward, stream in zip(
            latents.chunk(len(self.streams), dim=1), self.read_feed_forward, self.streams, strict=True
        ):
            parts.append(stream(part + feed_forward(part)))
        parts = self.combine(torch.cat(parts, dim=1)).chunk(len(self.streams), dim=1)
        answers = [answer(queries, part) for answer, part in zip(self.answer, parts, strict=True)]
        return torch.stack(answers, dim=1)
