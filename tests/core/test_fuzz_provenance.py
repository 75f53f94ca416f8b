"""Whatever stands in a provenance: it is read, or refused in one sentence."""

import contextlib
import copy
import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lerobot_bimanual.dataset.card import dataset_card
from lerobot_bimanual.dataset.provenance import Provenance
from lerobot_bimanual.dataset.schema import SCHEMA_VERSION
from lerobot_bimanual.errors import SchemaMismatch

pytestmark = pytest.mark.fuzz

KEY = {"task": "lift_ball", "variation": 0, "split": "train", "seed": 3}
RIGHT = {
    "schema_version": SCHEMA_VERSION,
    "view": "frames",
    "versions": {"mujoco": "3.3.0", "numpy": "2.2.0"},
    "worlds": {"lift_ball": "0123456789ab"},
    "settings": {"episodes": 1, "intermediate": [0.5]},
    "command": "lerobot-bimanual dataset generate --task=lift_ball",
    "episodes": [KEY],
    "skipped": [KEY | {"reason": "left arm: unreachable"}],
}
INFO = {"total_episodes": 1, "total_frames": 9, "fps": 20, "features": {}}
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=6,
)


def read(path: Path) -> None:
    """Reads it, and if that went well does with it what our commands do."""
    with contextlib.suppress(SchemaMismatch):
        provenance = Provenance.load(path)
        assert provenance.other_versions().keys() <= {
            "lerobot_bimanual",
            "lerobot_env_bimanual",
            "mujoco",
            "frankik",
            "numpy",
        }
        assert dataset_card(provenance, INFO, "local/x")
        (path.parent / "meta").mkdir(exist_ok=True)
        provenance.write(path.parent)
        assert Provenance.read(path.parent) == provenance


@given(content=st.binary(max_size=60) | JSON.map(lambda value: json.dumps(value).encode()))
def test_what_is_no_provenance_is_refused(tmp_path, content) -> None:
    (tmp_path / "x.json").write_bytes(content)
    with pytest.raises(SchemaMismatch, match="is not what schema version"):
        Provenance.load(tmp_path / "x.json")


@given(data=st.data(), value=JSON)
def test_a_provenance_with_something_else_in_one_place_is_read_or_refused(tmp_path, data, value) -> None:
    content = copy.deepcopy(RIGHT)
    container, key = content, data.draw(st.sampled_from(sorted(RIGHT)))
    while isinstance(inner := container[key], dict | list) and data.draw(st.booleans()):
        container, key = (
            inner,
            data.draw(st.sampled_from([*inner] if isinstance(inner, dict) else range(len(inner)))),
        )
    if data.draw(st.booleans()):
        del container[key]
    else:
        container[key] = value
    (tmp_path / "x.json").write_text(json.dumps(content))
    read(tmp_path / "x.json")


@given(place=st.floats(0, 1), added=st.binary(max_size=4), removed=st.integers(0, 20))
def test_a_provenance_with_damaged_bytes_is_read_or_refused(tmp_path, place, added, removed) -> None:
    right = json.dumps(RIGHT).encode()
    start = round(place * len(right))
    (tmp_path / "x.json").write_bytes(right[:start] + added + right[start + removed :])
    read(tmp_path / "x.json")


def test_the_right_one_is_read(tmp_path) -> None:
    (tmp_path / "x.json").write_text(json.dumps(RIGHT))
    assert Provenance.load(tmp_path / "x.json").settings == RIGHT["settings"]
