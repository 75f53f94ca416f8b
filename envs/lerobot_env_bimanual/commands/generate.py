"""The verb `generate`: expert demonstrations as a LeRobot dataset."""

from __future__ import annotations

import shlex
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from lerobot_bimanual.cameras import CAMERA_NAMES

if TYPE_CHECKING:
    from lerobot_env_bimanual.generation.candidates import Shard, ShardReport
    from lerobot_env_bimanual.generation.settings import GenerationSettings
    from lerobot_env_bimanual.generation.staging import Staging
    from lerobot_env_bimanual.generation.workers import Workers


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
    workers: int = 0  # processes; 0 takes one per core
    episodes_per_shard: int = 10  # episodes per file, and per unit of work that a crash can lose
    root: Path = field(kw_only=True)  # new folder of the dataset
    repo_id: str | None = None  # LeRobot's name of the dataset; by default local/ and the folder's name


def generate(config: GenerateConfig) -> None:
    """Record expert demonstrations as a LeRobot dataset.

    The content depends on the options and versions alone, not on the number of workers. Seeds that the expert does
    not solve are listed with their reason, and the next seed takes their place.

    The dataset grows in ROOT.partial and appears at ROOT in one move. After a crash or an interruption the same
    command goes on where it stopped.

    Examples:
        lerobot-bimanual generate --task=lift_ball --episodes=50 --root=data/lift_ball
        lerobot-bimanual generate --task=all --view=keyframes --image_size=128 --root=data/all --repo_id=me/all
    """
    from lerobot_env_bimanual.generation.settings import GenerationSettings
    from lerobot_env_bimanual.generation.staging import Staging
    from lerobot_env_bimanual.generation.workers import Workers

    settings = GenerationSettings.parse(config)
    with Staging(config.root, settings) as staging:
        if staging.is_published():
            staging.remove()
            print(f"{config.root} is already complete: {settings.total_episodes} episodes")
            return
        with Workers(config.workers) as workers:
            shards = _record(settings, staging, workers)
            _merge_and_publish(
                settings, regeneration_command(settings, config.root), shards, staging, workers
            )
    skipped = [seed for _, report in shards for seed in report.skipped]
    print(f"{config.root}: {settings.total_episodes} episodes, {len(skipped)} seeds skipped")
    for seed in skipped:
        print(f"  {seed.task} seed {seed.seed} (variation {seed.variation}): {seed.reason}")


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


def _record(
    settings: GenerationSettings, staging: Staging, workers: Workers
) -> list[tuple[Shard, ShardReport]]:
    """Record rounds of shards until every episode is there; shards of an earlier run are taken over."""
    from tqdm import tqdm

    from lerobot_env_bimanual.generation.candidates import next_round

    finished: list[tuple[Shard, ShardReport]] = []
    with tqdm(total=settings.total_episodes, unit="demo", smoothing=0) as bar:
        while planned := next_round(settings, [report for _, report in finished], len(finished)):
            reports = {shard.name: staging.report(shard.name) for shard in planned}
            missing = [shard for shard in planned if reports[shard.name] is None]
            resumed = sum(len(report.episodes) for report in reports.values() if report is not None)
            bar.initial += resumed
            bar.update(resumed)
            for _ in workers.record(settings, missing, staging.shard_folder):
                bar.update(bar.initial + workers.successes - bar.n)
                rate_per_h = 3600 * workers.successes / max(bar.format_dict["elapsed"], 1e-9)
                bar.set_postfix_str(f"{rate_per_h:.0f} demos/h", refresh=False)
            finished += [(shard, _existing(staging.report(shard.name))) for shard in planned]
    return finished


def _existing(report: ShardReport | None) -> ShardReport:
    assert report is not None  # the worker put it there before it came back
    return report


def _merge_and_publish(
    settings: GenerationSettings,
    command: str,
    shards: list[tuple[Shard, ShardReport]],
    staging: Staging,
    workers: Workers,
) -> None:
    from lerobot_env_bimanual.generation.staging import new_folder

    folders = [(staging.shard_folder(shard.name), report) for shard, report in shards]
    with new_folder(staging.folder) as temporary:
        merged = temporary / "dataset"
        for _ in workers.merge(settings, command, folders, merged, temporary / "cache"):
            pass
        staging.publish(merged)
