"""The folder in which a dataset grows: `<root>.partial`, beside the place where it will appear whole.

    lock             held by the running process; the kernel frees it when the process ends, however it ends
    settings.json    what is being generated, with versions and worlds
    shards/000000/   a finished shard: report, checksums and, if it has episodes, one dataset per view
    tmp-.../         work in progress of some process

Everything enters `shards` and the final place by one rename, so whatever has a name there is complete. A killed run
leaves at most `tmp-` folders, which the next one removes. What a folder is for, its shards know best: each has its own
report and checksums, so a `settings.json` that is lost or damaged is written again from them.
"""

from __future__ import annotations

import errno
import fcntl
import json
import os
import re
import shutil
import socket
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cached_property
from pathlib import Path
from typing import Any, Self

from tqdm import tqdm

from lerobot_bimanual.durable import move_durably
from lerobot_bimanual.errors import BimanualError, DatasetError
from lerobot_bimanual.json_file import read_json
from lerobot_env_bimanual.experts.world_version import is_version, other_worlds, world_versions
from lerobot_env_bimanual.generation.origin import Origin
from lerobot_env_bimanual.generation.plan import Shard, ShardReport
from lerobot_env_bimanual.generation.publication import is_published
from lerobot_env_bimanual.generation.settings import GenerationSettings
from lerobot_env_bimanual.generation.shard_report import DamagedShard, read_report, shard_origin

ALMOST_FULL_BYTES = 2**20
"""A disk with less space is taken for full; image writers hide the reason of their failures."""

REFUSALS = (errno.EACCES, errno.EPERM, errno.EROFS, errno.ENOTDIR, errno.ENAMETOOLONG)
"""Of the system, whatever space is left."""

LOCK, STAMP, SHARDS, TEMPORARY = "lock", "settings.json", "shards", "tmp-"
SHARD_NAME = re.compile(r"\d{6,}")


