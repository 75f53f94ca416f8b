"""The seal of a dataset finds whatever is not as it was published, and looks nowhere else."""

import os
import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from lerobot_bimanual.checksums import sha256
from lerobot_bimanual.dataset.seal import SEAL_FILE, is_as_sealed, seal_problems, write_seal
from lerobot_bimanual.errors import DatasetError

FILES = (
    "README.md",
    "data/chunk-000/file-000.parquet",
    "meta/info.json",
    "videos/front/chunk-000/file-000.mp4",
)
SEAL = SEAL_FILE.as_posix()


def make_files(root: Path) -> None:
    for name in FILES:
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(f"content of {name}")


@pytest.fixture
def sealed(tmp_path) -> Path:
    root = tmp_path / "dataset"
    make_files(root)
    write_seal(root)
    return root


def test_what_was_sealed_has_no_problems_and_sha256sum_agrees(sealed) -> None:
    assert list(seal_problems(sealed)) == []
    check = ["sha256sum", "--check", "--strict", SEAL]
    listed = subprocess.run(check, cwd=sealed, capture_output=True, text=True, check=True).stdout
    assert listed.splitlines() == [f"{name}: OK" for name in FILES]


def test_sealing_again_gives_the_same_list(sealed) -> None:
    before = (sealed / SEAL).read_bytes()
    write_seal(sealed)
    assert (sealed / SEAL).read_bytes() == before


def replace_by_link(path: Path) -> None:
    """The content stays the same, but it lies elsewhere."""
    elsewhere = path.parents[path.parts[::-1].index("dataset")] / f"elsewhere {path.name}"
    path.rename(elsewhere)
    path.symlink_to(elsewhere)


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize(
    ("damage", "problem"),
    [
        (Path.unlink, "is missing"),
        (lambda path: path.write_text(path.read_text() + " "), "has changed since it was written"),
        (lambda path: path.write_text(""), "has changed since it was written"),
        (lambda path: path.rename(path.with_name("other")), "is missing"),
        (replace_by_link, "is a link, and no dataset needs one: it is not followed"),
        (lambda path: (path.unlink(), path.mkdir()), "is missing"),
        (lambda path: (path.unlink(), os.mkfifo(path)), "is neither a file nor a folder"),
    ],
)
def test_a_damaged_file_is_named(sealed, name, damage, problem) -> None:
    damage(sealed / name)
    assert f"{name} {problem}" in list(seal_problems(sealed))


@pytest.mark.parametrize("name", ["notes.txt", "data/chunk-000/file-001.parquet", "data/.cache", "meta/x/y"])
def test_a_stray_file_is_named(sealed, name) -> None:
    (sealed / name).parent.mkdir(parents=True, exist_ok=True)
    (sealed / name).touch()
    assert list(seal_problems(sealed)) == [f"{name} does not belong here: {SEAL} does not list it"]


@pytest.mark.parametrize("name", [".gitattributes", ".cache/huggingface/x.metadata", ".git/HEAD"])
def test_what_the_hub_and_git_add_is_no_stray(sealed, name) -> None:
    (sealed / name).parent.mkdir(parents=True, exist_ok=True)
    (sealed / name).touch()
    assert list(seal_problems(sealed)) == []
    write_seal(sealed)
    assert name not in (sealed / SEAL).read_text()


def test_a_folder_that_is_a_link_is_named(sealed, tmp_path) -> None:
    (sealed / "data").rename(tmp_path / "data")
    (sealed / "data").symlink_to(tmp_path / "data")
    problems = list(seal_problems(sealed))
    assert "data is a link, and no dataset needs one: it is not followed" in problems
    assert "data/chunk-000/file-000.parquet is missing" in problems


