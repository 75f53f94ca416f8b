"""A film of an episode of a policy, played again by its recorded actions, beside the expert's of the same seed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from lerobot_bimanual.episode import CONTROL_HZ
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.evaluation.played_episode import PlayedEpisode
from lerobot_env_bimanual.audit.episodes import EpisodeAuditor, expert_env
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.replanning import expert_of
from lerobot_env_bimanual.experts.runner import run_episode
from lerobot_env_bimanual.pictures.layout import GREEN, GREY, INK, PAPER, RED
from lerobot_env_bimanual.pictures.viewpoint import clearest_camera
from lerobot_env_bimanual.world.rendering import Renderer
from lerobot_env_bimanual.world.scene import SceneState
from lerobot_env_bimanual.world.servo_commands import TICK_S
from lerobot_env_bimanual.world.video import VideoWriter

SIZE = (240, 320)
"""Height and width of each of the two pictures, in quality `observation`."""
BAND, TEXT_SIZE, SEAM = 26, 15, 4
EVERY = 2
"""Ticks from one picture of a film to the next."""
LONGEST_NAME = 14
"""Letters that fit beside the other words above a picture."""
CRF = "30"
"""About 8 kB per second of film."""


@dataclass(frozen=True)
class Film:
    """A film of one episode.

    Attributes:
        seed: of the episode.
        success: whether the policy solved it.
        camera: where it is seen from.
        seconds: how long it is.
        mp4: the film, H.264.
        poster: its last picture, JPEG.
    """

    seed: int
    success: bool
    camera: str
    seconds: float
    mp4: bytes
    poster: bytes


@dataclass(frozen=True)
class _Take:
    """What was played: every state, and after how many keyposes it was."""

    who: str
    states: Sequence[SceneState]
    keyposes: Sequence[int]
    success: bool

    def picture(self, renderer: Renderer, env: BimanualEnv, tick: int) -> Image.Image:
        """The scene after a tick under a line of text; the end stays."""
        index = min(tick, len(self.states) - 1)
        env.scene.restore_state(self.states[index])
        framed = Image.new("RGB", (renderer.width, renderer.height + BAND), PAPER)
        framed.paste(Image.fromarray(renderer.render()[renderer.cameras[0]][0]), (0, BAND))
        draw, font = ImageDraw.Draw(framed), ImageFont.load_default(TEXT_SIZE)
        who = self.who if len(self.who) <= LONGEST_NAME else f"{self.who[: LONGEST_NAME - 1]}…"
        draw.text((6, BAND // 2), who, INK, font, anchor="lm")
        is_over = index == len(self.states) - 1
        verdict, color = ("success", GREEN) if self.success else ("failure", RED)
        note = f"{index * TICK_S:.1f} s, keypose {self.keyposes[index]}"
        draw.text((renderer.width - 6, BAND // 2), note, GREY, font, anchor="rm")
        if is_over:
            draw.text((renderer.width // 2, BAND // 2), verdict, color, font, anchor="mm")
        return framed


def film_episode(task: str, options: Mapping[str, str], played: PlayedEpisode, who: str) -> Film:
    """Play an episode again, every state as recorded, then the expert's, and film both side by side.

    Args:
        task: name of the task.
        options: of the evaluation, by name.
        played: the episode.
        who: name of the policy.

    Raises:
        BimanualError: it does not come out as recorded.
    """
    auditor, env = EpisodeAuditor(task, options), expert_env(task, options)
    try:
        takes = (_policys_take(auditor, played, who), _experts_take(env, played))
        return _film(env, takes, played)
    finally:
        auditor.close()
        env.close()


class _Camera:
    """Notes every state of an episode that it observes, and after how many keyposes it was."""

    def __init__(self):
        self.states: list[SceneState] = []
        self.keyposes: list[int] = []

    def note(self, env: BimanualEnv, _: NDArray[np.float32] | None = None) -> None:
        """Note the state before a tick, or at the end."""
        self.states.append(env.scene.save_state())
        self.keyposes.append(env.progress.keyposes)

    def take(self, env: BimanualEnv, who: str, success: bool) -> _Take:
        """What was played, once it is over."""
        self.note(env)
        return _Take(who, self.states, self.keyposes, success)


def _policys_take(auditor: EpisodeAuditor, played: PlayedEpisode, who: str) -> _Take:
    camera = _Camera()
    with auditor.env.observed_by(camera.note):
        audit = auditor.audit(played)
    if audit.problems:
        raise BimanualError(
            f"seed {played.seed} does not come out as recorded ({audit.problems[0]}); `verify-results` says more"
        )
    return camera.take(auditor.env, who, played.success)


def _experts_take(env: BimanualEnv, played: PlayedEpisode) -> _Take:
    camera = _Camera()
    with env.observed_by(camera.note):
        outcome = run_episode(env, played.seed, expert_of(env), variation=played.variation)
    return camera.take(env, "expert", outcome.success)


def _film(env: BimanualEnv, takes: tuple[_Take, _Take], played: PlayedEpisode) -> Film:
    _, experts = takes
    ends = [index for index, (one, next_) in enumerate(pairwise(experts.keyposes)) if one != next_]
    camera = clearest_camera(env.scene, [experts.states[index] for index in (0, *ends, -1)])
    last = max(len(take.states) for take in takes) - 1
    with TemporaryDirectory() as folder, Renderer(env.scene, (camera,), *SIZE) as renderer:
        writer, frame = VideoWriter(Path(folder), "film", CONTROL_HZ // EVERY, CRF), None
        ticks = [*range(0, last, EVERY), last]
        for tick in ticks:
            left, right = (take.picture(renderer, env, tick) for take in takes)
            frame = Image.new("RGB", (left.width + SEAM + right.width, left.height), PAPER)
            frame.paste(left)
            frame.paste(right, (left.width + SEAM, 0))
            writer.add(np.asarray(frame))
        path, poster = writer.close("complete"), BytesIO()
        assert path is not None  # an episode has at least one state
        assert frame is not None
        frame.save(poster, "jpeg", quality=75)
        mp4 = path.read_bytes()
    return Film(played.seed, played.success, camera, len(ticks) * EVERY * TICK_S, mp4, poster.getvalue())
