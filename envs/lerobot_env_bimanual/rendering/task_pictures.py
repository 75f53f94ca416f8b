"""Pictures of an expert's episode: a contact sheet and a video."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.results.expert_report import EpisodeOutcome
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.runner import expert
from lerobot_env_bimanual.rendering.layout import GREEN, INK, RED, Panel, contact_sheet
from lerobot_env_bimanual.rendering.rollout import Rollout, rollout
from lerobot_env_bimanual.rendering.viewpoint import clearest_camera
from lerobot_env_bimanual.world.rendering import Renderer
from lerobot_env_bimanual.world.servo_commands import TICK_S
from lerobot_env_bimanual.world.video import VideoWriter

CLEAREST = "clearest"


@dataclass(frozen=True)
class RenderRequest:
    """Which pictures to make.

    Attributes:
        task: registered task name.
        variation: index, or "any".
        split: split of the seed.
        seed: seed of the episode.
        camera: name of a camera, or "clearest" for the fixed camera that shows most of what the episode moves.
        size: height x width in pixels, e.g. "480x640".
        quality: "observation" or "high".
        video: whether a video is made of the whole episode.
        stem: path of the files without their suffix; its folder is created if absent.
    """

    task: str
    variation: str
    split: str
    seed: int
    camera: str
    size: str
    quality: str
    video: bool
    stem: Path

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
        return self.stem.with_suffix(".png")


def render_episode(request: RenderRequest) -> EpisodeOutcome:
    """Let the expert play an episode; write its contact sheet and, if requested, its video.

    Raises:
        BimanualError: the episode cannot be set up, or not be rendered. It is raised as this very class, which a worker
            process can send home.
    """
    try:
        return _render(request)
    except BimanualError as error:
        raise BimanualError(f"{request.task} at {request.split} seed {request.seed}: {error}") from None


def _render(request: RenderRequest) -> EpisodeOutcome:
    env = request.environment()
    played = rollout(env, request.seed, expert())
    ticks = played.outcome.ticks
    ends = [*(start for _, start in played.moves), ticks]
    camera = request.camera
    if camera == CLEAREST:
        camera = clearest_camera(env.scene, [played.states[end] for end in ends])
    with Renderer(env.scene, (camera,), *env.options.size, request.quality) as renderer:

        def image(tick: int) -> NDArray[np.uint8]:
            env.scene.restore_state(played.states[tick])
            return renderer.render()[camera][0]

        request.stem.parent.mkdir(parents=True, exist_ok=True)
        panels = [_panel(played, number, image(end), end) for number, end in enumerate(ends)]
        outcome = played.outcome
        line = f"{request.split} seed {outcome.seed}, variation {outcome.variation}, {ticks * TICK_S:.1f} s, seen from {camera}"
        contact_sheet(request.task, (env.task_description, line), panels).save(request.sheet)
        if request.video:
            writer = VideoWriter(request.stem.parent, request.stem.name)
            for tick in range(len(played.states)):
                writer.add(image(tick))
            video = writer.close("complete")
            assert video is not None  # an episode has at least one state
            video.replace(request.stem.with_suffix(".mp4"))
    env.close()
    return outcome


def _panel(played: Rollout, number: int, rgb: NDArray[np.uint8], tick: int) -> Panel:
    """The start, or the end of a move; the last one with the verdict."""
    caption, color = f"{number}. {played.moves[number - 1][0]}" if number else "start", INK
    if number == len(played.moves):
        verdict, color = ("success", GREEN) if played.outcome.success else ("failure", RED)
        caption = f"{caption} - {verdict}"
    return Panel(rgb, caption, f"{tick * TICK_S:.1f} s", color)
