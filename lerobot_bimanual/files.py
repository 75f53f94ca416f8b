"""Files that are written completely or not at all, and foreign files that are read within limits.

A rename is one step for every reader, but after a power failure the disk may have the new name and lack the content. So
the content is flushed to the disk first, and the new name after it.
"""

import fcntl
import glob
import hashlib
import json
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from lerobot_bimanual.errors import BimanualError, plain

MAX_BYTES = 2**26
"""Larger than any result or config; a larger file is not read."""


class UnwritableOutput(BimanualError):
    """A place where nothing can be written."""

    def __init__(self, path: Path | str, reason: str):
        super().__init__(f"cannot write {path}: {reason}; choose another place")


def sha256(path: Path) -> str:
    """SHA-256 of a file's content, in hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def check_output_file(path: Path) -> None:
    """Make a file's folder and try whether the file could be written there, without changing it.

    Raises:
        UnwritableOutput: it could not.
    """
    if path.is_dir():
        raise UnwritableOutput(path, "it is a folder, but must be a file")
    check_output_folder(path.parent)


def lock_exclusively(descriptor: int, path: Path) -> None:
    """Keep other processes out of a file that is open for writing until it is closed, or this process has ended.

    Network file systems keep the locks of other files, and of folders, on one machine.

    Raises:
        BimanualError: another process has it.
    """
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise _InUse(path) from None
    except OSError:
        pass  # a file system without locks


class _InUse(BimanualError):
    def __init__(self, path: Path):
        super().__init__(f"{path} is being written by another process; wait for it, or choose another folder")


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Make a folder, if it is not there, and keep other processes that own it out by a file beside it.

    Raises:
        UnwritableOutput: nothing can be written there.
        BimanualError: another process owns it.
    """
    check_output_folder(folder)
    lock = folder.with_name(f".{folder.name}.lock")
    try:
        descriptor = os.open(lock, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
    except OSError as error:
        raise UnwritableOutput(lock, error.strerror or str(error)) from error
    try:
        lock_exclusively(descriptor, folder)
        if not (lock.exists() and os.path.samestat(os.fstat(descriptor), lock.stat())):
            raise _InUse(folder)  # its last owner has just removed this lock
        try:
            yield
        finally:
            lock.unlink(missing_ok=True)
    finally:
        os.close(descriptor)


def check_output_folder(folder: Path) -> None:
    """Make a folder and try whether files could be written there.

    Raises:
        UnwritableOutput: they could not.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        raise UnwritableOutput(folder, error.strerror or str(error)) from error


def write_file(path: Path, content: str | bytes) -> None:
    """Replace a file in one move, so that an interruption leaves the old one or the new one.

    Its folder is made. A text is written as UTF-8. What a process that was killed meanwhile has left beside it is removed.

    Raises:
        UnwritableOutput: it cannot be written; the old file is unchanged.
    """
    check_output_file(path)
    partial = _partial(path, str(os.getpid()))
    try:
        for other in path.parent.glob(_partial(Path(glob.escape(path.name)), "[0-9]*").name):
            if not Path("/proc", other.suffixes[-2][1:]).exists():
                other.unlink(missing_ok=True)
        partial.write_bytes(content.encode() if isinstance(content, str) else content)
        move_durably(partial, path)
    except OSError as error:
        raise UnwritableOutput(path, error.strerror or str(error)) from error
    finally:
        with suppress(OSError):
            partial.unlink()


def _partial(path: Path, process: str) -> Path:
    """Where a process of this machine, or of this container, prepares a file."""
    return path.with_name(f".{path.name}.{os.uname().nodename}.{process}.partial")


def share_files(folder: Path, pattern: str) -> None:
    """Let others read and write this user's files of a folder as far as the umask of this process allows."""
    for file in folder.rglob(pattern):
        if file.stat().st_uid == os.geteuid():
            file.chmod(0o666 & ~_umask())


def share_folder(folder: Path) -> None:
    """Let others use a folder that was made for this user alone, as far as the umask of this process allows."""
    folder.chmod(0o777 & ~_umask())


def _umask() -> int:
    os.umask(umask := os.umask(0o077))
    return umask


def move_durably(source: Path, target: Path) -> None:
    """Rename a finished file or folder, on one file system, in one step that survives a power failure.

    The target is replaced if it is a file or an empty folder.

    Raises:
        OSError: the disk refuses.
    """
    for parent, _, files in os.walk(source):
        for name in files:
            fsync_path(Path(parent, name))
        fsync_path(parent)
    if not source.is_dir():
        fsync_path(source)
    source.replace(target)
    fsync_path(target.parent)


def read_file(path: Path, max_bytes: int = MAX_BYTES) -> bytes:
    """The content of a file.

    Raises:
        BimanualError: it cannot be read, is not a file, or is larger than the limit.
    """
    try:
        path.stat()  # the clearest error of a missing file
        if not path.is_file():  # a pipe or a device may never end
            raise BimanualError("not a file")
        with path.open("rb") as file:
            content = file.read(max_bytes + 1)
    except OSError as error:
        raise BimanualError(error.strerror or str(error)) from error
    if len(content) > max_bytes:
        raise BimanualError(f"file exceeds the limit of {max_bytes >> 10} kB")
    return content


def read_json(path: Path) -> Any:
    """The value in a JSON file of another program.

    Raises:
        BimanualError: the file cannot be read, or is not JSON; the message names it.
    """
    try:
        return json.loads(read_file(path))
    except (ValueError, RecursionError, BimanualError) as error:
        raise BimanualError(f"{path}: {error}") from error


def read_yaml(path: Path, max_bytes: int = 2**16) -> Any:
    """The value in a YAML or JSON file without aliases, with which a few lines could expand beyond any memory.

    Raises:
        BimanualError: the file cannot be read, is not YAML, is too deep, or has an alias; the message names it.
    """
    import yaml

    try:
        content = read_file(path, max_bytes)
        if any(isinstance(event, yaml.AliasEvent) for event in yaml.parse(content, yaml.SafeLoader)):
            raise BimanualError("it has an alias (*name), but must write each part out")
        return yaml.safe_load(content)
    except (ValueError, RecursionError, yaml.YAMLError, BimanualError) as error:
        raise BimanualError(f"{path}: {plain(error)}") from error


def fsync_path(path: str | Path) -> None:
    """Have a file, or the names in a folder, survive a power failure.

    Raises:
        OSError: the disk refuses.
    """
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
