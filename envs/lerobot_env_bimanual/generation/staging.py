"""The folder in which a dataset grows: `<root>.partial`, beside the place where it will appear whole.

    origin.json      what is being generated, with versions and worlds
    shards/000000/   a finished shard: report and, if it has episodes, one dataset per view
    tmp-.../         work in progress of some process

Everything enters `shards` and the final place by one rename after it has reached the disk, so whatever has a name there
is complete. A killed run leaves at most `tmp-` folders, which the next one removes.
"""

import errno
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from lerobot_bimanual.dataset.checksums import checksum_problems
from lerobot_bimanual.dataset.provenance import Provenance
from lerobot_bimanual.dataset.schema import PROVENANCE_FILE, VIEWS
from lerobot_bimanual.errors import BimanualError, DatasetError
from lerobot_bimanual.files import locked, move_durably, share_files, share_folder
from lerobot_env_bimanual.generation.plan import Shard, ShardReport
from lerobot_env_bimanual.generation.settings import GenerationSettings, Origin

ALMOST_FULL_BYTES = 2**20
"""A disk with less space is taken for full; image writers hide the reason of their failures."""

REFUSALS = (errno.EACCES, errno.EPERM, errno.EROFS, errno.ENOTDIR, errno.ENAMETOOLONG)
"""Errors with which the system refuses a write, whatever space is left."""

ORIGIN, SHARDS, TEMPORARY, REPORT = "origin.json", "shards", "tmp-", "report.json"
LEFTOVERS = (TEMPORARY, f".{ORIGIN}.")
"""Prefixes of the names of files that a killed run was writing."""


@dataclass(frozen=True)
class Staging:
    """The staging folder of one dataset, locked by this process; see `staged`.

    Attributes:
        root: where the dataset will be; of a link, the folder that it leads to.
        folder: the staging folder.
        settings: what the dataset will hold.
        origin: its settings, versions and worlds.
    """

    root: Path
    folder: Path
    settings: GenerationSettings
    origin: Origin

    def is_published(self) -> bool:
        """Whether the dataset is complete and unchanged at its final place; every file is read.

        Raises:
            DatasetError: something else is there, or a part of the dataset is missing or changed.
        """
        if not self.root.exists() or (self.root.is_dir() and not any(self.root.iterdir())):
            return False
        places = (self.root, *(self.root / view for view in VIEWS))
        found = [place for place in places if (place / PROVENANCE_FILE).exists()]
        if not found:
            raise DatasetError(
                f"{self.root} exists and was not made by this command; choose another --root or remove it"
            )
        for place in found:
            self.origin.refuse_at(self.root, Provenance.read(place / PROVENANCE_FILE))
        for view in self.settings.views:
            folder = view_folder(self.root, self.settings, view)
            problem = next(checksum_problems(folder), None) if folder.is_dir() else "the view is missing"
            if problem is not None:
                raise DatasetError(
                    f"{folder} is no longer as it was published: {problem}. This command has changed nothing: restore the "
                    "folder, or remove it and repeat the command"
                )
        return True

    def report(self, shard: Shard) -> ShardReport:
        """Report of a finished shard.

        Raises:
            DatasetError: the shard holds other candidates than planned.
        """
        path = self.shard_folder(shard) / REPORT
        report = ShardReport.read(path)
        tried = (*report.episodes, *report.skipped)
        if sorted(map(str, tried)) != sorted(map(str, shard.candidates)):
            raise DatasetError(f"{path} does not list the planned candidates: remove {path.parent}")
        return report

    def shard_folder(self, shard: Shard) -> Path:
        """Where a shard is stored as soon as it is finished."""
        return self.folder / SHARDS / shard.name

    def has(self, shard: Shard) -> bool:
        """Whether a shard is finished."""
        return self.shard_folder(shard).exists()

    def count_finished(self) -> int:
        """Number of finished shards."""
        return sum(1 for _ in (self.folder / SHARDS).iterdir())

    def publish(self, folder: Path) -> None:
        """Move a finished dataset to its final place, and remove its shards."""
        with plain_write_errors(self.root):
            move_durably(folder, self.root)
            self.discard()

    def discard(self) -> None:
        """Remove the shards; `staged` removes the rest at its end."""
        shutil.rmtree(self.folder / SHARDS)


@contextmanager
def staged(root: Path, settings: GenerationSettings) -> Iterator[Staging]:
    """Own the staging folder of a dataset; what killed runs left is removed, finished shards stay for the next run.

    Raises:
        DatasetError: the place is taken or not writable, or holds an unfinished dataset of another origin or anything that
            this package did not make.
        BimanualError: another process owns it.
    """
    root = Path(os.path.realpath(root))
    folder = root.parent / f"{root.name}.partial"
    shards = folder / SHARDS
    with plain_write_errors(folder):
        if os.path.ismount(root) or folder.is_symlink():
            raise DatasetError(
                f"{root} must be a new folder beside {folder.name} on one disk, not a mount point or link: choose a "
                f"folder in it, for example --root={root / 'dataset'}"
            )
        folder.mkdir(parents=True, exist_ok=True)
        foreign = {path.name for path in folder.iterdir()} - {ORIGIN, SHARDS}
        if foreign := sorted(name for name in foreign if not name.startswith(LEFTOVERS)):
            raise DatasetError(
                f"{folder / foreign[0]} was not made by this command: move it away, since {folder.name} is removed when "
                "the dataset is complete"
            )
    with locked(folder):
        try:
            with plain_write_errors(folder):
                for leftover in [path for path in folder.iterdir() if path.name.startswith(LEFTOVERS)]:
                    shutil.rmtree(leftover) if leftover.is_dir() else leftover.unlink()
                shards.mkdir(exist_ok=True)
                origin = Origin.here(settings)
                if any(shards.iterdir()):
                    origin.refuse_at(folder, Origin.read(folder / ORIGIN))
                else:
                    origin.write(folder / ORIGIN)
            yield Staging(root, folder, settings, origin)
        finally:
            if not (shards.is_dir() and any(shards.iterdir())):
                shutil.rmtree(folder, ignore_errors=True)


def view_folder(root: Path, settings: GenerationSettings, view: str) -> Path:
    """Folder of one view of a dataset: `root` itself if it is the only one, otherwise `root/<view>`."""
    return root if settings.views == (view,) else root / view


@contextmanager
def new_folder(parent: Path) -> Iterator[Path]:
    """A temporary folder below `parent`, removed at the end unless it was moved away."""
    folder = Path(tempfile.mkdtemp(prefix=TEMPORARY, dir=parent))
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def place_shard(folder: Path, target: Path) -> None:
    """Move a finished shard to its final folder; an existing one is equivalent, and is kept."""
    if not target.exists():
        share_folder(folder)  # a temporary folder and LeRobot's videos are for their owner alone
        share_files(folder, "*.mp4")
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
        number = error.errno if isinstance(error, OSError) else None
        if number not in REFUSALS and (number in (errno.ENOSPC, errno.EDQUOT) or _is_full(place)):
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
