"""The language encoder that is trained with the policy; `clip` has the paper's, `wordllama` words of a package."""

import re
import zlib

import torch
from torch import Tensor, nn
from torch.nn.utils.rnn import pad_sequence

from lerobot_policy_bimanual.nn.layers import Attention, FeedForward

BUCKETS = 2048
"""Word slots; the instructions of the benchmark use about a hundred words, so few share a slot."""

WORD_DIM = 128
MAX_WORDS = 77
"""Words read of an instruction; the context length of CLIP."""

START = 0


class LearnedLanguage(nn.Module):
    """Hashed words, read by a fixed number of learned queries. Needs no download and no vocabulary."""

    def __init__(self, *, tokens: int, dim: int):
        super().__init__()
        self._add_words()
        self.queries = nn.Parameter(torch.randn(tokens, WORD_DIM))
        self.read = Attention(WORD_DIM, context_dim=WORD_DIM, heads=4, head_dim=WORD_DIM // 4)
        self.feed_forward = FeedForward(WORD_DIM, 2)
        self.out = nn.Linear(WORD_DIM, dim)

    def _add_words(self) -> None:
        """Add what `_ids` and `_words` need."""
        self.words = nn.Embedding(BUCKETS, WORD_DIM)
        self.positions = nn.Parameter(torch.randn(MAX_WORDS, WORD_DIM))

    def _ids(self, instruction: str) -> list[int]:
        """Slots of an instruction's words, after a start symbol; any word of any script has one."""
        words = re.findall(r"[^\W_]+", instruction.lower())
        ids = [1 + zlib.crc32(word.encode()) % (BUCKETS - 1) for word in words]
        return [START, *ids][:MAX_WORDS]

    def _words(self, ids: Tensor) -> Tensor:
        """Slots (b, n) -> what the queries read (b, n, WORD_DIM)."""
        return self.words(ids) + self.positions[: ids.shape[1]]

    def forward(self, instructions: list[str]) -> Tensor:
        """Instructions -> (b, tokens, dim)."""
        device = self.queries.device
        ids = [torch.tensor(self._ids(instruction), dtype=torch.int64) for instruction in instructions]
        padded = pad_sequence(ids, batch_first=True, padding_value=START)
        present = torch.arange(padded.shape[1]) < torch.tensor([len(row) for row in ids])[:, None]
        queries = self.queries.expand(len(ids), -1, -1)
        hidden = queries + self.read(queries, self._words(padded.to(device)), present.to(device))
        return self.out(hidden + self.feed_forward(hidden))
