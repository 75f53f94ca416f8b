"""The checksum manifest of a dataset: `meta/SHA256SUMS`, the hash of every file that was published together.

`dataset generate` writes it last, it travels to the Hub with the rest, and `sha256sum --check meta/SHA256SUMS` reads it
in the dataset's folder. It tells whether a dataset is whole and unchanged, not who made it: a forger can write it again,
and only replay and rendering find that.

The card is listed, too: the Hub does not change it, and `dataset push`, which writes the name of the repository into
it, writes the manifest anew. A card that was edited on the Hub's pages is another card than was published.
"""

import os
import re
import stat
from collections.abc import Collection, Iterator
from pathlib import Path

from lerobot_bimanual.errors import BimanualError, DatasetError, plain
from lerobot_bimanual.files import read_file, sha256, write_file

CHECKSUMS_FILE = Path("meta", "SHA256SUMS")

HARMLESS = (".cache", ".git", ".gitattributes")
"""What the Hub, its downloads and git add beside a dataset; no loader reads it."""

_LINE = re.compile(r"([0-9a-f]{64})  (.+)")


def write_checksums(root: Path) -> None:
    """List the hash of every file of a finished dataset, one view.

    Raises:
        DatasetError: something in it is not a plain file, or cannot be read.
        UnwritableOutput: its folder cannot be written.
    """
    files, problems = plain_files(root)
    if problems:
        raise DatasetError(f"{root}: {problems[0]}")
    files.pop(CHECKSUMS_FILE.as_posix(), None)
    if odd := [name for name in files if not name.isprintable() or "\\" in name]:
        raise DatasetError(f"{root}: no list of hashes can hold the name {odd[0]!r}")
    try:
        lines = [f"{sha256(path)}  {name}\n" for name, path in sorted(files.items())]
    except OSError as error:
        raise DatasetError(f"{error.filename} cannot be read ({error.strerror})") from error
    write_file(root / CHECKSUMS_FILE, "".join(lines))


def checksum_problems(root: Path, rewritten: Collection[Path] = ()) -> Iterator[str]:
    """Yield one sentence for each difference between a dataset and what was published.

    Files are found by walking the folder and never by a name that the manifest gives, and links are not followed, so no
    manifest and no link leads to a file elsewhere. Only links within a download of huggingface_hub are followed, from
    the snapshot in which files have their names to the folder `blobs` that stores them.

    Args:
        root: folder of the dataset, one view.
        rewritten: files that may differ, be missing or be new, because the caller is about to write them; but no links.
    """
    found, problems = plain_files(root)
    yield from problems
    manifest = found.pop(CHECKSUMS_FILE.as_posix(), None)
    if manifest is None:
        yield f"{CHECKSUMS_FILE} is missing, so it is unknown which files belong here and whether they are unchanged"
        return
    try:
        listed = _read(manifest)
    except (BimanualError, ValueError) as error:
        yield f"{CHECKSUMS_FILE} is damaged: {error}"
        return
    for name in sorted((listed.keys() | found.keys()) - {path.as_posix() for path in rewritten}):
        if name not in listed:
            yield f"{plain(name)} does not belong here: {CHECKSUMS_FILE} does not list it"
        elif name not in found:
            yield f"{plain(name)} is missing"
        else:
            try:
                if sha256(found[name]) != listed[name]:
                    yield f"{plain(name)} has changed since it was written"
            except OSError as error:
                yield f"{plain(name)} cannot be read ({error.strerror})"


def _read(path: Path) -> dict[str, str]:
    """File -> hash; a line that `write_checksums` does not write, or a file twice, is a ValueError."""
    sums: dict[str, str] = {}
    for number, line in enumerate(read_file(path).decode("utf-8").splitlines(), 1):
        match = _LINE.fullmatch(line)
        if match is None or match[2] in sums:
            raise ValueError(f"line {number} is not a hash, two spaces and the path of another file")
        sums[match[2]] = match[1]
    return sums


def plain_files(root: Path) -> tuple[dict[str, Path], list[str]]:
    """Every file below a folder by its path there, and a sentence for everything that is neither file nor folder.

    Through links and pipes a reader would leave the folder, or never return.
    """
    files: dict[str, Path] = {}
    problems: list[str] = []
    unreadable: list[OSError] = []
    snapshots = Path(os.path.realpath(root)).parent
    blobs = snapshots.with_name("blobs") if snapshots.name == "snapshots" else None
    for parent, folders, names in os.walk(root, onerror=unreadable.append):
        if Path(parent) == root:
            folders[:] = [name for name in folders if name not in HARMLESS]
            names = [name for name in names if name not in HARMLESS]
        for path in (Path(parent, name) for name in (*names, *folders)):
            name = path.relative_to(root).as_posix()
            mode = path.lstat().st_mode
            is_blob = stat.S_ISLNK(mode) and Path(os.path.realpath(path)).parent == blobs and path.is_file()
            if stat.S_ISREG(mode) or is_blob:
                files[name] = path
            elif stat.S_ISLNK(mode):
                problems.append(f"{plain(name)} is a link, and no dataset needs one: it is not followed")
            elif not stat.S_ISDIR(mode):
                problems.append(f"{plain(name)} is neither a file nor a folder")
    problems += [f"{plain(str(error.filename))} cannot be read ({error.strerror})" for error in unreadable]
    return files, sorted(problems)
