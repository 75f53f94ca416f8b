"""Instructions become tokens."""

import importlib.util

import pytest
import torch

from lerobot_policy_bimanual.nn.language import MAX_WORDS, LearnedLanguage, make_language, word_ids


def test_equal_sentences_give_equal_tokens_whatever_their_neighbours():
    language = LearnedLanguage(tokens=5, dim=7).eval()
    alone = language(["lift the ball"])
    together = language(["push the very heavy box over to the red area", "lift the ball"])
    assert alone.shape == (1, 5, 7)
    torch.testing.assert_close(together[1], alone[0])


def test_other_words_and_another_order_give_other_tokens():
    language = LearnedLanguage(tokens=5, dim=7).eval()
    tokens = language(["press the red button", "press the blue button", "button red the press"])
    assert not torch.allclose(tokens[0], tokens[1])
    assert not torch.allclose(tokens[0], tokens[2])


@pytest.mark.parametrize("instruction", ["", "  ?!", "défense d'afficher 機械", "word " * 300])
def test_no_sentence_is_refused(instruction):
    assert torch.isfinite(LearnedLanguage(tokens=3, dim=4)([instruction, "lift the ball"])).all()
    assert len(word_ids(instruction)) <= MAX_WORDS


def test_word_slots_do_not_depend_on_case_punctuation_or_process():
    assert word_ids("Lift the BALL!") == word_ids("lift the ball")
    assert word_ids("lift ball") == [0, 1918, 118]  # a checkpoint relies on these


@pytest.mark.skipif(importlib.util.find_spec("transformers") is not None, reason="transformers is installed")
def test_clip_without_transformers_says_what_to_install():
    with pytest.raises(ImportError, match="pip install 'transformers"):
        make_language("clip:openai/clip-vit-base-patch32", tokens=77, dim=512)


def test_clip_tokens_are_cached_and_stay_out_of_the_checkpoint(monkeypatch):
    class Tower(torch.nn.Module):
        config = type("Config", (), {"max_position_embeddings": 77, "hidden_size": 6})
        calls = 0

        def __init__(self):
            super().__init__()
            self.embedding = torch.nn.Embedding(9, 6)

        @classmethod
        def from_pretrained(cls, source):
            assert source == "some/folder"
            return cls()

        def forward(self, input_ids):
            Tower.calls += 1
            return type("Output", (), {"last_hidden_state": self.embedding(input_ids)})

    class Tokenizer:
        @classmethod
        def from_pretrained(cls, source):
            return cls()

        def __call__(self, instruction, *, max_length, **_):
            ids = torch.arange(max_length)[None] % 9
            return type("Encoding", (), {"input_ids": ids})

    module = type("transformers", (), {"CLIPTextModel": Tower, "CLIPTokenizer": Tokenizer})
    monkeypatch.setitem(__import__("sys").modules, "transformers", module)
    language = make_language("clip:some/folder", tokens=5, dim=6)
    tokens = language(["lift the ball", "lift the ball"])
    assert tokens.shape == (2, 5, 6)
    assert not tokens.requires_grad
    assert Tower.calls == 1
    assert not language.state_dict()
    assert not list(language.parameters())
    with pytest.raises(ValueError, match="language_dim=512"):
        make_language("clip:some/folder", tokens=5, dim=512)
