"""Episodes that are played and kept as states, and films of them, several players side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from lerobot_bimanual.cameras import ROOM_CAMERA_NAMES
from lerobot_bimanual.results.expert_report import EpisodeOutcome
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.runner import Player, run_episode
from lerobot_env_bimanual.rendering.viewpoint import frame_of
from lerobot_env_bimanual.world.rendering import Renderer
from lerobot_env_bimanual.world.scene import SceneState
from lerobot_env_bimanual.world.servo_commands import TICK_S
from lerobot_env_bimanual.world.video import VideoWriter

SIZE = (480, 640)
SEVERAL_WIDTH = 400
"""Of the picture of one of several players."""
LINE_HEIGHT, LETTERS, GAP = 34, 19, 16
PAPER, INK, GREY = (255, 255, 255), (32, 34, 40), (112, 116, 126)
GREEN, RED = (22, 128, 60), (196, 38, 34)
type Panel = tuple[NDArray[np.uint8], str, str, tuple[int, int, int]]
"""A picture, the texts at both ends of the line below, and their colour; one other than `INK` also frames the picture."""
FRAMED_TICKS = 10
"""Of so many states one decides what a camera is turned and zoomed to."""


@dataclass
class Recording:
    """States of an episode while it is played.

    Attributes:
        states: states before every tick, and the last one.
        keyposes: number of keyposes completed in each of these states.
    """

    states: list[SceneState] = field(default_factory=list)
    keyposes: list[int] = field(default_factory=list)

    def note(self, env: BimanualEnv) -> None:
        """Append the state at hand."""
        self.states.append(env.scene.save_state())
        self.keyposes.append(env.progress.keyposes)

    @property
    def duration_s(self) -> float:
        """Length of the episode."""
        return (len(self.states) - 1) * TICK_S


type Rollout = tuple[Recording, EpisodeOutcome]
"""States of an episode, and what became of it."""


def rollout(env: BimanualEnv, seed: int, player: Player) -> Rollout:
    """Play an episode, and keep every state of it.

    Args:
        env: environment whose control mode takes the player's actions.
        seed: seed of the reset.
        player: expert or policy.
    """
    recording = Recording()
    with env.observed_by(lambda env, _: recording.note(env)):
        outcome = run_episode(env, seed, player)
    recording.note(env)
    return recording, outcome


def write_film(env: BimanualEnv, rollouts: Mapping[str, Rollout], stem: Path, camera: str = "front") -> Path:
    """Write a video, in which players that ended earlier keep their last picture.

    Args:
        env: environment of all the rollouts; it is left in the last state that was rendered.
        rollouts: the same episode by name of the player, from left to right.
        stem: path of the file without its suffix; the folder is made.
        camera: name of the camera; a fixed one that is not perturbed turns and zooms to the hands and to what moves.

    Returns:
        The file.

    Raises:
        BimanualError: it cannot be written, or not be rendered.
    """
    (height, width), view, (_, outcome) = SIZE, {}, next(iter(rollouts.values()))
    recordings = [recording.states for recording, _ in rollouts.values()]
    # A perturbed camera shows what it sees.
    if camera in ROOM_CAMERA_NAMES and "cam_quat" not in env.scene.appearance.fields:
        seen = [state for states in recordings for state in (*states[::FRAMED_TICKS], states[-1])]
        view = frame_of(env.scene, camera, seen, SIZE)
    with Renderer(env.scene, (camera,), height, width, env.options.render_quality) as renderer:

        @lru_cache(2 * len(rollouts))
        def panel(player: str, tick: int) -> Panel:
            """The scene at a tick; at the last one with the verdict."""
            recording, episode = rollouts[player]
            env.scene.restore_state(recording.states[tick])
            env.scene.appearance = env.scene.appearance.wearing(**view)
            rgb, _ = renderer.render()[camera]
            note = f"{tick * TICK_S:.1f} s, keypose {recording.keyposes[tick]}"
            if tick < len(recording.states) - 1:
                return rgb, player, note, INK
            verdict, color = ("success", GREEN) if episode.success else ("failure", RED)
            return rgb, f"{player} - {verdict}", note, color

        caption = f"{env.task} v{outcome.variation} {env.options.split} seed{outcome.seed}"
        writer, is_single = VideoWriter(stem.parent, stem.name, caption), len(rollouts) == 1
        for tick in range(max(map(len, recordings))):
            panels = [panel(each, min(tick, len(rollouts[each][0].states) - 1)) for each in rollouts]
            writer.add(_side_by_side(panels, width if is_single else SEVERAL_WIDTH))
        verdict = ("success" if outcome.success else "failure") if is_single else ""
        film = writer.close(verdict, name=f"{stem.name}.mp4")
    assert film is not None  # an episode has at least one state
    return film


def _side_by_side(panels: Sequence[Panel], width: int) -> NDArray[np.uint8]:
    """Panels in a row, their pictures scaled to a width in pixels; both sides are even, as videos need it."""
    height = round(width * panels[0][0].shape[0] / panels[0][0].shape[1])
    sheet = Image.new("RGB", (len(panels) * (width + GAP) + GAP, height + LINE_HEIGHT + 2 * GAP), PAPER)
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(LETTERS)
    baseline = GAP + height + LINE_HEIGHT - 9
    for index, (rgb, player, note, color) in enumerate(panels):
        left, is_plain = GAP + index * (width + GAP), color == INK
        picture = Image.fromarray(rgb).resize((width, height), Image.Resampling.LANCZOS)
        sheet.paste(picture, (left, GAP))
        if not is_plain:
            draw.rectangle((left, GAP, left + width - 1, GAP + height - 1), outline=color, width=4)
        draw.text((left + 2, baseline), player, fill=color, font=font, anchor="ls")
        note_color = GREY if is_plain else color
        draw.text((left + width - 2, baseline), note, fill=note_color, font=font, anchor="rs")
    rows, columns = (side - side % 2 for side in (sheet.height, sheet.width))
    return np.asarray(sheet)[:rows, :columns]
