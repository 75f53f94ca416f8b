"""The checksums of a dataset find whatever is not as it was published, and nothing else is read."""

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from lerobot_bimanual.dataset.checksums import CHECKSUMS_FILE, checksum_problems, write_checksums
from lerobot_bimanual.errors import DatasetError
from lerobot_bimanual.files import sha256

FILES = ("README.md", "data/chunk-0/file-000.parquet", "meta/info.json", "videos/front/chunk-0/file-000.mp4")
CHECKSUMS = CHECKSUMS_FILE.as_posix()


@pytest.fixture
def published(tmp_path) -> Path:
    root = tmp_path / "dataset"
    for name in FILES:
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(f"content of {name}")
    write_checksums(root)
    return root


def test_what_was_published_has_no_problems_and_sha256sum_agrees(published) -> None:
    assert list(checksum_problems(published)) == []
    check = ["sha256sum", "--check", "--strict", CHECKSUMS]
    listed = subprocess.run(check, cwd=published, capture_output=True, text=True, check=True).stdout
    assert listed.splitlines() == [f"{name}: OK" for name in FILES]


def replace_by_link(path: Path) -> None:
    """The content stays the same, but it lies elsewhere."""
    elsewhere = path.parents[path.parts[::-1].index("dataset")] / f"elsewhere {path.name}"
    path.rename(elsewhere)
    path.symlink_to(elsewhere)


@pytest.mark.parametrize(
    ("damage", "problem"),
    [
        (Path.unlink, "is missing"),
        (lambda path: path.write_text(path.read_text() + " "), "has changed since it was written"),
        (replace_by_link, "is a link, and no dataset needs one: it is not followed"),
        (lambda path: (path.unlink(), path.mkdir()), "is missing"),
        (lambda path: (path.unlink(), os.mkfifo(path)), "is neither a file nor a folder"),
    ],
)
def test_a_damaged_file_is_named(published, damage, problem) -> None:
    damage(published / FILES[1])
    assert f"{FILES[1]} {problem}" in list(checksum_problems(published))


def test_a_stray_file_is_a_problem_but_files_that_the_hub_or_git_adds_are_not(published) -> None:
    strays = ["data/.cache", "meta/x/y", "notes.txt"]
    harmless = [".cache/huggingface/x.metadata", ".git/HEAD", ".gitattributes"]
    for name in strays + harmless:
        (published / name).parent.mkdir(parents=True, exist_ok=True)
        (published / name).touch()
    told = [f"{name} does not belong here: {CHECKSUMS} does not list it" for name in strays]
    assert list(checksum_problems(published)) == told
    write_checksums(published)
    listed = [line.split("  ")[1] for line in (published / CHECKSUMS).read_text().splitlines()]
    assert listed == sorted([*FILES, *strays])


def line(name: str) -> str:
    return f"{'0' * 64}  {name}\n"


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (lambda _: b"\xff\xfe", "codec can't decode"),
        (lambda text: text[:-5], r"file-000\.mp4 does not belong here"),
        (lambda text: text + text.splitlines(keepends=True)[0], "line 5 is not a hash"),
        (lambda text: text + line("../secret").encode(), "../secret is missing"),
        (lambda text: text.upper(), "line 1 is not a hash"),
        (lambda text: b"x" * (2**26 + 1), "exceeds the limit of 65536 kB"),
        (lambda text: text + line("a\tb").encode(), r"^a\\tb is missing"),
    ],
)
def test_a_list_of_checksums_that_is_damaged_or_names_a_path_outside_is_a_problem(
    published, change, problem
) -> None:
    secret = published.parent / "secret"
    os.mkfifo(secret)  # opening it waits for ever
    (published / CHECKSUMS).write_bytes(change((published / CHECKSUMS).read_bytes()))
    problems = list(checksum_problems(published))
    assert any(re.search(problem, text) for text in problems), problems
    assert all("\n" not in text for text in problems)


def test_only_plain_files_with_plain_names_are_listed(published) -> None:
    (published / "data/link").symlink_to("/etc/passwd")
    with pytest.raises(DatasetError, match="data/link is a link"):
        write_checksums(published)
    (published / "data/link").unlink()
    (published / "data/a\nb").touch()
    with pytest.raises(DatasetError, match=r"no list of hashes can hold the name 'data/a\\nb'"):
        write_checksums(published)


def test_files_about_to_be_rewritten_may_differ_but_be_no_links(published) -> None:
    card = Path("README.md")
    (published / card).write_text("of another repository")
    assert list(checksum_problems(published, rewritten=[card])) == []
    (published / card).unlink()
    assert list(checksum_problems(published, rewritten=[card])) == []
    (published / card).symlink_to("/etc/passwd")
    assert list(checksum_problems(published, rewritten=[card])) != []


def test_a_download_in_the_cache_of_the_hub_is_as_published(published, tmp_path) -> None:
    """There every file is a link from the snapshot to a blob; other links lead nowhere."""
    snapshot, blobs = tmp_path / "cache/snapshots/abc", tmp_path / "cache/blobs"
    shutil.copytree(published, snapshot)
    blobs.mkdir()
    for path in [path for path in snapshot.rglob("*") if path.is_file()]:
        blob = blobs / sha256(path)
        path.rename(blob)
        path.symlink_to(blob)
    assert list(checksum_problems(snapshot)) == []
    (snapshot / FILES[0]).unlink()
    (snapshot / FILES[0]).symlink_to(published / FILES[0])
    assert any(problem.startswith(f"{FILES[0]} is a link") for problem in checksum_problems(snapshot))
