"""Record a dataset with all machines of a ray cluster: `dataset generate`, whose shards other machines record.

pip install 'ray>=2.40'                # the same version on every machine, in a clone of the same commit
RAY_ADDRESS=10.0.0.1:6379 python examples/11_ray_cluster.py --task=all --root=data/all

Flags are those of `dataset generate`; `--workers` is the most tasks at once. Without RAY_ADDRESS it takes the cluster of
this machine, or starts one. A task records one shard into the temporary folder of its machine and returns the files, so
no file system is shared. Ray runs the task of a dead worker again, and one result per shard is taken.
"""

import socket
import sys
import tempfile
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import ray

from lerobot_bimanual.cli.flags import parse_flags
from lerobot_bimanual.distributions import installed_versions
from lerobot_env_bimanual.commands.dataset_generate import DatasetGenerateConfig, make_dataset, settings_of
from lerobot_env_bimanual.generation.shard import record_shard
from lerobot_env_bimanual.generation.staging import new_folder, place_shard, plain_write_errors
from lerobot_env_bimanual.workers import ONE_THREAD

MAX_RETRIES = 3
"""How often the task of a dead worker is run again."""


def record_packed(settings, shard, versions) -> tuple[dict[str, bytes], int]:
    """The files of a shard, and its number of episodes; the task that ray runs on some machine."""
    if versions != (here := installed_versions()):  # whose episodes could be other ones
        raise RuntimeError(f"{socket.gethostname()} has {here}, but the driver {versions}: install the same")
    with new_folder(Path(tempfile.gettempdir())) as folder:
        finished = folder / "shards" / shard.name
        finished.parent.mkdir()
        episodes = record_shard((settings, shard, finished))
        files = [path for path in finished.rglob("*") if path.is_file()]
        return {str(path.relative_to(finished)): path.read_bytes() for path in files}, episodes


@contextmanager
def ray_executor(workers: int) -> Iterator:
    """Record shards with the processors of a cluster, on `workers` of them at most, or on all."""
    is_owner = not ray.is_initialized()
    if is_owner:
        ray.init(log_to_driver=False, runtime_env={"env_vars": ONE_THREAD})
    task = ray.remote(num_cpus=1, max_retries=MAX_RETRIES)(record_packed)

    def record(jobs, note) -> None:
        waiting, running = deque(jobs), {}
        while waiting or running:
            while waiting and not 0 < workers <= len(running):
                job = waiting.popleft()
                running[task.remote(*job[:2], installed_versions())] = job
            for finished in ray.wait([*running])[0]:
                target = running.pop(finished)[2]
                files, episodes = ray.get(finished)
                with plain_write_errors(target), new_folder(target.parent.parent) as folder:
                    for name, content in files.items():
                        (folder / name).parent.mkdir(parents=True, exist_ok=True)
                        (folder / name).write_bytes(content)
                    place_shard(folder, target)
                note(episodes)

    try:
        yield record
    finally:
        if is_owner:
            ray.shutdown()


if __name__ == "__main__":
    config = parse_flags(DatasetGenerateConfig, sys.argv[1:])
    make_dataset(settings_of(config), config.root, ray_executor(config.workers))
