"""Records are read back unchanged; damaged files are refused by name or read consistently; episode proofs."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as drawn
from sample_results import EXPERT, RESULT, VERSIONS, proved, provenance, reported, variant
from sample_robustness import EXPERT_REPORT as EXPERT_ROBUSTNESS
from sample_robustness import ROBUSTNESS

from lerobot_bimanual.benchmark.pipeline import Marker
from lerobot_bimanual.results.benchmark import BenchmarkResult
from lerobot_bimanual.results.proof import HashChain, actions_from_text, actions_to_text, first_difference
from lerobot_bimanual.results.record import BadRecord, Record

EXAMPLES: Sequence[Record] = [
    RESULT,
    RESULT.evaluation,
    Marker(command="true", inputs={"a": "0"}, done=True, seconds=1.5),
    provenance(),
    ROBUSTNESS,
    EXPERT_ROBUSTNESS,
    EXPERT,
]
"""One of every kind of record that is a file."""


JSON_VALUES: st.SearchStrategy[Any] = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=20)
    | st.sampled_from([10**400, -(10**30), 2**63, 1e308, "9" * 5000, "../..", "a\nb", "\ud800", "f" * 64]),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=8,
)
"""What JSON can say, and a little that it cannot: NaN, infinities, half characters."""


@st.composite
def mutated_json(draw: st.DrawFn, container: Any) -> bytes:
    """The text of a JSON value in which one place holds something else, lies twice, or is gone; or a cut text."""
    content = container
    while True:
        key = draw(st.sampled_from([*container] if isinstance(container, dict) else range(len(container))))
        inner = container[key]
        if not isinstance(inner, dict | list) or not inner or draw(st.integers(0, 3)) == 0:
            break
        container = inner
    match draw(st.sampled_from(["replace", "remove", "repeat"])):
        case "remove":
            del container[key]
        case "repeat" if isinstance(container, list):
            container.append(container[key])
        case _:
            container[key] = draw(JSON_VALUES)
    text = json.dumps(content).encode()
    at = draw(st.just(len(text)) | st.integers(0, len(text)))
    return text[:at] + draw(st.sampled_from([b"", b"\x00", b"\xff", b"NaN", b"1e999", b"[" * 5000]))


@pytest.mark.fuzz
@pytest.mark.parametrize("record", EXAMPLES, ids=lambda record: type(record).__name__)
@given(data=st.data())
def test_a_record_is_read_back_unchanged_and_a_mutated_file_is_refused_or_read_consistently(
    record, data, tmp_path_factory
):
    path = tmp_path_factory.mktemp("mutated") / "mutated.json"
    record.write(path)
    assert type(record).read(path) == record
    path.write_bytes(data.draw(mutated_json(json.loads(record.to_json()))))
    try:
        read = type(record).read(path)
    except BadRecord as error:
        message = str(error)
    else:
        assert type(record).from_json(read.to_json()) == read
        message = f"{path}: none"
    assert message.startswith(f"{path}: ")
    assert "\n" not in message


@pytest.mark.parametrize(
    ("config", "fields", "message"),
    [
        ({}, {"episodes": proved("xx..", first_seed=1)}, "episodes must be on the 4 seeds from 0 on"),
        ({}, {"episodes": reported("xx..")}, "episodes: the episode of seed 0 must have a proof"),
        ({}, {"expert": reported("xxx")}, "expert must be on the 4 seeds from 0 on"),
        ({}, {"versions": VERSIONS | {"mujoco": "4"}}, "mujoco must be the same in demonstrations and test"),
        ({}, {"open_loop": reported("x...", first_seed=1)}, "open_loop must be on the same seeds"),
        ({}, {"checkpoint_step": 3}, r"checkpoints must be among those after \(2, 4\) steps"),
        ({"seed": -1}, {}, "^seed: "),
    ],
)
def test_parts_of_a_result_that_contradict_each_other_are_refused(config, fields, message):
    with pytest.raises(BadRecord, match=message):
        variant(config=config, **fields)


@pytest.mark.parametrize("name", ["absent", "folder"])
def test_what_is_not_a_file_is_refused(name: str, tmp_path: Path):
    (tmp_path / "folder").mkdir()
    with pytest.raises(BadRecord, match=f"{name}: (No such file|not a file)"):
        BenchmarkResult.read(tmp_path / name)


SHAPES = drawn.array_shapes(min_dims=2, max_dims=2, min_side=0, max_side=20)


@given(bits=drawn.arrays(np.uint32, SHAPES))
def test_actions_come_back_to_the_last_bit_whatever_they_are(bits):
    actions = bits.view(np.float32)
    again = actions_from_text(actions_to_text(actions))
    assert again.shape == actions.shape
    assert again.tobytes() == actions.tobytes()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("7:", "must begin with their number"),
        ("9999x9999:", "more than any episode"),
        ("999999x0:", "more than any episode"),
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
