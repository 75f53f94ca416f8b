"""Several rollouts of one episode side by side: one video and one contact sheet for all."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from lerobot_bimanual.results.expert_report import EpisodeOutcome
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.rendering.layout import GREEN, INK, RED, Panel, contact_sheet, gallery
from lerobot_env_bimanual.rendering.rollout import Rollout
from lerobot_env_bimanual.rendering.viewpoint import Frame, clearest_camera, frame_of
from lerobot_env_bimanual.world.rendering import Renderer
from lerobot_env_bimanual.world.servo_commands import TICK_S
from lerobot_env_bimanual.world.video import VideoWriter

N_MOMENTS = 6
"""Pictures of each rollout on the sheet, from its start to its end."""
SIZE = (480, 640)


def write_side_by_side(
    env: BimanualEnv, rollouts: Mapping[str, Rollout[EpisodeOutcome]], folder: Path
) -> tuple[Path, Path]:
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
    (first, outcome), perturb = next(iter(rollouts.values())), env.options.perturb
    seed, split, variation = outcome.seed, env.options.split, outcome.variation
    name = f"{env.task}_v{variation}_{split}_seed{seed}"
    if perturb:
        name += f"_{perturb.replace(':', '').replace(',', '_')}"
    moments = [*first.states[:: len(first.states) // N_MOMENTS + 1], first.states[-1]]
    camera = clearest_camera(env.scene, moments)
    frame = frame_of(env.scene, camera, moments, SIZE)
    with Renderer(env.scene, (camera,), *SIZE, env.options.render_quality) as renderer:
        writer = VideoWriter(folder, name, caption=f"{env.task} v{variation} {split} seed{seed}")
        n_frames = max(len(recording.states) for recording, _ in rollouts.values())
        shown = frames(env, renderer, rollouts, frame=frame)
        for picture in tqdm(shown, "video", n_frames, unit="frame"):
            writer.add(picture)
        video = writer.close("_and_".join(rollouts))
        assert video is not None  # an episode has at least one state
        panels = [
            panel(env, renderer, player, each, round(tick), frame)
            for player, each in rollouts.items()
            for tick in np.linspace(0, len(each[0].states) - 1, N_MOMENTS)
        ]
    lines = (
        env.task_description,
        f"{split} seed {seed}, variation {variation}, {f'with {perturb}' if perturb else 'nominal'}, seen from {camera}",
    )
    sheet = folder / f"{name}_{'_and_'.join(rollouts)}.png"
    contact_sheet(env.task, lines, panels, columns=N_MOMENTS).save(sheet)
    return video, sheet


def frames(
    env: BimanualEnv,
    renderer: Renderer,
    rollouts: Mapping[str, Rollout],
    every: int = 1,
    width: int = 400,
    frame: Frame | None = None,
) -> Iterator[NDArray[np.uint8]]:
    """One frame per tick, or every so many ticks, of the longest episode; one that ended earlier keeps its last picture.

    Args:
        env: environment of all the episodes.
        renderer: renders its scene with one camera.
        rollouts: by name of the player, from left to right.
        every: ticks from one frame to the next; the last tick has a frame in any case.
        width: of each picture, pixels.
        frame: that the camera is given; None leaves it as it is.
    """
    last = max(len(recording.states) for recording, _ in rollouts.values()) - 1

    @lru_cache(2 * len(rollouts))
    def shown(name: str, tick: int) -> Panel:
        return panel(env, renderer, name, rollouts[name], tick, frame)

    for tick in (*range(0, last, every), last):
        panels = [
            shown(name, min(tick, len(recording.states) - 1)) for name, (recording, _) in rollouts.items()
        ]
        picture = np.asarray(gallery(panels, columns=len(panels), panel_width=width))
        height, width_px = (side - side % 2 for side in picture.shape[:2])  # videos need even sides
        yield picture[:height, :width_px]


def panel(
    env: BimanualEnv, renderer: Renderer, name: str, rollout: Rollout, tick: int, frame: Frame | None = None
) -> Panel:
    """A player's scene at a tick, within a camera's frame; at the last one with the verdict."""
    recording, episode = rollout
    env.scene.restore_state(recording.states[tick])
    env.scene.appearance = env.scene.appearance.wearing(**frame or {})
    rgb = renderer.render()[renderer.cameras[0]][0]
    note = f"{tick * TICK_S:.1f} s, keypose {recording.keyposes[tick]}"
    if tick < len(recording.states) - 1:
        return Panel(rgb, name, note, INK)
    verdict, color = ("success", GREEN) if episode.success else ("failure", RED)
    return Panel(rgb, f"{name} - {verdict}", note, color)
