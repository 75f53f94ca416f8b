"""A small generated dataset, an executor in the test's own process, and flags of small policies."""

import contextlib
import shutil
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import pytest

from lerobot_bimanual.dataset.schema import View
from lerobot_bimanual.files import sha256
from lerobot_env_bimanual.commands.dataset_generate import DatasetGenerateConfig, dataset_generate
from lerobot_env_bimanual.generation import build
from lerobot_env_bimanual.generation.build import RecordShards
from lerobot_env_bimanual.generation.shard import Job, record_shard

TINY = {"channels": 8, "token_dim": 16, "heads": 2, "language_tokens": 4, "language_dim": 16}
TINY_PERACT = TINY | {"voxel_size": 10, "num_latents": 16, "latent_dim": 32, "depth": 1}
TINY_RVT = TINY | {"voxel_size": 15, "patch": 3, "attention_dim": 32, "depth": 2}


@pytest.fixture(scope="session")
def tiny_flags() -> dict[str, tuple[str, ...]]:
    """By type of keypose policy, flags of LeRobot's commands for a network as small as can be."""
    options = dict.fromkeys(("peract2", "peract_independent", "peract_lf"), TINY_PERACT)
    options["rvt_lf"] = TINY_RVT
    return {
        policy: (f"--policy.type={policy}", *(f"--policy.{name}={value}" for name, value in tiny.items()))
        for policy, tiny in options.items()
    }


@pytest.fixture(scope="session")
def small_generation() -> Callable[..., DatasetGenerateConfig]:
    """Builds options: three episodes of one task in two shards, both views, with small images of two cameras."""
    defaults = {
        **{"task": "lift_ball", "episodes": 3, "view": "both", "image_size": "24x32", "depth": True},
        **{"cameras": ("front", "left_wrist"), "intermediate": (0.5,), "episodes_per_shard": 2},
        **{"workers": 1, "repo_id": "local/small"},
    }
    return lambda root, **options: DatasetGenerateConfig(**defaults | options, root=root)


class PoolOfThisProcess(contextlib.nullcontext):
    """Takes the place of a pool of workers."""

    def __init__(self, *_, **__):
        super().__init__(self)

    def map(self, function, items, *_, **__):
        return map(function, items)


class RecordsHere:
    """An executor that records in the calling process, in some order, and is interrupted after `limit` shards."""

    def __init__(self, order: Callable[[Sequence[Job]], Iterator[Job]] = iter, limit: int = 1000):
        self.recorded: list[str] = []
        self._order, self._limit = order, limit
        self._patch = pytest.MonkeyPatch()

    def __enter__(self) -> RecordShards:
        self._patch.setattr(build, "WorkerPool", PoolOfThisProcess)
        return self._record

    def __exit__(self, *_) -> None:
        self._patch.undo()

    def _record(self, jobs: Sequence[Job], note: Callable[[int], object]) -> None:
        for job in self._order(jobs):
            note(record_shard(job))
            self.recorded.append(job[1].name)
            if len(self.recorded) == self._limit:
                raise KeyboardInterrupt


@pytest.fixture(scope="session")
def records_here() -> type[RecordsHere]:
    """The class of an executor that records in this process."""
    return RecordsHere


@pytest.fixture(scope="session")
def generated(small_generation, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Root of the small dataset, both views."""
    root = tmp_path_factory.mktemp("two words Ω") / "small"
    dataset_generate(small_generation(root))
    return root


@pytest.fixture
def copy(generated: Path, tmp_path: Path) -> Callable[[View], Path]:
    """Copies a view of the small dataset, to be damaged."""
    return lambda view: Path(shutil.copytree(generated / view, tmp_path / view))


@pytest.fixture(scope="session")
def tree_hashes():
    """Gives the hash of every file below a folder by its path there: equal exactly for equal datasets."""

    def hashes(root: Path) -> dict[str, str]:
        return {str(path.relative_to(root)): sha256(path) for path in root.rglob("*") if path.is_file()}

    return hashes
