"""Records shards on a ray cluster: one task per shard, on any machine; finished shards travel home through ray.

The machines share no file system. A task records into the temporary folder of its machine and returns the files of the
shard, which the driver writes. Ray runs the task of a dead worker again, and the driver takes
one result per shard, so nothing is lost and nothing is there twice.
"""

from __future__ import annotations

import logging
import socket
import tempfile
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from lerobot_bimanual.errors import BimanualError, DatasetError
from lerobot_bimanual.versions import installed_versions
from lerobot_env_bimanual.generation.build import RecordShards
from lerobot_env_bimanual.generation.plan import Shard
from lerobot_env_bimanual.generation.settings import GenerationSettings
from lerobot_env_bimanual.generation.shard import Job, record_shard
from lerobot_env_bimanual.generation.staging import new_folder, place_shard, plain_write_errors
from lerobot_env_bimanual.workers import ONE_THREAD

try:
    import ray
    from ray.exceptions import RayError, RayTaskError
except ModuleNotFoundError as error:
    if error.name != "ray":
        raise
    raise DatasetError(
        "--executor=ray needs ray, the same version on every machine: pip install 'lerobot_bimanual[ray]'"
    ) from None

MAX_RETRIES = 3
"""How often the task of a dead worker is run again."""


@contextmanager
def ray_executor(workers: int, address: str | None) -> Iterator[RecordShards]:
    """Record shards with the processors of a ray cluster; a `build.Executor`.

    Args:
        workers: most tasks at once; 0 leaves it to ray, which runs one per processor.
        address: of the cluster; None finds the one of `RAY_ADDRESS` or of this machine, or starts one for as long as
            the `with` block runs.

    Raises:
        DatasetError: there is no cluster at the address.
    """
    is_owner = not ray.is_initialized()
    if is_owner:
        threads = {"env_vars": ONE_THREAD}
        try:
            ray.init(address, log_to_driver=False, logging_level=logging.ERROR, runtime_env=threads)
        except (ConnectionError, RuntimeError, ValueError) as error:
            place = address or "any address"
            raise DatasetError(f"cannot reach a ray cluster at {place}: {error}") from error
    try:
        yield partial(_record, workers)
    finally:
        if is_owner:
            ray.shutdown()


def _record(workers: int, jobs: Sequence[Job], note: Callable[[int], object]) -> None:
    record = ray.remote(num_cpus=1, max_retries=MAX_RETRIES)(record_packed)
    waiting, running = deque(jobs), dict[Any, Job]()
    try:
        while waiting or running:
            while waiting and not 0 < workers <= len(running):
                job = waiting.popleft()
                running[record.remote(*job[:2], installed_versions())] = job
            finished, _ = ray.wait([*running])
            for task in finished:
                _, shard, target = running.pop(task)
                files, episodes = _result(task, shard)
                with plain_write_errors(target), new_folder(target.parent.parent) as folder:
                    for name, content in files.items():
                        (folder / name).parent.mkdir(parents=True, exist_ok=True)
                        (folder / name).write_bytes(content)
                    place_shard(folder, target)
                note(episodes)
    finally:
        for task in running:
            ray.cancel(task, force=True)


def record_packed(
    settings: GenerationSettings, shard: Shard, versions: Mapping[str, str]
) -> tuple[dict[str, bytes], int]:
    """The files of a shard, and its number of episodes; the task that ray runs on some machine.

    Raises:
        DatasetError: the shard cannot be recorded, or this machine has other versions than the driver.
    """
    if versions != (here := installed_versions()):
        raise DatasetError(f"{socket.gethostname()} has {here}, but the driver {versions}: install the same")
    with new_folder(Path(tempfile.gettempdir())) as folder:
        finished = folder / "shards" / shard.name
        finished.parent.mkdir()
        episodes = record_shard((settings, shard, finished))
        files = [path for path in finished.rglob("*") if path.is_file()]
        return {str(path.relative_to(finished)): path.read_bytes() for path in files}, episodes


def _result(task: Any, shard: Shard) -> tuple[dict[str, bytes], int]:
    try:
        return ray.get(task)
    except (RayTaskError, RayError) as error:
        cause = getattr(error, "cause", None)
        if isinstance(cause, BimanualError):
            raise cause from None
        raise DatasetError(
            f"shard {shard.name}: {cause or error}. Finished shards are kept: repeat the command"
        ) from error
