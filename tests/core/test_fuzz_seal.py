"""Whatever stands in a list of hashes: what is wrong is told, and nothing outside the dataset is opened."""

import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lerobot_bimanual.dataset.seal import SEAL_FILE, is_as_sealed, seal_problems, write_seal

pytestmark = pytest.mark.fuzz

FILES = ("README.md", "data/a.parquet", "meta/info.json")
NAMES = st.sampled_from(
    [*FILES, "../secret", "/etc/passwd", "..", ".", "", "data", "data//a.parquet", "meta/SHA256SUMS"]
)
DIGESTS = st.text("0123456789abcdef", min_size=63, max_size=65)
LINES = st.builds(
    "{}{}{}\n".format, DIGESTS, st.sampled_from(["  ", " *", " "]), NAMES | st.text(max_size=20)
)


@pytest.fixture(scope="module")
def sealed(tmp_path_factory) -> Path:
    """A dataset with a pipe beside it: whoever opens that never comes back."""
    root = tmp_path_factory.mktemp("fuzz") / "dataset"
    os.mkfifo(root.with_name("secret"))
    for name in FILES:
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(f"content of {name}")
    write_seal(root)
    return root


@given(data=st.data())
def test_a_list_that_was_tampered_with_is_told(sealed, data) -> None:
    write_seal(sealed)
    right = (sealed / SEAL_FILE).read_bytes()
    place = data.draw(st.integers(0, len(right)))
    removed = data.draw(st.integers(0, 80))
    added = data.draw(
        st.binary(max_size=80) | st.lists(LINES, max_size=3).map(lambda lines: "".join(lines).encode())
    )
    tampered = data.draw(st.just(right[:place] + added + right[place + removed :]) | st.just(added))
    (sealed / SEAL_FILE).write_bytes(tampered)
    problems = list(seal_problems(sealed))
    assert bool(problems) == (
        sorted(tampered.splitlines()) != sorted(right.splitlines()) or tampered[-1:] != b"\n"
    )
    assert all(isinstance(problem, str) and problem.isprintable() for problem in problems)
    assert isinstance(is_as_sealed(sealed, Path("README.md")), bool)


@given(data=st.data())
def test_a_file_that_was_tampered_with_is_told(sealed, data) -> None:
    name = data.draw(st.sampled_from(FILES))
    before = (sealed / name).read_bytes()
    write_seal(sealed)
    (sealed / name).write_bytes(after := data.draw(st.binary(max_size=30) | st.just(before)))
    assert list(seal_problems(sealed)) == [f"{name} has changed since it was written"] * (after != before)
    (sealed / name).write_bytes(before)
