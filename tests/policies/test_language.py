"""Instructions become tokens."""

import pytest
import torch

from lerobot_policy_bimanual.nn.language import MAX_WORDS, LearnedLanguage, word_ids


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


@pytest.mark.parametrize("instruction", ["", "  ?!", "défense d'afficher 機械", "\ud800", "word " * 300])
def test_no_sentence_is_refused(instruction):
    assert torch.isfinite(LearnedLanguage(tokens=3, dim=4)([instruction, "lift the ball"])).all()
    assert len(word_ids(instruction)) <= MAX_WORDS


def test_word_slots_do_not_depend_on_case_punctuation_or_process():
    assert word_ids("Lift the BALL!") == word_ids("lift the ball")
    assert word_ids("lift ball") == [0, 1918, 118]  # a checkpoint relies on these
