"""The paper's language encoder: the frozen text tower of CLIP."""

import torch
from torch import Tensor, nn

from lerobot_policy_bimanual.errors import BadConfig


class ClipLanguage(nn.Module):
    """Token features of a frozen CLIP text tower, before its projection, as the paper uses them.

    The tower is not among the policy's parameters and checkpoints, and stays on the CPU in float32: every instruction is
    encoded once. Padding is symbol 0 and not masked (CLIP and PerAct2 code).

    Args:
        source: local path or hub id of a CLIP model in the transformers format.
        tokens: tokens per instruction.
        dim: expected width of the token features.

    Raises:
        BadConfig: transformers is not installed, there is no such model, or it has another width or context length.
    """

    def __init__(self, source: str, *, tokens: int, dim: int):
        super().__init__()
        try:
            from transformers import CLIPTextModel, CLIPTokenizer

            # Without a dtype it would be that of the file, often half precision.
            model = CLIPTextModel.from_pretrained(source, dtype=torch.float32).eval().requires_grad_(False)
            self._tokenizer = CLIPTokenizer.from_pretrained(source)
        except Exception as error:  # transformers, safetensors and the Hub raise many kinds
            raise BadConfig(
                f"cannot load language_encoder='clip:{source}', which must name the folder or the hub id of a CLIP model and "
                "needs the package transformers (pip install 'lerobot_policy_bimanual[clip]'): "
                f"{' '.join(str(error).split())}"
            ) from error
        limit, width = model.config.max_position_embeddings, model.config.hidden_size
        if width != dim or tokens > limit:
            raise BadConfig(
                f"{source} gives up to {limit} tokens of width {width}, but the policy has language_tokens={tokens} and "
                f"language_dim={dim}: set these to fit"
            )
        # A bound method, because nn.Module would register the tower and save it with every checkpoint.
        self._encode_ids = model.forward
        self._tokens = tokens
        self._cache: dict[str, Tensor] = {}
        self.register_buffer("_place", torch.empty(0), persistent=False)

    def forward(self, instructions: list[str]) -> Tensor:
        """Instructions -> (b, tokens, dim), without gradient."""
        return torch.stack([self._recall(instruction) for instruction in instructions])

    def _recall(self, instruction: str) -> Tensor:
        tokens = self._cache.get(instruction)
        # A cached tensor must also serve training, though the first call may be in inference mode or under autocast.
        with torch.inference_mode(False), torch.no_grad(), torch.autocast("cpu", enabled=False):
            if tokens is None:
                tokens = self._encode(instruction)
            self._cache[instruction] = tokens.to(self._place.device)  # pyright: ignore[reportArgumentType, reportCallIssue]
        return self._cache[instruction]

    def _encode(self, instruction: str) -> Tensor:
        ids = self._tokenizer(instruction, truncation=True, max_length=self._tokens).input_ids
        padded = torch.tensor([ids + [0] * (self._tokens - len(ids))])
        features = self._encode_ids(input_ids=padded).last_hidden_state
        assert features is not None  # optional only in transformers' annotations
        return features[0]
