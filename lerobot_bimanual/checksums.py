"""SHA-256 of files, and of whole folders as lists that `sha256sum --check` reads, too."""

import hashlib
import os
import posixpath
import re
import stat
from collections.abc import Collection, Iterator
from pathlib import Path

from lerobot_bimanual.durable import move_durably
from lerobot_bimanual.errors import DatasetError

SUMS_FILE = "SHA256SUMS"

_LINE = re.compile(r"([0-9a-f]{64})  (.+)")
_MOST_BYTES = 2**26
"""Larger than the list of a dataset of half a million files."""


def sha256(path: Path) -> str:
    """SHA-256 of a file's content, in hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def write_sums(folder: Path, sums_file: str = SUMS_FILE, harmless: Collection[str] = ()) -> None:
    """List the hash of every file of a folder.

    Args:
        folder: every file below it is listed, by its path there.
        sums_file: path of the list in the folder; not listed itself.
        harmless: entries of the folder that are left out.

    Raises:
        DatasetError: something in the folder is not a plain file, or cannot be read.
    """
    files, problems = _plain_files(folder, harmless)
    if problems:
        raise DatasetError(f"{folder}: {problems[0]}")
    files.pop(sums_file, None)
    if odd := [name for name in files if not name.isprintable() or "\\" in name]:
        raise DatasetError(f"{folder}: no list of hashes can hold the name {odd[0]!r}")
    target = folder / sums_file
    partial = target.with_name(f".{target.name}.partial")
    try:
        lines = [f"{sha256(path)}  {name}\n" for name, path in sorted(files.items())]
        partial.write_text("".join(lines), encoding="utf-8")
        move_durably(partial, target)
    except OSError as error:
        raise DatasetError(f"{folder} cannot be sealed: {error}") from error


def sums_problems(
    folder: Path, sums_file: str = SUMS_FILE, harmless: Collection[str] = (), rewritten: Collection[str] = ()
) -> Iterator[str]:
    """In what a folder disagrees with its list of hashes, in one sentence each; nothing if it is as it was written.

    Files are found by walking the folder and never by a name that the list gives, and links are not followed, so no
    list and no link leads to a file elsewhere. Only links within a download of huggingface_hub are followed, from the
    snapshot in which files have their names to the folder `blobs` in which they lie.

    Args:
        folder: what is checked.
        sums_file: path of the list in the folder.
        harmless: entries of the folder that are not looked at.
        rewritten: files that may differ, be missing or be new, because the caller is about to write them; but no links.
    """
    found, problems = _plain_files(folder, harmless)
    yield from problems
    sums = found.pop(sums_file, None)
    if sums is None:
        yield f"{sums_file} is missing, so nothing tells which files belong here, and whether they are unchanged"
        return
    try:
        listed = _read_sums(sums)
    except (OSError, ValueError) as error:
        yield f"{sums_file} is damaged: {error}"
        return
    for name in sorted((listed.keys() | found.keys()) - {*rewritten}):
        if name not in listed:
            yield f"{_shown(name)} does not belong here: {sums_file} does not list it"
        elif name not in found:
            yield f"{_shown(name)} is missing"
        elif problem := _difference(found[name], listed[name]):
            yield f"{_shown(name)} {problem}"


def what_is_no_file(folder: Path, harmless: Collection[str] = ()) -> list[str]:
    """A sentence for everything below a folder that is neither file nor folder, such as links and pipes."""
    return _plain_files(folder, harmless)[1]


def is_as_listed(folder: Path, sums_file: str, name: str) -> bool:
    """Whether one file has the content of which a list knows the hash.

    Args:
        folder: of file and list.
        sums_file: path of the list in the folder.
        name: path of the file in the folder.
    """
    try:
        return _difference(folder / name, _read_sums(folder / sums_file)[name]) == ""
    except (OSError, ValueError, KeyError):
        return False


def _difference(path: Path, digest: str) -> str:
    try:
        return "" if sha256(path) == digest else "has changed since it was written"
    except OSError as error:
        return f"cannot be read ({error.strerror})"


def _read_sums(path: Path) -> dict[str, str]:
    """File -> hash.

    Raises:
        ValueError: a line is not what `write_sums` writes, or names a file twice or outside the folder.
    """
    if path.stat().st_size > _MOST_BYTES:
        raise ValueError(f"it is larger than {_MOST_BYTES // 2**20} MB")
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


def _plain_files(folder: Path, harmless: Collection[str]) -> tuple[dict[str, Path], list[str]]:
    """Every file below a folder by its path there, and a sentence for everything that is neither file nor folder."""
    files: dict[str, Path] = {}
    problems: list[str] = []
    unreadable: list[OSError] = []
    blobs = _blobs_of_snapshot(folder)
    for parent, folders, names in os.walk(folder, onerror=unreadable.append):
        if Path(parent) == folder:
            folders[:] = [name for name in folders if name not in harmless]
            names = [name for name in names if name not in harmless]
        for path in (Path(parent, name) for name in (*names, *folders)):
            name = path.relative_to(folder).as_posix()
            mode = _mode(path)
            if stat.S_ISREG(mode) or (stat.S_ISLNK(mode) and _is_blob(path, blobs)):
                files[name] = path
            elif stat.S_ISLNK(mode):
                problems.append(f"{_shown(name)} is a link, and no dataset needs one: it is not followed")
            elif not stat.S_ISDIR(mode):
                problems.append(f"{_shown(name)} is neither a file nor a folder")
    problems += [f"{_shown(str(error.filename))} cannot be read ({error.strerror})" for error in unreadable]
    return files, sorted(problems)


def _blobs_of_snapshot(folder: Path) -> Path | None:
    """Where the files of a snapshot lie in the Hub's cache, `NAME/snapshots/REVISION` beside `NAME/blobs`."""
    snapshots = Path(os.path.realpath(folder)).parent
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