def line(name: str) -> str:
    return f"{'0' * 64}  {name}\n"


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (lambda _: b"\xff\xfe", "codec can't decode"),
        (lambda text: text[:-1], "its last line is cut off"),
        (lambda text: text + b"\n", "line 5 is not a hash"),
        (lambda text: text.replace(b"\n", b"\r\n"), "README.md' is missing|does not belong"),
        (lambda text: text + text.splitlines(keepends=True)[0], "line 5 lists README.md once more"),
        (lambda text: text + line("../secret").encode(), "line 5 leads out of the folder"),
        (lambda text: text + line("/etc/passwd").encode(), "line 5 leads out of the folder"),
        (lambda text: text + line("data/../../secret").encode(), "line 5 leads out of the folder"),
        (lambda text: text + line("..").encode(), "line 5 leads out of the folder"),
        (lambda text: text + line("./README.md").encode(), "takes a detour"),
        (lambda text: text.upper(), "line 1 is not a hash"),
        (lambda text: text.replace(b"  ", b" "), "line 1 is not a hash"),
        (lambda text: b"x" * (2**26 + 1), "it is larger than 64 MB"),
        (lambda text: b"", "README.md does not belong here"),
        (lambda text: text + line(SEAL).encode(), f"{SEAL} is missing"),
        (lambda text: text + line("a\tb").encode(), r"'a\\tb' is missing"),
    ],
)
def test_a_list_that_is_damaged_or_leads_elsewhere_is_named(sealed, change, problem) -> None:
    secret = sealed.parent / "secret"
    os.mkfifo(secret)  # whoever opens it never comes back
    (sealed / SEAL).write_bytes(change((sealed / SEAL).read_bytes()))
    problems = list(seal_problems(sealed))
    assert any(re.search(problem, text) for text in problems), problems
    assert all("\n" not in text for text in problems)


def test_a_dataset_without_a_list_is_told_in_one_sentence(sealed) -> None:
    (sealed / SEAL).unlink()
    (problem,) = seal_problems(sealed)
    assert problem.startswith(f"{SEAL} is missing, so nothing tells which files belong here")


@pytest.mark.parametrize("what", ["nothing", "a file", "an empty folder"])
def test_what_is_no_dataset_has_no_list(tmp_path, what) -> None:
    make: dict[str, Callable[[Path], object]] = {
        "nothing": str,
        "a file": Path.touch,
        "an empty folder": Path.mkdir,
    }
    make[what](tmp_path / "it")
    assert any(f"{SEAL} is missing" in problem for problem in seal_problems(tmp_path / "it"))


def test_names_that_no_terminal_shows_are_told_escaped(sealed) -> None:
    (sealed / os.fsdecode(b"data/\xff\x1b")).touch()
    (problem,) = seal_problems(sealed)
    assert problem.startswith(r"'data/\udcff\x1b' does not belong here")


def test_only_plain_files_with_plain_names_are_sealed(sealed) -> None:
    (sealed / "data/link").symlink_to("/etc/passwd")
    with pytest.raises(DatasetError, match="data/link is a link"):
        write_seal(sealed)
    (sealed / "data/link").unlink()
    (sealed / "data/a\nb").touch()
    with pytest.raises(DatasetError, match=r"no list of hashes can hold the name 'data/a\\nb'"):
        write_seal(sealed)


def test_files_about_to_be_rewritten_may_differ_but_be_no_links(sealed) -> None:
    card = Path("README.md")
    (sealed / card).write_text("of another repository")
    assert list(seal_problems(sealed, rewritten=[card])) == []
    (sealed / card).unlink()
    assert list(seal_problems(sealed, rewritten=[card])) == []
    (sealed / card).symlink_to("/etc/passwd")
    assert list(seal_problems(sealed, rewritten=[card])) != []


def test_a_download_in_the_cache_of_the_hub_is_as_published(sealed, tmp_path) -> None:
    """There every file is a link from the snapshot to a blob; other links lead nowhere."""
    snapshot, blobs = tmp_path / "cache/snapshots/abc", tmp_path / "cache/blobs"
    shutil.copytree(sealed, snapshot)
    blobs.mkdir()
    for path in [path for path in snapshot.rglob("*") if path.is_file()]:
        blob = blobs / sha256(path)
        path.rename(blob)
        path.symlink_to(blob)
    assert list(seal_problems(snapshot)) == []
    (snapshot / FILES[0]).unlink()
    (snapshot / FILES[0]).symlink_to(sealed / FILES[0])
    assert f"{FILES[0]} is a link, and no dataset needs one: it is not followed" in list(
        seal_problems(snapshot)
    )


def test_one_file_is_compared_without_reading_the_others(sealed) -> None:
    info = Path("meta/info.json")
    (sealed / "README.md").write_text("changed")
    assert is_as_sealed(sealed, info)
    assert not is_as_sealed(sealed, Path("README.md"))
    (sealed / info).write_text("changed")
    assert not is_as_sealed(sealed, info)
    assert not is_as_sealed(sealed, Path("meta/absent.json"))
    (sealed / SEAL).write_bytes(b"\xff")
    assert not is_as_sealed(sealed, Path("data/chunk-000/file-000.parquet"))
