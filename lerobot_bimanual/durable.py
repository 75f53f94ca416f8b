"""Finished files and folders get their names in one step that survives a power failure.

A rename is one step for everyone who looks, but the disk may keep it and lose what was written before. So everything
is brought to the disk first, and the new name after it.
"""

import os
from pathlib import Path


def move_durably(source: Path, target: Path) -> None:
    """Rename a finished file or folder, so that the target is there whole or not at all, whatever happens meanwhile.

    Args:
        source: on the same file system as the target.
        target: is replaced if it is a file or an empty folder.

    Raises:
        OSError: the disk refuses.
    """
    for parent, _, files in os.walk(source):
        for name in files:
            _bring_to_disk(Path(parent, name))
        _bring_to_disk(parent)
    if not source.is_dir():
        _bring_to_disk(source)
    source.replace(target)
    _bring_to_disk(target.parent)


def _bring_to_disk(path: str | Path) -> None:
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
