"""The viewer plays one episode after the other; videos of episodes."""

from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import av
import numpy as np
import pytest

from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.runner import expert
from lerobot_env_bimanual.options import VARIED
from lerobot_env_bimanual.viewer import watch
from lerobot_env_bimanual.world.video import VideoWriter

pytestmark = pytest.mark.sim


class Screen:
    """A window that notes what it shows, and is closed when it has shown a text."""

    def __init__(self, last: str):
        self.last = last
        self.shown: list[str] = []
        self.places: list[np.ndarray] = []
        self.cam: Any = None
        self.models: list[Any] = []
        self.data: Any = None

    @contextmanager
    def open(self, model: Any, data: Any) -> Iterator["Screen"]:
        self.models += [model]
        self.data = data
        self.cam = SimpleNamespace(lookat=np.zeros(3), distance=0.0, azimuth=0.0, elevation=0.0)
        yield self

    def is_running(self) -> bool:
        return not self.shown or self.last not in self.shown[-1]

    def set_texts(self, texts: tuple) -> None:
        self.shown.append(texts[2])

    def sync(self) -> None:
        self.places.append(self.data.qpos.copy())


def test_one_seed_follows_the_other_and_other_things_have_a_window_of_their_own():
    screen, env = Screen("seed 3, "), BimanualEnv("lift_ball", obs="state", setting=VARIED)
    watch(env, expert(), 0, screen.open, sleep=lambda _: None)
    env.close()
    assert screen.shown[0] == "lift the ball\nseed 0, variation 0\n0.0 s"
    assert list(dict.fromkeys(text.splitlines()[1][:6] for text in screen.shown)) == [
        f"seed {seed}" for seed in range(4)
    ]
    assert np.abs(screen.places[0] - screen.places[50]).max() > 0.1
    assert screen.cam.distance > 1
    assert len(screen.models) == len(set(screen.models)) == 2


def read_frames(path) -> np.ndarray:
    with av.open(str(path)) as container:
        return np.stack([frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)])


def test_a_video_holds_every_frame_in_order_in_a_format_that_browsers_play(tmp_path):
    shades = np.linspace(20, 230, 12).astype(np.uint8)
    writer = VideoWriter(tmp_path / "new", "shades")
    for shade in shades:
        writer.add(np.full((48, 64, 3), shade, dtype=np.uint8))
    assert not list(tmp_path.rglob("*.mp4"))  # before it is complete
    path = writer.close("success")
    assert [*(tmp_path / "new").iterdir()] == [path]
    assert path.name == "shades_success.mp4"
    frames = read_frames(path)
    assert frames.shape == (12 + 20, 48, 64, 3)
    held = np.append(shades, [shades[-1]] * 20)
    assert np.abs(frames.mean((1, 2, 3)) - held).max() < 4
    with av.open(str(path)) as container:
        (stream,) = container.streams.video
        context = stream.codec_context
        assert (context.name, context.pix_fmt, stream.average_rate) == ("h264", "yuv420p", 20)


@pytest.fixture
def filming_env(tmp_path):
    env = BimanualEnv("lift_ball", obs="state", split="val", video_dir=tmp_path)
    yield env
    env.close()


def test_an_episode_is_filmed_tick_by_tick_and_named_after_it(filming_env, tmp_path):
    filming_env.reset(seed=5)
    for _ in range(3):
        filming_env.step(filming_env.scene.commanded)
    filming_env.step(np.zeros(18))  # a zero quaternion ends the episode
    (path,) = tmp_path.iterdir()
    assert path.name == "lift_ball_v0_val_seed5_failure.mp4"
    frames = read_frames(path)
    assert frames.shape == (3 + 20, 480, 640, 3)
    caption = frames[:, 2:18].astype(int)
    assert np.all(caption.min(axis=(1, 2, 3)) < 60)
    assert np.all(caption.max(axis=(1, 2, 3)) > 200)
    is_red = caption[..., 0] - caption[..., 1] > 60  # the held frames say that it failed
    assert np.array_equal(is_red.any(axis=(1, 2)), np.arange(23) >= 3)


def test_an_episode_cut_short_is_filmed_as_unfinished(filming_env, tmp_path):
    filming_env.reset(seed=5)
    filming_env.step(filming_env.scene.commanded)
    filming_env.reset(seed=6)
    filming_env.step(filming_env.scene.commanded)
    filming_env.close()
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {f"lift_ball_v0_val_seed{seed}_unfinished.mp4" for seed in (5, 6)}
