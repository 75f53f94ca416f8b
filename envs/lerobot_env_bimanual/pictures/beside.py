"""Several players beside each other, in the same episode: one film and one contact sheet for all."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.pictures.layout import GREEN, INK, RED, Panel, contact_sheet, gallery
from lerobot_env_bimanual.pictures.take import Take
from lerobot_env_bimanual.pictures.viewpoint import clearest_camera
from lerobot_env_bimanual.world.rendering import Renderer
from lerobot_env_bimanual.world.servo_commands import TICK_S
from lerobot_env_bimanual.world.video import VideoWriter

MOMENTS = 6
"""Pictures of each player on the sheet, from the start to the end of its own episode."""
SIZE = (480, 640)

type Images = Callable[[Take, int], NDArray[np.uint8]]
"""The picture (height, width, 3) of an episode at a tick."""


def show_beside(
    env: BimanualEnv, takes: Mapping[str, Take], folder: Path, ticked: Callable[[], object] = lambda: None
) -> tuple[Path, Path]:
    """Write a film and a contact sheet.

    Args:
        env: environment of all the episodes; it is left in the last state that was drawn.
        takes: the same episode by name of its player, in the order from left to right and from top to bottom.
        folder: where the files go; created if absent.
        ticked: called after every picture of the film.

    Returns:
        The film and the sheet; their names are those of the task, its variation, split, seed and perturbation.

    Raises:
        BimanualError: they cannot be written, or not be drawn.
    """
    first = next(iter(takes.values()))
    outcome = first.outcome
    perturb = env.options.perturb
    name = f"{outcome.task}_v{outcome.variation}_{outcome.split}_seed{outcome.seed}"
    if perturb:
        name += f"_{perturb.replace(':', '').replace(',', '_')}"
    camera = clearest_camera(
        env.scene, [*first.states[:: len(first.states) // MOMENTS + 1], first.states[-1]]
    )
    with Renderer(env.scene, (camera,), *SIZE, env.options.render_quality) as renderer:

        def image(take: Take, tick: int) -> NDArray[np.uint8]:
            env.scene.restore_state(take.states[tick])
            return renderer.render()[camera][0]

        writer = VideoWriter(folder, name)
        for frame in film_frames(takes, image):
            writer.add(frame)
            ticked()
        film = writer.close("_and_".join(takes))
        assert film is not None  # an episode has at least one state
        sheet = folder / f"{name}_{'_and_'.join(takes)}.png"
        lines = (
            env.task_description,
            f"{outcome.split} seed {outcome.seed}, variation {outcome.variation}, "
            f"{f'with {perturb}' if perturb else 'the world as it is'}, seen from {camera}",
        )
        draw_sheet(outcome.task, lines, takes, image).save(sheet)
    return film, sheet


def film_frames(takes: Mapping[str, Take], image: Images) -> Iterator[NDArray[np.uint8]]:
    """One picture per tick of the longest episode; whoever has finished before stays as it ended."""
    ended: dict[str, Panel] = {}
    for tick in range(max(len(take.states) for take in takes.values())):
        panels = []
        for name, take in takes.items():
            if tick < len(take.states):
                ended[name] = panel(name, take, tick, image)
            panels.append(ended[name])
        frame = np.asarray(gallery(panels, columns=len(panels)))
        height, width = (side - side % 2 for side in frame.shape[:2])  # films need even sides
        yield frame[:height, :width]


def draw_sheet(title: str, lines: tuple[str, ...], takes: Mapping[str, Take], image: Images) -> Image.Image:
    """A row per player, at moments that divide its own episode evenly."""
    panels = [
        panel(name, take, round(tick), image)
        for name, take in takes.items()
        for tick in np.linspace(0, len(take.states) - 1, MOMENTS)
    ]
    return contact_sheet(title, lines, panels, columns=MOMENTS)


def panel(name: str, take: Take, tick: int, image: Images) -> Panel:
    """A player at a tick; at the last one with the verdict."""
    if tick < len(take.states) - 1:
        return Panel(image(take, tick), name, f"{tick * TICK_S:.1f} s", INK)
    verdict, color = ("success", GREEN) if take.outcome.success else ("failure", RED)
    return Panel(image(take, tick), f"{name} - {verdict}", f"{tick * TICK_S:.1f} s", color)
