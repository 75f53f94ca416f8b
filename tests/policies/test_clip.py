"""Frozen CLIP as language encoder, on a tower and a tokenizer in miniature: nothing is downloaded."""

import shutil
from pathlib import Path

import pytest
import torch
from transformers import CLIPTextConfig, CLIPTextModel, CLIPTokenizer

from lerobot_policy_bimanual import PerAct2Config, PerAct2Policy
from lerobot_policy_bimanual.errors import BadConfig
from lerobot_policy_bimanual.nn.clip import ClipLanguage

DIM, CONTEXT, TOKENS = 16, 12, 8
START, END = "<|startoftext|>", "<|endoftext|>"
LETTERS = "abcdefghijklmnopqrstuvwxyz"
SYMBOLS = ["!", *LETTERS, *(f"{letter}</w>" for letter in (*LETTERS, ":")), "th", "the</w>", START, END]


@pytest.fixture(scope="module")
def tower(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a tiny text tower in half precision, as many are published, and of a tokenizer of letters and "the"."""
    folder = tmp_path_factory.mktemp("clip")
    vocabulary = {symbol: index for index, symbol in enumerate(SYMBOLS)}
    CLIPTokenizer(vocab=vocabulary, merges=[("t", "h"), ("th", "e</w>")]).save_pretrained(folder)
    config = CLIPTextConfig(
        vocab_size=len(SYMBOLS),
        hidden_size=DIM,
        intermediate_size=2 * DIM,
        num_hidden_layers=2,
        num_attention_heads=2,
        max_position_embeddings=CONTEXT,
        bos_token_id=SYMBOLS.index(START),
        eos_token_id=SYMBOLS.index(END),
    )
    torch.manual_seed(0)
    CLIPTextModel(config).half().save_pretrained(folder)
    return folder


def encoder(tower: Path, tokens: int = TOKENS, dim: int = DIM) -> torch.nn.Module:
    return ClipLanguage(str(tower), tokens=tokens, dim=dim)


@pytest.mark.parametrize(
    ("sentence", "symbols"),
    [
        ("The  at", [START, "the</w>", "a", "t</w>", END, "!", "!", "!"]),  # padded with symbol 0
        ("lift the ball very high", [START, *"lif", "t</w>", "the</w>", "b", END]),  # cut
    ],
)
def test_tokens_are_the_towers_last_hidden_state_over_a_sentence_of_fixed_length(tower, sentence, symbols):
    model = CLIPTextModel.from_pretrained(tower, dtype=torch.float32)
    with torch.no_grad():
        expected = model(input_ids=torch.tensor([[*map(SYMBOLS.index, symbols)]])).last_hidden_state
    tokens = encoder(tower)([sentence])
    assert tokens.shape == (1, TOKENS, DIM)
    assert tokens.dtype == torch.float32
    torch.testing.assert_close(tokens, expected)


def test_the_tower_runs_once_per_instruction(tower, monkeypatch):
    seen, forward = [], CLIPTextModel.forward
    monkeypatch.setattr(
        CLIPTextModel, "forward", lambda *args, **inputs: seen.append(1) or forward(*args, **inputs)
    )
    language = encoder(tower)
    tokens = language(["lift", "lift", "push"])
    assert len(seen) == 2
    assert torch.equal(language(["push", "lift"]), tokens[1:].flip(0))
    assert len(seen) == 2


def test_a_policy_learns_on_frozen_tokens_which_are_neither_trained_nor_saved_and_comes_back(
    tower, make_policy, make_batch, tmp_path
):
    policy = make_policy(language_encoder=f"clip:{tower}", language_tokens=TOKENS, language_dim=DIM)
    assert not list(policy.language.parameters())
    assert not [name for name in policy.state_dict() if name.startswith("language.")]
    batch = make_batch(samples=1)
    action = policy.select_action(batch)
    policy.train()(batch)[0].backward()
    assert any(parameter.grad is not None and parameter.grad.any() for parameter in policy.get_optim_params())
    policy.save_pretrained(tmp_path)
    again = type(policy).from_pretrained(tmp_path, config=policy.config)
    assert torch.equal(again.select_action(batch), action)


@pytest.mark.parametrize(("tokens", "dim"), [(TOKENS, 2 * DIM), (CONTEXT + 1, DIM)])
def test_sizes_that_do_not_fit_the_tower_are_refused(tower, tokens, dim):
    message = f"{CONTEXT} tokens of width {DIM}.*language_tokens={tokens} and language_dim={dim}"
    with pytest.raises(BadConfig, match=message):
        encoder(tower, tokens, dim)


@pytest.mark.parametrize(
    ("file", "content", "reason"),
    [("model.safetensors", b"cut off", "deserializing"), ("tokenizer.json", b"{", "Expecting property name")],
)
def test_a_policy_names_a_tower_that_cannot_be_loaded(tower, file, content, reason, tiny, tmp_path):
    damaged = shutil.copytree(tower, tmp_path / "tower")
    (damaged / file).write_bytes(content)
    sizes = {"language_tokens": TOKENS, "language_dim": DIM}
    with pytest.raises(BadConfig, match=f"language_encoder='clip:{damaged}'.*folder or the hub id.*{reason}"):
        PerAct2Policy(PerAct2Config(**tiny | sizes, language_encoder=f"clip:{damaged}"))
