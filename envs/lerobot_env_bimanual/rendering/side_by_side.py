"""Several rollouts of one episode side by side: one video and one contact sheet for all."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.rendering.layout import GREEN, INK, RED, Panel, contact_sheet, gallery
from lerobot_env_bimanual.rendering.rollout import Recording, Rollout
from lerobot_env_bimanual.rendering.viewpoint import clearest_camera
from lerobot_env_bimanual.world.rendering import Renderer
from lerobot_env_bimanual.world.servo_commands import TICK_S
from lerobot_env_bimanual.world.video import VideoWriter

N_MOMENTS = 6
"""Pictures of each rollout on the sheet, from its start to its end."""
SIZE = (480, 640)

type Player = tuple[Recording, bool]
"""States of an episode, and whether it was solved."""


def write_side_by_side(env: BimanualEnv, rollouts: Mapping[str, Rollout], folder: Path) -> tuple[Path, Path]:
    """Write a video and a contact sheet, with a progress bar.

    Args:
        env: environment of all the rollouts; it is left in the last state that was rendered.
        rollouts: the same episode by name of the player, in the order from left to right and from top to bottom.
        folder: where the files go; created if absent.

    Returns:
        The video and the sheet; their names are those of the task, its variation, split, seed and perturbation.

    Raises:
        BimanualError: they cannot be written, or not be rendered.
    """
    first, perturb = next(iter(rollouts.values())), env.options.perturb
    players = {name: (each, each.outcome.success) for name, each in rollouts.items()}
    seed, split, variation = first.outcome.seed, env.options.split, first.outcome.variation
    name = f"{env.task}_v{variation}_{split}_seed{seed}"
    if perturb:
        name += f"_{perturb.replace(':', '').replace(',', '_')}"
    camera = clearest_camera(
        env.scene, [*first.states[:: len(first.states) // N_MOMENTS + 1], first.states[-1]]
    )
    with Renderer(env.scene, (camera,), *SIZE, env.options.render_quality) as renderer:
        writer = VideoWriter(folder, name)
        n_frames = max(len(each.states) for each in rollouts.values())
        for frame in tqdm(frames(env, renderer, players), "video", n_frames, unit="frame"):
            writer.add(frame)
        video = writer.close("_and_".join(rollouts))
        assert video is not None  # an episode has at least one state
        panels = [
            panel(env, renderer, player, players[player], round(tick))
            for player, each in rollouts.items()
            for tick in np.linspace(0, len(each.states) - 1, N_MOMENTS)
        ]
    lines = (
        env.task_description,
        f"{split} seed {seed}, variation {variation}, {f'with {perturb}' if perturb else 'nominal'}, seen from {camera}",
    )
    sheet = folder / f"{name}_{'_and_'.join(rollouts)}.png"
    contact_sheet(env.task, lines, panels, columns=N_MOMENTS).save(sheet)
    return video, sheet


def frames(
    env: BimanualEnv, renderer: Renderer, players: Mapping[str, Player], every: int = 1, width: int = 400
) -> Iterator[NDArray[np.uint8]]:
    """One frame per tick, or every so many ticks, of the longest episode; one that ended earlier keeps its last picture.

    Args:
        env: environment of all the episodes.
        renderer: renders its scene with one camera.
        players: by name, from left to right.
        every: ticks from one frame to the next; the last tick has a frame in any case.
        width: of each picture, pixels.
    """
    last = max(len(recording.states) for recording, _ in players.values()) - 1
    ended: dict[str, Panel] = {}
    for tick in (*range(0, last, every), last):
        panels = []
        for name, player in players.items():
            end = len(player[0].states) - 1
            if tick < end or name not in ended:
                shown = panel(env, renderer, name, player, min(tick, end))
            else:
                shown = ended[name]
            if tick >= end:
                ended[name] = shown
            panels.append(shown)
        frame = np.asarray(gallery(panels, columns=len(panels), panel_width=width))
        height, width_px = (side - side % 2 for side in frame.shape[:2])  # videos need even sides
        yield frame[:height, :width_px]


def panel(env: BimanualEnv, renderer: Renderer, name: str, player: Player, tick: int) -> Panel:
    """A player's scene at a tick; at the last one with the verdict."""
    recording, success = player
    env.scene.restore_state(recording.states[tick])
    rgb = renderer.render()[renderer.cameras[0]][0]
    note = f"{tick * TICK_S:.1f} s, keypose {recording.keyposes[tick]}"
    if tick < len(recording.states) - 1:
        return Panel(rgb, name, note, INK)
    verdict, color = ("success", GREEN) if success else ("failure", RED)
    return Panel(rgb, f"{name} - {verdict}", note, color)
