"""The verb `generate`: expert demonstrations as a LeRobot dataset."""

from __future__ import annotations

import shlex
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.commands.push import PushConfig, push

if TYPE_CHECKING:
    from lerobot_env_bimanual.generation.executor import Executor
    from lerobot_env_bimanual.generation.settings import GenerationSettings


@dataclass
class GenerateConfig:
    """Options of the verb `generate`."""

    task: str = "all"  # task and suite names, comma separated
    variation: str = "any"  # index, or `any` for equal shares of all variations
    episodes: int = 100  # successful episodes per task
    split: Literal["train", "val", "test"] = "train"  # the same seeds mean other episodes in each
    first_seed: int = 0  # seed of each task's first episode; the next ones follow
    # What is stored: `frames` (every tick, as video), `keyframes` (start, reached keyposes and end, lossless), or
    # both from one run, in root/frames and root/keyframes.
    view: Literal["frames", "keyframes", "both"] = "both"
    image_size: str = "256"  # side in pixels, or HEIGHTxWIDTH
    cameras: tuple[str, ...] = CAMERA_NAMES  # whose images are stored; calibration covers all five
    # Further rows of `keyframes`, at these fractions of each stage's motion, e.g. 0.35,0.7.
    intermediate: tuple[str, ...] = ()
    # Voxels per axis to which keyposes are rounded before they are executed and stored; 0 leaves them exact.
    discretise: int = 0
    # Who records: `processes` of this machine, or the machines of a `ray` cluster (extra lerobot_bimanual[ray], the
    # same versions installed everywhere). Shards travel through ray; ROOT need not be shared between the machines.
    executor: Literal["processes", "ray"] = "processes"
    # Of the ray cluster; by default that of RAY_ADDRESS or of this machine, or else one is started for this run, as
    # `local` always does.
    ray_address: str | None = None
    workers: int = 0  # shards recorded at the same time; 0 takes one per core, of the whole cluster with ray
    episodes_per_shard: int = 10  # episodes per file, and per unit of work that a crash can lose
    root: Path = field(kw_only=True)  # new folder of the dataset
    repo_id: str | None = None  # LeRobot's name of the dataset; by default local/ and the folder's name
    push_to_hub: bool = (
        False  # upload the complete dataset to repo_id on the Hugging Face Hub; takes a single view
    )


def generate(config: GenerateConfig) -> None:
    """Record expert demonstrations as a LeRobot dataset.

    The content depends on the options and versions alone, not on who records it and with how many workers. Seeds
    that the expert does not solve are listed with their reason, and the next seed takes their place.

    The dataset grows in ROOT.partial and appears at ROOT in one move. After a crash or an interruption the same
    command goes on where it stopped; shards that were damaged meanwhile are named and recorded again.

    Examples:
        lerobot-bimanual generate --task=lift_ball --episodes=50 --root=data/lift_ball
        lerobot-bimanual generate --task=all --view=keyframes --image_size=128 --root=data/all --repo_id=me/all
        lerobot-bimanual generate --task=all --executor=ray --ray_address=10.0.0.1:6379 --root=data/all
    """
    from lerobot_bimanual.dataset.hub import prepare_push
    from lerobot_env_bimanual.generation.building import build_dataset
    from lerobot_env_bimanual.generation.settings import GenerationSettings
    from lerobot_env_bimanual.generation.staging import Staging

    settings = GenerationSettings.parse(config)
    if config.push_to_hub:
        prepare_push(settings.repo_id, settings.views)
    with Staging(config.root, settings) as staging:
        if staging.is_published():
            staging.remove()
            print(f"{config.root} is already complete: {settings.total_episodes} episodes")
        else:
            start_s = time.monotonic()
            with make_executor(config) as executor:
                command = regeneration_command(settings, config.root)
                reports = build_dataset(settings, command, staging, executor)
                cpu_minutes = executor.cpu_seconds / 60
            minutes = (time.monotonic() - start_s) / 60
            skipped = [seed for report in reports for seed in report.skipped]
            print(f"{config.root}: {settings.total_episodes} episodes, {len(skipped)} seeds skipped")
            print(f"{minutes:.2f} minutes, {cpu_minutes:.2f} of CPU time; {_megabytes(config.root):.1f} MB")
            for seed in skipped:
                print(f"  {seed.task} seed {seed.seed} (variation {seed.variation}): {seed.reason}")
    if config.push_to_hub:
        push(PushConfig(root=config.root, repo_id=settings.repo_id))


def _megabytes(folder: Path) -> float:
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file()) / 1e6


def make_executor(config: GenerateConfig) -> Executor:
    """Who records, as the options say.

    Raises:
        DatasetError: ray is wanted but not installed, or there is no cluster at the address.
    """
    if config.executor == "ray":
        from lerobot_env_bimanual.generation.ray_executor import RayExecutor

        return RayExecutor(config.workers, config.ray_address)
    from lerobot_env_bimanual.generation.process_executor import ProcessExecutor

    return ProcessExecutor(config.workers)


def regeneration_command(settings: GenerationSettings, root: Path) -> str:
    """The command line that makes this dataset, with every option that decides its content."""
    flags = {
        "task": ",".join(settings.tasks),
        "variation": settings.variation,
        "episodes": settings.episodes,
        "split": settings.split,
        "first_seed": settings.first_seed,
        "view": settings.views[0] if len(settings.views) == 1 else "both",
        "image_size": f"{settings.height}x{settings.width}",
        "cameras": ",".join(settings.cameras),
        "intermediate": ",".join(map(str, settings.intermediate)),
        "discretise": settings.discretise,
        "episodes_per_shard": settings.episodes_per_shard,
        "root": root.name,
        "repo_id": settings.repo_id,
    }
    words = [f"--{name}={value}" for name, value in flags.items() if value != ""]
    return shlex.join(["lerobot-bimanual", "generate", *words])
