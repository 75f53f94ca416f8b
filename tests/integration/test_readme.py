"""The commands of the README, run one after the other as they stand there, but for numbers that make them small."""

from pathlib import Path

import pytest
from small_commands import ROOT, commands, run, small

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1800)]

ELSEWHERE = ("make", "source")
"""The targets of `make` have tests and a place in CI of their own."""


def test_the_commands_of_the_readme_run_in_their_order(tmp_path: Path) -> None:
    for name in ("policies", "results"):
        (tmp_path / name).symlink_to(ROOT / name)
    found = [words for words in commands(ROOT / "README.md") if words[0] not in ELSEWHERE]
    assert len(found) >= 8
    for words in found:
        run(small(words), tmp_path)