class Staging:
    """The staging folder of one dataset, owned by one process while the `with` block runs.

    Args:
        root: where the dataset will be; of a link, the folder that it leads to.
        settings: what it will hold.

    Raises:
        DatasetError: on entry, if the place is taken, not writable, used by another process, holds an unfinished
            dataset of other settings or versions, or something of somebody else; also if no dataset can ever appear
            there.
    """

    def __init__(self, root: Path, settings: GenerationSettings):
        self.root = Path(os.path.realpath(root))
        self.folder = self.root.parent / f"{self.root.name}.partial"
        self._settings = settings
        self._origin = Origin.here(settings)
        self._lock: int | None = None

    @cached_property
    def worlds(self) -> dict[str, str]:
        """Task -> version of the world in which its episodes are played."""
        return world_versions(self._settings.tasks, self._settings.perturb)

    def __enter__(self) -> Self:
        """Take the lock, tidy up after killed runs, and check that the same dataset is meant."""
        with plain_write_errors(self.folder):
            self._refuse_impossible_root()
            self.folder.mkdir(parents=True, exist_ok=True)
            self._refuse_strays()
            self._lock = _take_lock(self.folder / LOCK, self.root)
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
        """Whether the dataset is complete at its final place, see `publication.is_published`.

        Raises:
            DatasetError: something else is there, or a part of the dataset is missing or changed.
        """
        with plain_write_errors(self.root):
            try:
                return is_published(self.root, self._origin)
            except DatasetError:
                if not any(self._shards.iterdir()):
                    self.remove()  # nothing was begun here
                raise

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
            move_durably(folder, self.root)
            self.remove()

    def remove(self) -> None:
        """Remove the staging folder."""
        shutil.rmtree(self.folder)

    @property
    def _shards(self) -> Path:
        return self.folder / SHARDS

    def _refuse_impossible_root(self) -> None:
        if os.path.ismount(self.root):
            raise DatasetError(
                f"{self.root} is where a disk is mounted, and a dataset cannot take the place of a disk: choose a "
                f"folder in it, for example --root={self.root / 'dataset'}"
            )
        if self.folder.is_symlink():
            raise DatasetError(
                f"{self.folder} is a link, but a dataset has to grow on the disk on which it will be: remove the link"
            )
        if occupied := next((parent for parent in self.root.parents if parent.is_file()), None):
            raise DatasetError(f"cannot make {self.root}: {occupied} is a file and not a folder")

    def _refuse_strays(self) -> None:
        """The folder is removed in the end, so what is somebody else's must not be in it."""
        for path in (*self.folder.iterdir(), *(self._shards.iterdir() if self._shards.is_dir() else ())):
            if path.parent == self._shards:
                is_ours = SHARD_NAME.fullmatch(path.name) and path.is_dir()
            elif path.name == SHARDS:
                is_ours = path.is_dir()
            else:
                is_ours = path.name.startswith(TEMPORARY) or (path.name in (LOCK, STAMP) and path.is_file())
            if not is_ours or path.is_symlink():
                raise DatasetError(
                    f"{path} was not made by this command: move it away, since {self.folder.name} is removed when the "
                    "dataset is complete"
                )

    def _adopt(self) -> None:
        for leftover in self.folder.glob(f"{TEMPORARY}*"):
            shutil.rmtree(leftover) if leftover.is_dir() else leftover.unlink()
        self._shards.mkdir(exist_ok=True)
        stamp, stamped, damage = self.folder / STAMP, None, ""
        begun_in: Mapping[str, str] = {}
        try:
            if stamp.exists():
                content = read_json(stamp)
                origin = Origin.from_dict(content)
                stamped, begun_in = origin, _worlds_of(content, origin.settings)
        except BimanualError as error:
            damage = f"{stamp} is damaged ({error})"
        if stamped == self._origin:
            if others := other_worlds(begun_in, self._settings.perturb):
                raise DatasetError(
                    f"{self.folder} was begun with {others}, where the same seeds mean other episodes. Repeat the command "
                    "with the code that began it, choose another --root, or remove the folder"
                )
            return
        finished = [*self._origins_of_whole_shards()]
        for found in finished or ([] if stamped is None else [stamped]):
            self._origin.refuse_at(self.folder, found)
        if stamped is not None:
            damage = f"{stamp} does not agree with the shards beside it"
        if damage:
            tqdm.write(
                f"{damage}; it is written again, and {len(finished)} whole shards of this dataset are kept"
            )
        with new_folder(self.folder) as temporary:
            text = json.dumps(self._origin.to_dict() | {"worlds": self.worlds}, indent=2) + "\n"
            (temporary / STAMP).write_text(text, encoding="utf-8")
            move_durably(temporary / STAMP, stamp)

    def _origins_of_whole_shards(self) -> Iterator[Origin]:
        for folder in self._shards.iterdir():
            with suppress(DamagedShard):  # named when its turn comes
                yield shard_origin(folder)

    def _release(self) -> None:
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None


def _worlds_of(stamp: dict[str, Any], settings: GenerationSettings) -> dict[str, str]:
    worlds = stamp.get("worlds")
    if (
        not isinstance(worlds, dict)
        or worlds.keys() != {*settings.tasks}
        or not all(isinstance(world, str) and is_version(world) for world in worlds.values())
    ):
        raise DatasetError("it must name the world of each of its tasks")
    return worlds


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
        move_durably(folder, target)


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
        if isinstance(error, OSError) and error.errno in REFUSALS:
            raise DatasetError(f"cannot write {place}: {error.strerror or error}") from error
        if _is_full(place) or (isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT)):
            raise DatasetError(
                f"no space left on the disk of {place}; free some and repeat the command"
            ) from error
        if isinstance(error, OSError):
            raise DatasetError(f"cannot write {place}: {error.strerror or error}") from error
        raise


def _is_full(place: Path) -> bool:
    existing = next(path for path in (place, *place.parents) if os.path.lexists(path))
    disk = shutil.disk_usage(existing)
    return disk.total > 0 and disk.free < ALMOST_FULL_BYTES  # /proc and its kind have no size at all


def _take_lock(path: Path, root: Path) -> int:
    """File descriptor of the exclusive lock at `path`, which tells whose it is."""
    while True:
        lock = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o644)
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
