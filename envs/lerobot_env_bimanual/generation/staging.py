"""The folder in which a dataset grows: `<root>.partial`, beside the place where it will appear whole.

    lock             held by the running process; the kernel frees it when the process ends, however it ends
    settings.json    what is being generated, with versions
    shards/000000/   a finished shard: report, checksums and, if it has episodes, one dataset per view
    tmp-.../         work in progress of some process

Everything enters `shards` and the final place by one rename, so whatever has a name there is complete. A killed run
leaves at most `tmp-` folders, which the next one removes.
"""

from __future__ import annotations

import errno
import fcntl
import json
import os
import shutil
import socket
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Self

from lerobot_bimanual.dataset.provenance import Provenance, installed_versions
from lerobot_bimanual.dataset.schema import VIEWS
from lerobot_bimanual.errors import BimanualError, DatasetError
from lerobot_bimanual.json_file import read_json
from lerobot_env_bimanual.generation.plan import Shard, ShardReport
from lerobot_env_bimanual.generation.settings import GenerationSettings
from lerobot_env_bimanual.generation.shard_report import read_report

ALMOST_FULL_BYTES = 2**20
"""A disk with less space is taken for full; image writers hide the reason of their failures."""


class Staging:
    """The staging folder of one dataset, owned by one process while the `with` block runs.

    Args:
        root: where the dataset will be.
        settings: what it will hold.

    Raises:
        DatasetError: on entry, if the place is taken, not writable, used by another process, or holds an unfinished
            dataset of other settings or versions.
    """

    def __init__(self, root: Path, settings: GenerationSettings):
        self.root = root.absolute()
        self.folder = self.root.with_name(self.root.name + ".partial")
        self._settings = settings
        self._lock: int | None = None

    def __enter__(self) -> Self:
        """Take the lock, tidy up after killed runs, and check that the same dataset is meant."""
        with plain_write_errors(self.folder):
            self.folder.mkdir(parents=True, exist_ok=True)
            self._lock = _take_lock(self.folder / "lock", self.root)
            try:
                self._adopt()
            except BaseException:
                self._release()
                raise
        return self

    def __exit__(self, *_: object) -> None:
        """Give the lock back; the folder stays for the next run unless `publish` has removed it."""
        self._release()

    def is_published(self) -> bool:
        """Whether the dataset is complete at its final place.

        Raises:
            DatasetError: something else is there.
        """
        if not self.root.exists() or (self.root.is_dir() and not any(self.root.iterdir())):
            return False
        places = (self.root, *(self.root / view for view in VIEWS))
        provenance = next((found for place in places if (found := Provenance.read(place)) is not None), None)
        if provenance is None:
            raise DatasetError(
                f"{self.root} exists and was not made by this command; choose another --root or remove it"
            )
        self._refuse_other(provenance.settings, self.root)
        return True

    def report(self, shard: Shard) -> ShardReport | None:
        """Report of a finished shard, `None` if it is not finished.

        Raises:
            DamagedShard: the shard is damaged, or not a shard of this dataset.
        """
        folder = self.shard_folder(shard.name)
        return read_report(folder, self._settings, shard) if folder.exists() else None

    def discard(self, shard: Shard) -> None:
        """Remove a shard that cannot be used."""
        with plain_write_errors(self.folder), new_folder(self.folder) as temporary:
            self.shard_folder(shard.name).rename(temporary / shard.name)

    def shard_folder(self, shard: str) -> Path:
        """Where a finished shard lies."""
        return self._shards / shard

    def publish(self, folder: Path) -> None:
        """Move a finished dataset to its final place and remove the staging folder."""
        with plain_write_errors(self.root):
            if self.root.is_dir():
                self.root.rmdir()  # empty, as `is_published` made sure
            folder.rename(self.root)
            self.remove()

    def remove(self) -> None:
        """Remove the staging folder."""
        shutil.rmtree(self.folder)

    @property
    def _shards(self) -> Path:
        return self.folder / "shards"

    def _adopt(self) -> None:
        for leftover in self.folder.glob("tmp-*"):
            shutil.rmtree(leftover)
        self._shards.mkdir(exist_ok=True)
        stamp = self.folder / "settings.json"
        mine = {"settings": self._settings.to_dict(), "versions": installed_versions()}
        if not stamp.is_file():
            with new_folder(self.folder) as temporary:
                (temporary / stamp.name).write_text(json.dumps(mine, indent=2) + "\n", encoding="utf-8")
                (temporary / stamp.name).rename(stamp)
            return
        try:
            theirs = read_json(stamp)
            settings, versions = theirs["settings"], theirs["versions"]
        except (BimanualError, KeyError, TypeError) as error:
            raise DatasetError(
                f"{stamp} is damaged ({error}): remove {self.folder} to start again"
            ) from error
        self._refuse_other(settings, self.folder)
        if versions != mine["versions"]:
            raise DatasetError(
                f"{self.folder} was begun with {versions}, but installed are {mine['versions']}: "
                "install the same versions, or remove the folder to start again"
            )

    def _refuse_other(self, found: object, place: Path) -> None:
        """Refuse a place that was begun with other settings than these."""
        try:
            differences = GenerationSettings.from_dict(found).differences(self._settings)
        except BimanualError as error:
            differences = [str(error)]
        if differences:
            raise DatasetError(
                f"{place} holds a dataset of other settings: {'; '.join(differences)}. "
                "Repeat the command that made it, choose another --root, or remove the folder"
            )

    def _release(self) -> None:
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None


def view_folder(root: Path, settings: GenerationSettings, view: str) -> Path:
    """Folder of one view of a dataset: `root` itself if it is the only one, otherwise `root/<view>`."""
    return root if settings.views == (view,) else root / view


@contextmanager
def new_folder(parent: Path) -> Iterator[Path]:
    """A temporary folder below `parent`, removed at the end unless it was moved away."""
    folder = Path(tempfile.mkdtemp(prefix="tmp-", dir=parent))
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def place_shard(folder: Path, target: Path) -> None:
    """Give a finished shard its name; a target that exists already is as good, and stays."""
    if not target.exists():
        folder.rename(target)


@contextmanager
def plain_write_errors(place: Path) -> Iterator[None]:
    """Turn the many ways in which a disk can refuse into one clear message.

    Raises:
        DatasetError: the disk is full, or the place cannot be written.
    """
    try:
        yield
    except BimanualError:
        raise
    except Exception as error:
        existing = next(path for path in (place, *place.parents) if path.exists())
        is_full = shutil.disk_usage(existing).free < ALMOST_FULL_BYTES
        if is_full or (isinstance(error, OSError) and error.errno == errno.ENOSPC):
            raise DatasetError(
                f"no space left on the disk of {place}; free some and repeat the command"
            ) from error
        if isinstance(error, OSError):
            raise DatasetError(f"cannot write {place}: {error.strerror or error}") from error
        raise


def _take_lock(path: Path, root: Path) -> int:
    """File descriptor of the exclusive lock at `path`, which tells whose it is."""
    while True:
        lock = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            owner = os.read(lock, 200).decode(errors="replace").strip() or "another process"
            os.close(lock)
            raise DatasetError(
                f"{root} is being generated by {owner}; wait for it, or choose another --root"
            ) from None
        if path.exists() and os.fstat(lock).st_ino == path.stat().st_ino:
            os.ftruncate(lock, 0)
            os.write(lock, f"process {os.getpid()} on {socket.gethostname()}\n".encode())
            return lock
        os.close(lock)  # its owner removed the folder in between
        path.parent.mkdir(parents=True, exist_ok=True)
