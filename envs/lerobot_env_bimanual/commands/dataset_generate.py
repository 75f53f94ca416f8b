"""The command `dataset generate`: expert demonstrations as a LeRobot dataset."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.dataset.schema import VIEWS
from lerobot_bimanual.errors import check_range
from lerobot_bimanual.terminal import show_next
from lerobot_env_bimanual.options import EnvOptions
from lerobot_env_bimanual.tasks.registry import resolve_tasks

if TYPE_CHECKING:
    from lerobot_env_bimanual.generation.build import Executor
    from lerobot_env_bimanual.generation.settings import GenerationSettings


@dataclass
class DatasetGenerateConfig:
    """Options of the command `dataset generate`."""

    task: str = field(kw_only=True)  # task and suite names, comma separated
    # Index, several separated by commas for equal shares of them, or `any` for all variations.
    variation: str = "any"
    episodes: int = 100  # successful episodes per task
    split: Literal["train", "val", "test"] = "train"  # the same seeds mean other episodes in each
    first_seed: int = 0  # seed of each task's first episode; the next ones follow
    # What is stored: `frames` (every tick, as video), `keyframes` (start, reached keyposes and end, lossless), or
    # both from one run, in root/frames and root/keyframes.
    view: Literal["frames", "keyframes", "both"] = "keyframes"
    image_size: str = "256"  # side in pixels, or HEIGHTxWIDTH
    cameras: tuple[str, ...] = CAMERA_NAMES  # whose images are stored; calibration covers all five
    # Store depth beside the colours. By default only in `keyframes`: keypose policies need it, but LeRobot's
    # own policies, which learn from `frames`, would read it as colours.
    depth: bool | None = None
    # Further rows of `keyframes`, at these fractions of each stage's motion, e.g. 0.35,0.7.
    intermediate: tuple[float, ...] = ()
    # Voxels per axis to which keyposes are rounded before they are executed and stored; 0 leaves them exact.
    discretise: int = 0
    # Perturbations AXIS:LEVEL, several separated by commas. By default episodes are nominal.
    perturb: str = ""
    # in `varied` sizes, heights and places of things differ more
    setting: Literal["standard", "varied"] = "standard"
    # `several`: scenes that allow all plans of their task are recorded by each of them; the column `plan`
    # says which.
    plans: Literal["one", "several"] = "one"
    workers: int = 0  # shards recorded at the same time; 0 takes one per core
    episodes_per_shard: int = 10  # episodes per file, and per unit of work that a crash can lose
    root: Path = field(kw_only=True)  # new folder of the dataset
    repo_id: str | None = None  # LeRobot's name of the dataset; without it, local/ and the folder's name


def dataset_generate(config: DatasetGenerateConfig) -> None:
    """Record expert demonstrations as a LeRobot dataset.

    The content depends on the options and versions alone, not on who records it and with how many workers. Seeds
    that the expert does not solve are listed with their reason, and the next seed takes their place.

    The dataset grows in ROOT.partial and appears at ROOT in one move. After a crash or an interruption the same
    command continues where it stopped. An existing dataset is read once more: it is complete if every file is as it
    was published.

    Examples:
        lerobot-bimanual dataset generate --task=lift_ball --episodes=50 --root=data/lift_ball
        lerobot-bimanual dataset generate --task=all --image_size=128 --root=data/all --repo_id=me/all
        lerobot-bimanual dataset generate --task=lift_ball --view=both --root=data/lift_ball_both
    """
    from lerobot_env_bimanual.generation.build import process_executor

    make_dataset(settings_of(config), config.root, process_executor(config.workers))


def settings_of(config: DatasetGenerateConfig) -> GenerationSettings:
    """The dataset that the options ask for.

    Raises:
        BimanualError: an option is outside its choices; the message lists them.
    """
    from lerobot_env_bimanual.generation.settings import GenerationSettings, repo_id_of

    check_range("workers", config.workers, 0)
    cameras = ",".join(config.cameras)
    options = EnvOptions(cameras=cameras, image_size=config.image_size, perturb=config.perturb)
    # Options that are settings of the same name are taken as they are, but for those that follow.
    given = {name: value for name, value in vars(config).items() if name in GenerationSettings.model_fields}
    by_default = None if config.view == "both" else config.view == "keyframes"
    return GenerationSettings.of(
        **given
        | {
            "depth": by_default if config.depth is None else config.depth,
            "tasks": resolve_tasks(config.task),
            "views": VIEWS if config.view == "both" else (config.view,),
            "cameras": options.camera_names,
            "height": options.size[0],
            "width": options.size[1],
            "perturb": options.perturb,
            "repo_id": repo_id_of(config.repo_id, config.root),
        }
    )


def make_dataset(settings: GenerationSettings, root: Path, executor: Executor) -> None:
    """Make a dataset in the folder `root`, or continue an unfinished one, unless it is complete; prints a summary.

    Raises:
        BimanualError: the folder is taken, damaged or not writable, or an episode cannot be recorded.
    """
    from lerobot_env_bimanual.generation.build import build_dataset
    from lerobot_env_bimanual.generation.staging import staged

    start_s = time.monotonic()
    with staged(root, settings) as staging:
        if staging.is_published():
            staging.discard()
            print(f"{root} is already complete: {settings.total_episodes} episodes")
            return
        try:
            with executor as record:
                reports = build_dataset(staging, record)
        except KeyboardInterrupt:
            raise KeyboardInterrupt(
                f"{staging.count_finished()} shards are finished; the same command continues from there"
            ) from None
    skipped = [seed for report in reports for seed in report.skipped]
    minutes = (time.monotonic() - start_s) / 60
    megabytes = sum(path.stat().st_size for path in root.rglob("*") if path.is_file()) / 1e6
    print(
        f"{root}: {settings.total_episodes} episodes, {len(skipped)} seeds skipped; {minutes:.1f} minutes, {megabytes:.1f} MB"
    )
    for seed in skipped:
        print(f"  {seed.task} seed {seed.seed} (variation {seed.variation}): {seed.reason}")
    show_next("lerobot-bimanual", "dataset", "verify", f"--root={root}")
