"""Every command in the documents is accepted by its program, and what it names is there."""

import itertools
import re
import subprocess

import pytest
from documents import DOCUMENTS, ROOT, commands, parse

from lerobot_bimanual.results.benchmark import BenchmarkResult

ALL = list(commands(*DOCUMENTS, *sorted(ROOT.glob("examples/*.sh"))))


def words_after(program: str) -> list[list[str]]:
    """The flags of every call of a program; `torchrun` and `accelerate` start it in several processes."""
    found = []
    for words in ALL:
        index = next((i for i, word in enumerate(words) if re.search(rf"\b{program}\)?$", word)), None)
        if index is not None and (index == 0 or words[0] in ("torchrun", "accelerate")):
            found.append(words[index + 1 :])
    assert found
    return found


PROGRAMS = ("lerobot-bimanual", "lerobot-bimanual-train", "lerobot-bimanual-eval")
PROGRAMS += ("(?<!bimanual-)lerobot-train", "lerobot-eval")


@pytest.mark.slow
@pytest.mark.parametrize("program", PROGRAMS)
def test_the_commands_of_our_and_lerobots_programs_parse(program, monkeypatch):
    monkeypatch.chdir(ROOT)  # which holds the recipes
    for flags in words_after(program):
        parse(program, *flags)


def test_make_knows_every_target_that_is_named() -> None:
    named = {word for words in words_after("make") for word in words}
    assert {"setup", "demo", "test", "check"} <= named
    subprocess.run(["make", "--dry-run", *sorted(named)], cwd=ROOT, check=True, capture_output=True)


def test_the_files_that_commands_read_exist() -> None:
    named = {word.rpartition("=")[2] for words in ALL for word in words}
    folders = "results|examples|scripts|benchmarks|policies"
    paths = {word for word in named if re.match(rf"({folders})/[\w./-]+$", word)}
    filled_by_commands = ("results/leaderboard", "results/robustness", "results/expert_reports")
    written = {word for word in paths if word.startswith(filled_by_commands)}
    assert len(paths) > 10
    assert [path for path in paths - written if not (ROOT / path).exists()] == []


def test_policies_that_commands_take_from_the_leaderboard_are_on_it() -> None:
    names = {BenchmarkResult.read(path).policy_id for path in (ROOT / "results/leaderboard").glob("*.json")}
    pairs = itertools.chain.from_iterable(map(itertools.pairwise, ALL))
    named = [policy for folder, policy in pairs if re.match(r"--\w+=results/leaderboard$", folder)]
    named = [policy.partition("=")[2] for policy in named if re.match(r"--(\w+_)?policy=", policy)]
    assert named
    assert {*named} <= names
