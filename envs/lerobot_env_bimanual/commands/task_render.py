"""The command `task render`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from lerobot_bimanual.errors import BimanualError, check_range

if TYPE_CHECKING:
    from lerobot_env_bimanual.rendering.task_pictures import RenderRequest


@dataclass
class TaskRenderConfig:
    """Flags of `task render`."""

    task: str = "all"  # task and suite names, comma separated
    variation: str = "any"  # index, or `any` for the one that the seed draws
    split: Literal["train", "val", "test"] = "test"  # a seed is another episode in each split
    first_seed: int = 0  # seed of each task's first episode
    episodes: int = 1  # episodes of each task
    # `clearest` takes the fixed camera that shows most of what the episode moves.
    camera: Literal["clearest", "front", "left_shoulder", "right_shoulder", "left_wrist", "right_wrist"] = (
        "clearest"
    )
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
    from lerobot_bimanual.files import check_output_folder
    from lerobot_env_bimanual.rendering.task_pictures import render_episode
    from lerobot_env_bimanual.workers import WorkerPool

    requests = _requests(config)
    check_output_folder(config.output)
    with WorkerPool(config.workers) as pool:
        outcomes = [
            *pool.map(render_episode, requests, "render", "episode", name=lambda each: each.stem.name)
        ]
    print(f"{config.output}: pictures of {', '.join(each.stem.name for each in requests)}")
    failures = [
        f"{each.task} failed at {each.split} seed {each.seed}, stage {one.last_move!r}: "
        f"{one.failure} (unmet: {', '.join(one.unmet)}), see {each.sheet}"
        for each, one in zip(requests, outcomes, strict=True)
        if not one.success
    ]
    if failures:
        raise BimanualError("; ".join(["the expert did not solve its episode", *failures]))


def _requests(config: TaskRenderConfig) -> Sequence[RenderRequest]:
    """One request per episode, each checked before any process starts."""
    from lerobot_env_bimanual.rendering.task_pictures import RenderRequest
    from lerobot_env_bimanual.tasks.registry import get_task, resolve_tasks

    check_range("first_seed", config.first_seed, 0)
    check_range("episodes", config.episodes, 1)
    requests = []
    for name in sorted(resolve_tasks(config.task), key=lambda name: get_task(name).spec.id):
        for seed in range(config.first_seed, config.first_seed + config.episodes):
            stem = name if config.episodes == 1 else f"{name}_seed{seed}"
            request = RenderRequest(
                task=name,
                variation=config.variation,
                split=config.split,
                seed=seed,
                camera=config.camera,
                size=config.image_size,
                quality=config.quality,
                video=config.video,
                stem=config.output / stem,
            )
            if config.video and any(side % 2 for side in request.environment().options.size):
                raise BimanualError(
                    f"image_size is {config.image_size!r}, but videos need even sides; or use --video=false"
                )
            requests.append(request)
    return requests
