"""The folder for what the processes of one command keep on disk between them: gone when the command is, however it ends.

A process that is killed cannot tidy up. So its folder is locked for as long as it lives, and whoever comes next removes
the folders whose lock is free.
"""

import fcntl
import os
import shutil
import tempfile
from functools import cache
from multiprocessing import util
from pathlib import Path

PREFIX = ".bimanual_scratch"
CONTENT = ("pymp-", "verify_")
"""How names in it begin, those of multiprocessing and of `verify`; with anything else a folder is not ours to remove."""

MOST_BYTES_OF_PLACE = 49
"""A socket's path has 107 at most, and multiprocessing's has 58 more than this."""


@cache
def use_scratch_folder() -> Path:
    """Have multiprocessing keep the socket of its fork server in a folder that the next command removes if need be.

    Returns:
        The folder, below the system's temporary one, or `/tmp` if the path of that is too long for a socket.
    """
    place = Path(tempfile.gettempdir())
    if len(os.fsencode(place)) > MOST_BYTES_OF_PLACE:
        place = Path("/tmp")
    for folder in place.glob(f"{PREFIX}*"):
        if (lock := _lock(folder)) is not None:
            if all(entry.name.startswith(CONTENT) for entry in folder.iterdir()):
                shutil.rmtree(folder, ignore_errors=True)
            os.close(lock)
    while _lock(folder := Path(tempfile.mkdtemp(prefix=PREFIX, dir=place))) is None:
        pass  # another process took it for that of a dead one before it was locked
    util.Finalize(None, shutil.rmtree, (folder, True), exitpriority=-200)  # after multiprocessing's own, -100
    before, tempfile.tempdir = tempfile.tempdir, str(folder)
    util.get_temp_dir()
    tempfile.tempdir = before
    return folder


def _lock(folder: Path) -> int | None:
    """File descriptor of the lock of a folder; None if somebody else has it or the folder is gone."""
    try:
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    except OSError:
        return None
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        folder.stat()
    except OSError:
        os.close(descriptor)
        return None
    return descriptor
