"""The checksum manifest of a dataset: `meta/SHA256SUMS`, the hash of every file that was published together.

`dataset generate` writes it last, it travels to the Hub with the rest, and `sha256sum --check meta/SHA256SUMS` reads it
in the dataset's folder. It tells whether a dataset is whole and unchanged, not who made it: a forger can write it again,
and only replay and rendering find that.

The card is listed, too: the Hub does not change it, and `dataset push`, which writes the name of the repository into
it, writes the manifest anew. A card that was edited on the Hub's pages is another card than was published.
"""

import hashlib
import os
import posixpath
import re
import stat
from collections.abc import Collection, Iterator
from pathlib import Path

from lerobot_bimanual.errors import DatasetError
from lerobot_bimanual.files import move_durably

CHECKSUMS_FILE = Path("meta", "SHA256SUMS")

HARMLESS = (".cache", ".git", ".gitattributes")
"""What the Hub, its downloads and git add beside a dataset; no loader reads it."""

MAX_BYTES = 2**26
"""Larger than the manifest of a dataset of half a million files."""

_LINE = re.compile(r"([0-9a-f]{64})  (.+)")


def sha256(path: Path) -> str:
    """SHA-256 of a file's content, in hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def write_checksums(root: Path) -> None:
    """List the hash of every file of a finished dataset.

    Args:
        root: folder of the dataset, one view.

    Raises:
        DatasetError: something in it is not a plain file, or cannot be read.
    """
    files, problems = _plain_files(root)
    if problems:
        raise DatasetError(f"{root}: {problems[0]}")
    files.pop(CHECKSUMS_FILE.as_posix(), None)
    if odd := [name for name in files if not name.isprintable() or "\\" in name]:
        raise DatasetError(f"{root}: no list of hashes can hold the name {odd[0]!r}")
    target = root / CHECKSUMS_FILE
    partial = target.with_name(f".{target.name}.partial")
    try:
        lines = [f"{sha256(path)}  {name}\n" for name, path in sorted(files.items())]
        partial.write_text("".join(lines), encoding="utf-8")
        move_durably(partial, target)
    except OSError as error:
        raise DatasetError(f"cannot write the checksums of {root}: {error}") from error


def checksum_problems(root: Path, rewritten: Collection[Path] = ()) -> Iterator[str]:
    """In what a dataset is not as it was published, in one sentence each; nothing if it is.

    Files are found by walking the folder and never by a name that the manifest gives, and links are not followed, so no
    manifest and no link leads to a file elsewhere. Only links within a download of huggingface_hub are followed, from
    the snapshot in which files have their names to the folder `blobs` that stores them.

    Args:
        root: folder of the dataset, one view.
        rewritten: files that may differ, be missing or be new, because the caller is about to write them; but no links.
    """
    found, problems = _plain_files(root)
    yield from problems
    manifest = found.pop(CHECKSUMS_FILE.as_posix(), None)
    if manifest is None:
        yield f"{CHECKSUMS_FILE} is missing, so it is unknown which files belong here and whether they are unchanged"
        return
    try:
        listed = _read(manifest)
    except (OSError, ValueError) as error:
        yield f"{CHECKSUMS_FILE} is damaged: {error}"
        return
    for name in sorted((listed.keys() | found.keys()) - {path.as_posix() for path in rewritten}):
        if name not in listed:
            yield f"{_shown(name)} does not belong here: {CHECKSUMS_FILE} does not list it"
        elif name not in found:
            yield f"{_shown(name)} is missing"
        elif problem := _difference(found[name], listed[name]):
            yield f"{_shown(name)} {problem}"


def what_is_no_file(root: Path) -> list[str]:
    """A sentence for everything in a dataset through which a reader would leave it or never return: links and pipes."""
    return _plain_files(root)[1]


def is_as_published(root: Path, file: Path) -> bool:
    """Whether one file of a dataset is as it was published; False also if the manifest is damaged or does not list it.

    Args:
        root: folder of a dataset that has a manifest.
        file: path of the file in the dataset.
    """
    try:
        return _difference(root / file, _read(root / CHECKSUMS_FILE)[file.as_posix()]) == ""
    except (OSError, ValueError, KeyError):
        return False


def _difference(path: Path, digest: str) -> str:
    try:
        return "" if sha256(path) == digest else "has changed since it was written"
    except OSError as error:
        return f"cannot be read ({error.strerror})"


def _read(path: Path) -> dict[str, str]:
    """File -> hash.

    Raises:
        ValueError: a line is not what `write_checksums` writes, or names a file twice or outside the folder.
    """
    if path.stat().st_size > MAX_BYTES:
        raise ValueError(f"file exceeds the {MAX_BYTES >> 20} MB limit")
    sums: dict[str, str] = {}
    *lines, rest = path.read_bytes().decode("utf-8").split("\n")
    if rest:
        raise ValueError("its last line is cut off")
    for number, line in enumerate(lines, 1):
        match = _LINE.fullmatch(line)
        if match is None:
            raise ValueError(f"line {number} is not a hash, two spaces and the path of a file")
        digest, name = match.groups()
        if name != posixpath.normpath(name) or name.startswith(("/", "../")) or name in (".", ".."):
            raise ValueError(f"line {number} leads out of the folder, or takes a detour: {_shown(name)}")
        if name in sums:
            raise ValueError(f"line {number} lists {_shown(name)} once more")
        sums[name] = digest
    return sums


def _plain_files(root: Path) -> tuple[dict[str, Path], list[str]]:
    """Every file below a folder by its path there, and a sentence for everything that is neither file nor folder."""
    files: dict[str, Path] = {}
    problems: list[str] = []
    unreadable: list[OSError] = []
    blobs = _blobs_of_snapshot(root)
    for parent, folders, names in os.walk(root, onerror=unreadable.append):
        if Path(parent) == root:
            folders[:] = [name for name in folders if name not in HARMLESS]
            names = [name for name in names if name not in HARMLESS]
        for path in (Path(parent, name) for name in (*names, *folders)):
            name = path.relative_to(root).as_posix()
            mode = _mode(path)
            if stat.S_ISREG(mode) or (stat.S_ISLNK(mode) and _is_blob(path, blobs)):
                files[name] = path
            elif stat.S_ISLNK(mode):
                problems.append(f"{_shown(name)} is a link, and no dataset needs one: it is not followed")
            elif not stat.S_ISDIR(mode):
                problems.append(f"{_shown(name)} is neither a file nor a folder")
    problems += [f"{_shown(str(error.filename))} cannot be read ({error.strerror})" for error in unreadable]
    return files, sorted(problems)


def _blobs_of_snapshot(root: Path) -> Path | None:
    """Where the Hub's cache stores the files of a snapshot: `NAME/snapshots/REVISION` beside `NAME/blobs`."""
    snapshots = Path(os.path.realpath(root)).parent
    return snapshots.with_name("blobs") if snapshots.name == "snapshots" else None


def _is_blob(link: Path, blobs: Path | None) -> bool:
    target = Path(os.path.realpath(link))
    return target.parent == blobs and stat.S_ISREG(_mode(target))


def _mode(path: Path) -> int:
    """Kind of an entry, not of what a link leads to; 0 if it cannot be known."""
    try:
        return path.lstat().st_mode
    except OSError:
        return 0


def _shown(name: str) -> str:
    return name if name.isprintable() else repr(name)
