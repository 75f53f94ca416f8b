import av
import numpy as np
import pytest

from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.world.video import VideoWriter


def read_frames(path) -> np.ndarray:
    with av.open(str(path)) as container:
        return np.stack([frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)])


def test_a_video_holds_every_frame_in_order(tmp_path):
    shades = np.linspace(20, 230, 12).astype(np.uint8)
    writer = VideoWriter(tmp_path, "shades")
    for shade in shades:
        writer.add(np.full((48, 64, 3), shade, dtype=np.uint8))
    frames = read_frames(writer.close("success"))
    assert frames.shape == (12, 48, 64, 3)
    assert np.abs(frames.mean((1, 2, 3)) - shades).max() < 4


def test_a_video_is_h264_that_browsers_play(tmp_path):
    writer = VideoWriter(tmp_path, "clip", fps=20)
    writer.add(np.zeros((48, 64, 3), dtype=np.uint8))
    with av.open(str(writer.close("success"))) as container:
        stream = container.streams.video[0]
        assert stream.codec_context.name == "h264"
        assert stream.codec_context.pix_fmt == "yuv420p"
        assert stream.average_rate == 20


def test_a_video_has_its_name_only_when_it_is_complete(tmp_path):
    writer = VideoWriter(tmp_path / "new", "clip")
    writer.add(np.zeros((48, 64, 3), dtype=np.uint8))
    assert not list(tmp_path.rglob("*.mp4"))
    writer.close("failure")
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["clip_failure.mp4"]


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
    assert read_frames(path).shape == (3, 480, 640, 3)


def test_an_episode_cut_short_is_filmed_as_unfinished(filming_env, tmp_path):
    filming_env.reset(seed=5)
    filming_env.step(filming_env.scene.commanded)
    filming_env.reset(seed=6)
    filming_env.step(filming_env.scene.commanded)
    filming_env.close()
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {f"lift_ball_v0_val_seed{seed}_unfinished.mp4" for seed in (5, 6)}
