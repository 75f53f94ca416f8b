"""The verb `render`: pictures and films of the experts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from lerobot_bimanual.errors import BimanualError, check_range

if TYPE_CHECKING:
    from lerobot_env_bimanual.pictures.shooting import Order, Shot

FRAME_MS, PAUSE_MS = 90, 1500
WEBP_QUALITY = 50


@dataclass
class TaskRenderConfig:
    """Options of the verb `render`."""

    task: str = "all"  # task and suite names, comma separated
    variation: str = "any"  # index, or `any` for the one that the seed draws
    split: Literal["train", "val", "test"] = "val"  # the same seed means another episode in each
    seed: int = 0  # of each task's episode
    # `clearest` takes the fixed camera that shows most of what the episode moves.
    camera: Literal["clearest", "front", "left_shoulder", "right_shoulder", "left_wrist", "right_wrist"] = (
        "clearest"
    )
    size: str = "480x640"  # side in pixels, or HEIGHTxWIDTH
    # On one CPU core a picture costs 300 ms with shadows and anti-aliasing (`high`), 25 ms without.
    quality: Literal["observation", "high"] = "high"
    video: bool = True  # film the whole episode, 20 pictures per second of it
    workers: int = 0  # processes; 0 takes one per core
    output: Path = Path("outputs/render")  # folder of the files


def task_render(config: TaskRenderConfig) -> None:
    """Draw the experts at work: a contact sheet and a film per task, and a gallery of several.

    For each task, one episode becomes TASK.png (the start, and the scene at the end of every keypose) and TASK.mp4.
    Several tasks make a gallery tasks.jpg: a close-up of each in the chosen quality and, beside it, the camera's whole
    image as policies get it; and, with films, tasks.webp: all of them moving at once.

    An expert that does not solve its episode is an error, but its pictures are there to look at.

    Examples:
        lerobot-bimanual task render --task=lift_ball --seed=3
        lerobot-bimanual task render --video=false
        lerobot-bimanual task render --task=handover_item --variation=2 --camera=left_shoulder --quality=observation
    """
    from lerobot_bimanual.output_file import check_output_folder
    from lerobot_env_bimanual.pictures.shooting import shoot
    from lerobot_env_bimanual.workers import WorkerPool

    orders = _orders(config)
    check_output_folder(config.output)
    with WorkerPool(config.workers) as pool:
        shots = list(pool.map(shoot, orders, "render", "task", name=lambda order: order.task))
    if len(shots) > 1:
        _write_galleries(shots, config.output)
    print(f"{config.output}: pictures of {', '.join(order.task for order in orders)}")
    failures = [
        f"{order.task} failed at {order.split} seed {order.seed}, stage {shot.outcome.last_move!r}: "
        f"{shot.outcome.failure} (unmet: {', '.join(shot.outcome.unmet)}), see {order.sheet}"
        for order, shot in zip(orders, shots, strict=True)
        if not shot.outcome.success
    ]
    if failures:
        raise BimanualError("; ".join(["the expert did not solve its episode", *failures]))


def _orders(config: TaskRenderConfig) -> list[Order]:
    """One order per task, each checked before any process starts."""
    from lerobot_env_bimanual.pictures.shooting import Order
    from lerobot_env_bimanual.tasks.registry import get_task, resolve_tasks

    check_range("seed", config.seed, 0)
    orders = []
    for name in sorted(resolve_tasks(config.task), key=lambda name: get_task(name).spec.id):
        order = Order(
            task=name,
            variation=config.variation,
            split=config.split,
            seed=config.seed,
            camera=config.camera,
            size=config.size,
            quality=config.quality,
            film=config.video,
            folder=config.output,
        )
        if config.video and any(side % 2 for side in order.environment().options.size):
            raise BimanualError(f"size is {config.size!r}, but films need even sides; or use --video=false")
        orders.append(order)
    return orders


def _write_galleries(shots: Sequence[Shot], folder: Path) -> None:
    from lerobot_env_bimanual.pictures.layout import Panel, gallery, moving_gallery

    panels = [
        Panel(shot.thumbnail, shot.outcome.task, note="what policies see", beside=shot.policy_view)
        for shot in shots
    ]
    gallery(panels).save(folder / "tasks.jpg", quality=85)
    if all(shot.strip for shot in shots):
        first, *others = moving_gallery({shot.outcome.task: shot.strip for shot in shots})
        durations_ms = [FRAME_MS] * len(others) + [PAUSE_MS]  # the last one stands still for a while
        first.save(
            folder / "tasks.webp",
            save_all=True,
            append_images=others,
            duration=durations_ms,
            loop=0,
            quality=WEBP_QUALITY,
            method=4,
        )
