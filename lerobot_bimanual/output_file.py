"""Files that are written whole or not at all, into places that are tried before the work."""

import os
import tempfile
from pathlib import Path

from lerobot_bimanual.durable import move_durably
from lerobot_bimanual.errors import BimanualError


class UnwritableOutput(BimanualError):
    """A place where nothing can be written."""

    def __init__(self, path: Path | str, reason: str):
        super().__init__(f"cannot write {path}: {reason}; choose another place")


def check_output_file(path: Path) -> None:
    """Make a file's folder, and try whether the file could be written there; it stays as it is.

    Raises:
        UnwritableOutput: it could not.
    """
    if path.is_dir():
        raise UnwritableOutput(path, "it is a folder, but must be a file")
    check_output_folder(path.parent)


def check_output_folder(folder: Path) -> None:
    """Make a folder, and try whether files could be written there.

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

    Args:
        path: the file; its folder is made.
        content: what it holds; a text is written as UTF-8.

    Raises:
        UnwritableOutput: it cannot be written; the old file is still there.
    """
    check_output_file(path)
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    try:
        partial.write_bytes(content.encode() if isinstance(content, str) else content)
        move_durably(partial, path)
    except OSError as error:
        raise UnwritableOutput(path, error.strerror or str(error)) from error
    finally:
        partial.unlink(missing_ok=True)
