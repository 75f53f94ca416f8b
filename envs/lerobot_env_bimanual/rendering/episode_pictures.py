"""An episode as one or several players played it: a video, and a contact sheet of its moments, side by side."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from itertools import accumulate
from pathlib import Path

import numpy as np

from lerobot_bimanual.cameras import ROOM_CAMERA_NAMES
from lerobot_bimanual.results.expert_report import EpisodeOutcome
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.rendering.layout import GREEN, INK, PANEL_WIDTH, RED, Panel, contact_sheet, gallery
from lerobot_env_bimanual.rendering.rollout import Rollout
from lerobot_env_bimanual.rendering.viewpoint import frame_of
from lerobot_env_bimanual.world.rendering import Renderer
from lerobot_env_bimanual.world.servo_commands import TICK_S
from lerobot_env_bimanual.world.video import VideoWriter

SIZE = (480, 640)
N_MOMENTS = 6
"""Pictures of each of several players on the sheet, from start to end."""
COLUMNS = 4
"""Of the sheet of one player, with a picture of the start and one of the end of every keypose."""


def write_pictures(
    env: BimanualEnv,
    rollouts: Mapping[str, Rollout[EpisodeOutcome]],
    stem: Path,
    camera: str = "front",
) -> list[Path]:
    """Write a video, in which players that ended earlier keep their last picture, and a contact sheet.

    Args:
        env: environment of all the rollouts; it is left in the last state that was rendered.
        rollouts: the same episode by name of the player, in the order from left to right and from top to bottom.
        stem: path of the files without their suffix; the folder is made.
        camera: name of the camera; a fixed one that is not perturbed turns and zooms to the hands and to what moves.

    Returns:
        The video and the sheet.

    Raises:
        BimanualError: they cannot be written, or not be rendered.
    """
    stem.parent.mkdir(parents=True, exist_ok=True)
    _, outcome = next(iter(rollouts.values()))
    is_single = len(rollouts) == 1
    height, width = SIZE
    moments = {
        player: _moments(outcome, len(recording.states) - 1, is_single)
        for player, (recording, outcome) in rollouts.items()
    }
    view = {}
    # A perturbed camera shows what it sees.
    if camera in ROOM_CAMERA_NAMES and "cam_quat" not in env.scene.appearance.fields:
        seen = [rollouts[player][0].states[tick] for player, shown in moments.items() for tick, _ in shown]
        view = frame_of(env.scene, camera, seen, (height, width))
    with Renderer(env.scene, (camera,), height, width, env.options.render_quality) as renderer:

        def panel(player: str, tick: int, caption: str = "") -> Panel:
            """The scene at a tick; at the last one with the verdict."""
            recording, episode = rollouts[player]
            env.scene.restore_state(recording.states[tick])
            env.scene.appearance = env.scene.appearance.wearing(**view)
            rgb, caption = renderer.render()[camera][0], caption or player
            note = f"{tick * TICK_S:.1f} s, keypose {recording.keyposes[tick]}"
            if tick < len(recording.states) - 1:
                return Panel(rgb, caption, note, INK)
            verdict, color = ("success", GREEN) if episode.success else ("failure", RED)
            return Panel(rgb, f"{caption} - {verdict}", note, color)

        lengths = {player: len(recording.states) for player, (recording, _) in rollouts.items()}
        caption = f"{env.task} v{outcome.variation} {env.options.split} seed{outcome.seed}"
        writer = VideoWriter(stem.parent, stem.name, caption)
        shown = lru_cache(2 * len(rollouts))(panel)
        for tick in range(max(lengths.values())):
            panels = [shown(player, min(tick, length - 1)) for player, length in lengths.items()]
            frame = np.asarray(gallery(panels, len(panels), width if is_single else PANEL_WIDTH))
            rows, columns = (side - side % 2 for side in frame.shape[:2])  # videos need even sides
            writer.add(frame[:rows, :columns])
        verdict = ("success" if outcome.success else "failure") if is_single else ""
        film = writer.close(verdict, name=f"{stem.name}.mp4")
        assert film is not None  # an episode has at least one state
        panels = [panel(player, *moment) for player, shown in moments.items() for moment in shown]
    perturb, split = env.options.perturb, env.options.split
    facts = f"{split} seed {outcome.seed}, variation {outcome.variation}, {f'with {perturb}' if perturb else 'nominal'}"
    lines = (env.task_description, f"{facts}, seen from {camera}")
    sheet = contact_sheet(env.task, lines, panels, columns=COLUMNS if is_single else N_MOMENTS)
    sheet.save(path := stem.with_name(f"{stem.name}.png"))
    return [film, path]


def _moments(episode: EpisodeOutcome, last: int, is_single: bool) -> list[tuple[int, str]]:
    """Ticks of the pictures on the sheet, and what is written below each; "" stands for the player's name."""
    if not is_single or not episode.moves:
        return [(round(tick), "") for tick in np.linspace(0, last, N_MOMENTS)]
    names = ["start", *(f"{number}. {move.name}" for number, move in enumerate(episode.moves, 1))]
    ends = accumulate((move.ticks for move in episode.moves), initial=0)
    return [*zip(ends, names, strict=True)]
