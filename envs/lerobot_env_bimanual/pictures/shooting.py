"""Plays an expert's episode and takes its pictures.

As for datasets, physics and images are apart: every tick's state is noted while the expert plays, and the moments
that somebody wants to see are rendered afterwards.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lerobot_bimanual.errors import BimanualError
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.outcome import Outcome
from lerobot_env_bimanual.experts.runner import expert
from lerobot_env_bimanual.pictures.layout import GREEN, INK, RED, Panel, contact_sheet
from lerobot_env_bimanual.pictures.take import take
from lerobot_env_bimanual.pictures.viewpoint import clearest_camera, close_up
from lerobot_env_bimanual.world.rendering import Renderer
from lerobot_env_bimanual.world.servo_commands import TICK_S
from lerobot_env_bimanual.world.video import VideoWriter

CLEAREST = "clearest"
THUMBNAIL_MOMENT = 0.8
"""Share of the episode that has passed in a task's one picture: the hands are on the things, the end is in sight."""
STRIP_LENGTH, STRIP_WIDTH = 40, 208
"""Pictures of an episode in the moving gallery, and their width in pixels."""


@dataclass(frozen=True)
class Order:
    """Which pictures to take.

    Attributes:
        task: registered task name.
        variation: index, or "any".
        split: split of the seed.
        seed: seed of the episode.
        camera: where from, or "clearest" for the fixed camera that shows most of what the episode moves.
        size: height x width in pixels, e.g. "480x640".
        quality: "observation" or "high".
        film: whether the whole episode is filmed.
        folder: where the files go; created if absent.
    """

    task: str
    variation: str
    split: str
    seed: int
    camera: str
    size: str
    quality: str
    film: bool
    folder: Path

    def environment(self) -> BimanualEnv:
        """The task's environment, not yet compiled; raises `BimanualError` if an option is outside its choices."""
        return BimanualEnv(
            self.task,
            variation=self.variation,
            split=self.split,
            image_size=self.size,
            obs="state",
            control_mode="keypose",
            render_quality=self.quality,
        )

    @property
    def sheet(self) -> Path:
        """File of the contact sheet."""
        return self.folder / f"{self.task}.png"


@dataclass(frozen=True, eq=False)
class Shot:
    """What came of an order.

    Attributes:
        outcome: of the episode.
        thumbnail: (height, width, 3) uint8, a close-up that shows what the task is about.
        policy_view: (256, 256, 3) uint8, the same moment as the camera shows it to policies.
        strip: `STRIP_LENGTH` small close-ups from start to end, (height, `STRIP_WIDTH`, 3) uint8; none without a film.
    """

    outcome: Outcome
    thumbnail: NDArray[np.uint8]
    policy_view: NDArray[np.uint8]
    strip: Sequence[NDArray[np.uint8]]


def shoot(order: Order) -> Shot:
    """Play an episode, write its contact sheet and perhaps its film.

    Raises:
        BimanualError: the episode cannot be set up, or not be drawn. It is raised as just that class, which
            survives the way home from a worker process.
    """
    try:
        return _shoot(order)
    except BimanualError as error:
        raise BimanualError(f"{order.task} at {order.split} seed {order.seed}: {error}") from None


def _shoot(order: Order) -> Shot:
    env = order.environment()
    taken = take(env, order.seed, expert())
    outcome, states, moves = taken.outcome, taken.states, taken.moves

    ends = [*(start for _, start in moves), outcome.ticks]
    camera = order.camera
    if camera == CLEAREST:
        camera = clearest_camera(env.scene, [states[end] for end in ends])
    options = env.options
    with Renderer(env.scene, (camera,), *options.size, order.quality) as renderer:

        def image(tick: int) -> NDArray[np.uint8]:
            env.scene.restore_state(states[tick])
            return renderer.render()[camera][0]

        order.folder.mkdir(parents=True, exist_ok=True)
        panels = [_panel(outcome, moves, number, image(end), end) for number, end in enumerate(ends)]
        contact_sheet(order.task, (env.task_description, _imprint(outcome, camera)), panels).save(order.sheet)
        moment = round(THUMBNAIL_MOMENT * outcome.ticks)
        thumbnail = image(moment)
        window = close_up(env.scene, camera, *options.size)
        strip: list[NDArray[np.uint8]] = []
        if order.film:
            _film(order, map(image, range(len(states))))
            moments = np.linspace(0, outcome.ticks, STRIP_LENGTH).round().astype(int)
            strip = [_small(image(tick)[window]) for tick in moments]
    with Renderer(env.scene, (camera,)) as renderer:  # in the size and quality of observations
        env.scene.restore_state(states[moment])
        policy_view = renderer.render()[camera][0]
    env.close()
    return Shot(outcome, thumbnail[window], policy_view, strip)


def _small(rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
    picture = Image.fromarray(rgb)
    height = round(STRIP_WIDTH * picture.height / picture.width)
    return np.asarray(picture.resize((STRIP_WIDTH, height), Image.Resampling.LANCZOS))


def _imprint(outcome: Outcome, camera: str) -> str:
    return (
        f"{outcome.split} seed {outcome.seed}, variation {outcome.variation}, {outcome.ticks * TICK_S:.1f} s, "
        f"seen from {camera}"
    )


def _panel(
    outcome: Outcome, moves: Sequence[tuple[str, int]], number: int, rgb: NDArray[np.uint8], tick: int
) -> Panel:
    """The start, or the end of a move; the last one bears the verdict."""
    caption, color = f"{number}. {moves[number - 1][0]}" if number else "start", INK
    if number == len(moves):
        verdict, color = ("success", GREEN) if outcome.success else ("failure", RED)
        caption = f"{caption} - {verdict}"
    return Panel(rgb, caption, f"{tick * TICK_S:.1f} s", color)


def _film(order: Order, images: Iterable[NDArray[np.uint8]]) -> None:
    writer = VideoWriter(order.folder, order.task)
    for rgb in images:
        writer.add(rgb)
    film = writer.close("complete")
    assert film is not None  # an episode has at least one state
    film.replace(order.folder / f"{order.task}.mp4")
