"""Proofs of episodes: actions as text and chains of hashes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis.extra import numpy as drawn

from lerobot_bimanual.results.proof import HashChain, actions_from_text, actions_to_text, first_difference

SHAPES = drawn.array_shapes(min_dims=2, max_dims=2, min_side=0, max_side=20)


@given(bits=drawn.arrays(np.uint32, SHAPES))
def test_actions_come_back_to_the_last_bit_whatever_they_are(bits):
    actions = bits.view(np.float32)
    again = actions_from_text(actions_to_text(actions))
    assert again.shape == actions.shape
    assert again.tobytes() == actions.tobytes()


def test_smooth_actions_take_less_room_than_their_numbers():
    t = np.linspace(0, 1, 200)[:, None]
    actions = np.sin(t * np.arange(1, 17) + np.random.default_rng(0).normal(size=16)).astype(np.float32)
    assert len(actions_to_text(actions)) < actions.nbytes


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("7:", "must begin with their number"),
        ("9999x9999:", "more than any episode"),
        ("1x1:00000", "cannot be unpacked"),
        (actions_to_text([[1.0, 2.0]]).replace("1x2", "1x3"), "not the 1 x 3 numbers"),
        (actions_to_text([[1.0, 2.0]])[:-5], "cannot be unpacked|not the 1 x 2"),
    ],
)
def test_texts_that_hold_no_actions_are_refused(text, message):
    with pytest.raises(ValueError, match=message):
        actions_from_text(text)


def chain(actions, states) -> HashChain:
    links = HashChain("task", "start")
    for action, state in zip(actions, states, strict=True):
        links.add(np.float32([action]), state)
    return links


def test_a_chain_differs_from_the_first_changed_action_or_state_on():
    whole = chain([1, 2, 3, 4], "abcd")
    assert first_difference(whole.links, chain([1, 2, 3, 4], "abcd").links) is None
    for other, step in (
        (chain([1, 2, 0, 4], "abcd"), 2),
        (chain([1, 2, 3, 4], "xbcd"), 0),
        (chain([1, 2, 3], "abc"), 3),
        (chain([1, 2, 3, 4, 5], "abcde"), 4),
    ):
        assert first_difference(whole.links, other.links) == step
        assert whole.end != other.end
