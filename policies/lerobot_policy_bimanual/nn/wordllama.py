"""Language encoder with a large language model's word vectors, frozen; the package wordllama has them: no download."""

import torch.nn.functional as F  # noqa: N812
from torch import Tensor, nn

from lerobot_bimanual.distributions import module_path
from lerobot_policy_bimanual.errors import BadConfig
from lerobot_policy_bimanual.nn.language import MAX_WORDS, WORD_DIM, LearnedLanguage

VECTORS_FILE = "weights/l2_supercat_256.safetensors"
TOKENIZER_FILE = "tokenizers/l2_supercat_tokenizer_config.json"


class WordllamaLanguage(LearnedLanguage):
    """Frozen vectors of the tokens, projected by one layer and read as learned words are, but without their positions.

    Words that mean the same have similar vectors, so that a policy can follow words that its demonstrations lack. The vectors
    are neither among the policy's parameters nor in its checkpoints.

    Raises:
        BadConfig: the package is missing, or its files cannot be read.
    """

    _vectors: Tensor

    def _add_words(self) -> None:
        try:
            from safetensors.torch import load_file
            from tokenizers import Tokenizer

            folder = module_path(
                "wordllama"
            )  # not imported: that takes a second and looks for files on the Hub
            if folder is None:
                raise ModuleNotFoundError("No module named 'wordllama'")
            self._tokenizer = Tokenizer.from_file(str(folder / TOKENIZER_FILE))
            vectors = load_file(folder / VECTORS_FILE)["embedding.weight"]
        except Exception as error:  # tokenizers and safetensors raise many kinds
            raise BadConfig(
                "language_encoder='wordllama' needs the package wordllama (pip install 'lerobot_policy_bimanual[words]'), but "
                f"its vectors cannot be read: {' '.join(str(error).split())}"
            ) from error
        self.register_buffer("_vectors", vectors, persistent=False)
        self.project = nn.Linear(vectors.shape[1], WORD_DIM)

    def _ids(self, instruction: str) -> list[int]:
        # Half of a surrogate pair is no text to a tokenizer.
        text = instruction.lower().encode(errors="replace").decode()
        return self._tokenizer.encode(text).ids[:MAX_WORDS]

    def _words(self, ids: Tensor) -> Tensor:
        vectors = F.embedding(ids, self._vectors).float()
        return self.project(F.layer_norm(vectors, vectors.shape[-1:]))
