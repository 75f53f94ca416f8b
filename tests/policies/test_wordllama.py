"""Frozen word vectors as language encoder, on a package that is made here."""

import importlib.util
from pathlib import Path

import pytest
import torch
from safetensors.torch import save_file
from tokenizers import Tokenizer
from tokenizers.models import WordLevel
from tokenizers.pre_tokenizers import Whitespace
from tokenizers.processors import TemplateProcessing

from lerobot_bimanual import cli
from lerobot_policy_bimanual import PerAct2Config, PerAct2Policy
from lerobot_policy_bimanual.errors import BadConfig
from lerobot_policy_bimanual.nn.wordllama import TOKENIZER_FILE, VECTORS_FILE, WordllamaLanguage

VOCABULARY = {"<unk>": 0, "<s>": 1, "lift": 2, "raise": 3, "push": 4, "the": 5, "ball": 6}


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package with seven words, of which two have one vector, that must not be imported."""
    folder = tmp_path / "site" / "wordllama"
    for file in (VECTORS_FILE, TOKENIZER_FILE):
        (folder / file).parent.mkdir(parents=True)
    (folder / "__init__.py").write_text("raise RuntimeError('imported')")
    vectors = torch.randn(len(VOCABULARY), 12, generator=torch.Generator().manual_seed(0))
    vectors[3] = vectors[2]
    save_file({"embedding.weight": vectors.half()}, folder / VECTORS_FILE)
    tokenizer = Tokenizer(WordLevel(VOCABULARY, "<unk>"))  # type: ignore[call-arg]
    tokenizer.pre_tokenizer = Whitespace()
    tokenizer.post_processor = TemplateProcessing(single="<s> $A", special_tokens=[("<s>", 1)])
    tokenizer.save(str(folder / TOKENIZER_FILE))
    monkeypatch.syspath_prepend(folder.parent)
    return folder


@pytest.mark.usefixtures("package")
def test_a_word_with_the_vector_of_a_trained_one_means_the_same_and_another_does_not():
    language = WordllamaLanguage(tokens=3, dim=4).eval()
    lift, raised, push, _ = language(["lift the ball", "Raise the ball", "push the ball", "lift"])
    torch.testing.assert_close(lift, raised)
    assert not torch.allclose(lift, push)


def test_vectors_are_neither_trained_nor_saved_and_the_checkpoint_is_safe_and_comes_back(
    package, tiny, save_policy, make_batch, tmp_path, capsys
):
    options = tiny | {"language_encoder": "wordllama"}
    policy = PerAct2Policy(PerAct2Config(**options))
    assert not any("vectors" in name for name in [*policy.state_dict(), *dict(policy.named_parameters())])
    policy.train()(make_batch())[0].backward()
    gradient = policy.get_parameter("language.project.weight").grad
    assert gradient is not None
    assert gradient.any()
    checkpoint = save_policy("peract2", options, tmp_path / "saved")
    first, again = (PerAct2Policy.from_pretrained(checkpoint) for _ in range(2))
    batch = make_batch()
    assert torch.equal(first.select_action(batch), again.select_action(batch))
    assert cli.main(["policy", "check", f"--checkpoint={checkpoint}"]) == 0
    (package / TOKENIZER_FILE).write_text("{")
    assert cli.main(["policy", "check", f"--checkpoint={checkpoint}"]) == 1
    assert "lerobot_policy_bimanual[words]" in capsys.readouterr().err


def test_a_missing_package_is_named_with_what_to_install(monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: None)
    with pytest.raises(BadConfig, match=r"'lerobot_policy_bimanual\[words\]'.*No module named 'wordllama'"):
        WordllamaLanguage(tokens=3, dim=4)
