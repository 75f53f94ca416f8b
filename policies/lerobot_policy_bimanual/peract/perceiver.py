"""Perceiver IO: a few latents read a long sequence, think, and answer one query per token."""

import torch
from torch import Tensor, nn

from lerobot_policy_bimanual.nn.attention import Attention, Block, FeedForward
from lerobot_policy_bimanual.peract.config import PerActConfig

CROSS_HEAD_DIM = 64
"""Both cross-attentions have a single head of this width (PerAct2 code)."""


class PerceiverIO(nn.Module):
    """The trunk: one stream of latents per arm, which meet in one last block.

    All latents read the input together. They are then split evenly among the streams, each with weights of
    its own. With two or more streams a last block runs over all latents; it is the only place after the
    reading where the arms talk. With one stream it is left out, which is the single-arm PerAct.
    """

    def __init__(self, config: PerActConfig, *, streams: int):
        super().__init__()
        dim, token_dim, dropout = config.latent_dim, config.token_dim, config.attention_dropout
        # Standard deviation 1, not the usual 0.02: the decoder has no residual, and small codes leave it
        # unable to tell its queries apart.
        self.latents = nn.Parameter(torch.randn(config.num_latents, dim))
        self.read = Attention(dim, context_dim=token_dim, heads=1, head_dim=CROSS_HEAD_DIM, dropout=dropout)
        self.read_feed_forward = nn.ModuleList(
            FeedForward(dim, config.feedforward_multiplier) for _ in range(streams)
        )

        def block() -> Block:
            return Block(dim, heads=config.heads, multiplier=config.feedforward_multiplier, dropout=dropout)

        self.streams = nn.ModuleList(
            nn.Sequential(*(block() for _ in range(config.depth))) for _ in range(streams)
        )
        self.combine = block() if streams > 1 else nn.Identity()
        self.answer = nn.ModuleList(
            Attention(token_dim, context_dim=dim, heads=1, head_dim=CROSS_HEAD_DIM) for _ in range(streams)
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
