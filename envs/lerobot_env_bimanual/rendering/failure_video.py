"""Video of a policy's episode, replayed from its recorded actions, beside the expert's of the same seed."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.joint_action import CONTROL_HZ
from lerobot_bimanual.results.episode import Episode
from lerobot_env_bimanual.experts.runner import expert_of
from lerobot_env_bimanual.rendering.rollout import recorded, rollout
from lerobot_env_bimanual.rendering.side_by_side import frames
from lerobot_env_bimanual.rendering.viewpoint import clearest_camera, frame_of
from lerobot_env_bimanual.verification.episodes import EpisodeVerifier, expert_env
from lerobot_env_bimanual.world.rendering import Renderer
from lerobot_env_bimanual.world.servo_commands import TICK_S
from lerobot_env_bimanual.world.video import VideoWriter

SIZE = (240, 320)
"""Height and width of each of the two pictures, in quality `observation`."""
EVERY = 2
"""Ticks from one frame to the next."""
CRF = "30"
"""About 8 kB per second of video."""


@dataclass(frozen=True)
class FailureVideo:
    """Video of one episode.

    Attributes:
        seed: seed of the episode.
        camera: name of the camera.
        seconds: length.
        mp4: the video, H.264.
        poster: its last frame, JPEG.
    """

    seed: int
    camera: str
    seconds: float
    mp4: bytes
    poster: bytes


def failure_video(task: str, options: Mapping[str, str | int], policy: str, played: Episode) -> FailureVideo:
    """Replay an episode, every state as recorded, then play the expert's, and show both side by side.

    Args:
        task: name of the task.
        options: options of the evaluation, by name.
        policy: name of the policy.
        played: the episode.

    Raises:
        BimanualError: the replay differs from the record.
    """
    with closing(EpisodeVerifier(task, options)) as verifier, closing(expert_env(task, options)) as env:
        with recorded(verifier.env) as recording:
            differences = verifier.differences(played)
        if differences:
            raise BimanualError(
                f"seed {played.seed} replays otherwise than recorded ({differences[0]}); `results verify` says more"
            )
        expert, outcome = rollout(env, played.seed, expert_of(env), played.variation)
        ends = [index for index, (one, next_) in enumerate(pairwise(expert.keyposes)) if one != next_]
        seen = [expert.states[index] for index in (0, *ends, -1)]
        camera = clearest_camera(env.scene, seen)
        rollouts = {policy: (recording, played), "expert": (expert, outcome)}
        with TemporaryDirectory() as folder, Renderer(env.scene, (camera,), *SIZE) as renderer:
            caption = f"{task} v{played.variation} {env.options.split} seed{played.seed}"
            writer, last = VideoWriter(Path(folder), "video", CONTROL_HZ // EVERY, CRF, caption), None
            for frame in frames(
                env, renderer, rollouts, EVERY, SIZE[1], frame_of(env.scene, camera, seen, SIZE)
            ):
                writer.add(frame)
                last = Image.fromarray(frame)
            path, poster = writer.close("success" if played.success else "failure"), BytesIO()
            assert path is not None  # an episode has at least one state
            assert last is not None
            last.save(poster, "jpeg", quality=75)
            seconds = writer.frames * EVERY * TICK_S
            return FailureVideo(played.seed, camera, seconds, path.read_bytes(), poster.getvalue())
