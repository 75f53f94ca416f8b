"""Records of evaluations: actions as text, chains of hashes, and files that are read whole or refused."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis.extra import numpy as drawn
from made_up_rows import ROW

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.evaluation.record import EvaluationRecord
from lerobot_bimanual.results.action_text import actions_from_text, actions_to_text
from lerobot_bimanual.results.hash_chain import HashChain, first_difference

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
        ("", "must begin with their number"),
        ("7:", "must begin with their number"),
        ("9999x9999:", "more than any episode"),
        ("1x1:\n", "cannot be unpacked"),
        ("1x1:00000", "cannot be unpacked"),
        (actions_to_text([[1.0, 2.0]]).replace("1x2", "1x3"), "not the 1 x 3 numbers"),
        (actions_to_text([[1.0, 2.0]]).replace("1x2", "1x1"), "not the 1 x 1 numbers"),
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


def test_a_record_comes_back_from_its_file(tmp_path):
    record = ROW.evaluation
    record.write(tmp_path / "record.json")
    assert EvaluationRecord.read(tmp_path / "record.json") == record


@pytest.mark.parametrize(
    ("place", "value", "message"),
    [
        (["schema_version"], 9, "schema_version is 9, but must be 1"),
        (["batch_size"], 0, "batch_size is 0"),
        (["episodes"], [], "must be there, and their seeds rise"),
        (["episodes", 1, "seed"], 0, "must be there, and their seeds rise"),
        (["episodes", 0, "ticks"], -1, "ticks is -1"),
        (["episodes", 0, "start"], "0a", "start must be 64"),
        (["episodes", 0, "failure"], "fell", "a failure just if"),
        (["episodes", 0, "first_met_tick"], None, "must say when a success began"),
        (["episodes", 0, "first_met_tick"], 13, "one of the episode's ticks"),
        (["episodes", 0, "links"], "\n", "base85"),
        (["episodes", 0, "links"], "000", "4 bytes each"),
        (["remark"], "well done", "unknown remark"),
    ],
)
def test_a_bad_field_of_a_record_is_named_with_its_file(place, value, message, tmp_path):
    path = tmp_path / "record.json"
    ROW.evaluation.write(path)
    content = json.loads(path.read_text())
    inner = content
    for key in place[:-1]:
        inner = inner[key]
    inner[place[-1]] = value
    path.write_text(json.dumps(content))
    with pytest.raises(BimanualError, match=rf"record\.json: .*{message}"):
        EvaluationRecord.read(path)


def test_an_episode_gives_its_actions_back():
    assert len(ROW.episodes[0].action_list()) == 1
