"""The command `task render`."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from lerobot_bimanual.errors import BimanualError, check_range
from lerobot_bimanual.files import check_output_folder
from lerobot_bimanual.terminal import show_next
from lerobot_env_bimanual.options import EnvOptions
from lerobot_env_bimanual.tasks.registry import get_task, resolve_tasks
from lerobot_env_bimanual.workers import WorkerPool

if TYPE_CHECKING:
    from lerobot_bimanual.results.expert_report import EpisodeOutcome


@dataclass
class TaskRenderConfig:
    """Flags of `task render`."""

    task: str = "all"  # task and suite names, comma separated
    variation: str = "any"  # index, or `any` for the one that the seed draws
    split: Literal["train", "val", "test"] = "test"  # a seed is another episode in each split
    # in `varied` sizes, heights and places of things differ more
    setting: Literal["standard", "varied"] = "standard"
    first_seed: int = 0  # seed of each task's first episode
    episodes: int = 1  # episodes of each task
    # which camera sees it; a fixed one turns and zooms to hands and moved things
    camera: Literal["front", "left_shoulder", "right_shoulder", "left_wrist", "right_wrist"] = "front"
    image_size: str = "480x640"  # side in pixels, or HEIGHTxWIDTH
    # On one CPU core a picture costs 300 ms with shadows and anti-aliasing (`high`), 25 ms without.
    quality: Literal["observation", "high"] = "high"
    video: bool = True  # make a video of the whole episode, 20 frames per second of it
    workers: int = 0  # processes; 0 takes one per core
    output: Path = Path("outputs/render")  # folder of the files


def task_render(config: TaskRenderConfig) -> None:
    """Render the experts at work: a contact sheet and a video per episode.

    For each task, an episode becomes TASK.png (the start, and the scene at the end of every keypose) and TASK.mp4; with
    several episodes, TASK_seedSEED.png and .mp4.

    An expert that does not solve its episode is an error, but its pictures are written.

    Examples:
        lerobot-bimanual task render --task=lift_ball --first_seed=3
        lerobot-bimanual task render --video=false
        lerobot-bimanual task render --task=handover_item --variation=2 --camera=left_shoulder --quality=observation
    """
    options, jobs = _plan(config)
    check_output_folder(config.output)
    with WorkerPool(config.workers) as pool:
        render = partial(_render, config, options)
        outcomes = [*pool.map(render, jobs, "render", "episode", name=lambda job: job[2].name)]
    print(f"{config.output}: pictures of {', '.join(stem.name for *_, stem in jobs)}")
    failures = [
        f"{task} failed at {config.split} seed {seed}, stage {one.last_move!r}: "
        f"{one.failure} (unmet: {', '.join(one.unmet)}), see {stem}.png"
        for (task, seed, stem), one in zip(jobs, outcomes, strict=True)
        if not one.success
    ]
    if failures:
        raise BimanualError("; ".join(["the expert did not solve its episode", *failures]))
    show_next("lerobot-bimanual", "dataset", "generate", f"--task={config.task}", "--root=data")


type Job = tuple[str, int, Path]
"""Task, seed of the episode, and path of its files without their suffix."""


def _plan(config: TaskRenderConfig) -> tuple[EnvOptions, list[Job]]:
    """Options of the environments, and one job per episode, all checked before any process starts."""
    check_range("first_seed", config.first_seed, 0)
    check_range("episodes", config.episodes, 1)
    options = EnvOptions(
        variation=config.variation,
        split=config.split,
        setting=config.setting,
        image_size=config.image_size,
        obs="state",
        control_mode="keypose",
        render_quality=config.quality,
    )
    jobs = []
    for name in sorted(resolve_tasks(config.task), key=lambda name: get_task(name).spec.id):
        get_task(name).spec.variation_index(options.variation)
        for seed in range(config.first_seed, config.first_seed + config.episodes):
            stem = config.output / (name if config.episodes == 1 else f"{name}_seed{seed}")
            jobs.append((name, seed, stem))
    return options, jobs


def _render(config: TaskRenderConfig, options: EnvOptions, job: Job) -> EpisodeOutcome:
    """Let the expert play an episode; write its contact sheet and, if requested, its video.

    Raises:
        BimanualError: the episode cannot be set up, or not be rendered.
    """
    from lerobot_env_bimanual.env import BimanualEnv
    from lerobot_env_bimanual.experts.runner import expert
    from lerobot_env_bimanual.rendering.episode_pictures import write_pictures
    from lerobot_env_bimanual.rendering.rollout import rollout

    task, seed, stem = job
    env = BimanualEnv(task, options=options)
    try:
        played = rollout(env, seed, expert())
    except BimanualError as error:
        raise BimanualError(f"{task} at {options.split} seed {seed}: {error}") from None
    write_pictures(env, {"expert": played}, stem, config.camera, options.size, config.video)
    env.close()
    return played[1]
