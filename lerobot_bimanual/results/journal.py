"""Append-only files of finished work: whatever ends the process, what was added is on the disk."""

import os
from contextlib import suppress
from pathlib import Path

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.files import UnwritableOutput, fsync_path, lock_exclusively
from lerobot_bimanual.results.record import BadRecord, Record

MAX_JOURNAL_BYTES = 2**30
"""Larger than any; a larger file is not read."""


class Journal[Entry: Record]:
    """A file with a header line, which says of what it is, and one JSON line per entry.

    A last line that was cut off by the end of a process is dropped, and its work is done again.

    Args:
        path: the file; it and its folder are made.
        kind: type of the entries.
        exclusive: whether other processes are kept out until `close` or the end of this one.

    Raises:
        BimanualError: another process has it, or it is too large.
        UnwritableOutput: it cannot be written.
    """

    def __init__(self, path: Path, kind: type[Entry], *, exclusive: bool = False):
        self.path, self._kind = path, kind
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = path.open("a+b", buffering=0)
            if exclusive:
                lock_exclusively(self._file.fileno(), path)
            if self._file.seek(0, os.SEEK_END) > MAX_JOURNAL_BYTES:
                raise BimanualError(f"{path} is larger than any list of episodes: remove it")
            self._file.seek(0)
            *lines, cut = self._file.read().split(b"\n")
            if cut:
                self._file.truncate(self._file.tell() - len(cut))
        except OSError as error:
            raise UnwritableOutput(path, error.strerror or str(error)) from error
        self.header = lines[0].decode(errors="replace") if lines else ""
        self._lines = lines[1:]

    def entries(self) -> list[Entry]:
        """The entries that were there already, but for damaged ones, whose work is done again."""
        found = []
        for text in self._lines:
            with suppress(BadRecord):
                found.append(self._kind.from_json(text))
        return found

    def restart(self, header: str) -> None:
        """Forget what is there, and begin with another header."""
        self.header, self._lines = header, []
        try:
            self._file.truncate(0)
            fsync_path(self.path.parent)
        except OSError as error:
            raise UnwritableOutput(self.path, error.strerror or str(error)) from error
        self._append(header)

    def add(self, entry: Entry) -> None:
        """Keep an entry; it is on the disk afterwards, or an UnwritableOutput is raised."""
        self._append(entry.model_dump_json(exclude_defaults=True))

    def close(self) -> None:
        """Let other processes have it."""
        self._file.close()

    def remove(self) -> None:
        """Delete it: its entries are safe elsewhere."""
        self.path.unlink(missing_ok=True)
        self.close()

    def _append(self, line: str) -> None:
        text = memoryview(f"{line}\n".encode())
        try:
            while text:  # a disk that fills up takes a part
                text = text[self._file.write(text) :]
            os.fsync(self._file.fileno())
        except OSError as error:
            raise UnwritableOutput(self.path, error.strerror or str(error)) from error
