"""Videos of episodes."""

import shutil

import av
import gymnasium as gym
import numpy as np
import pytest

from lerobot_bimanual.errors import BimanualError
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.world.video import VideoWriter


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


def test_two_writers_of_one_video_at_once_do_not_disturb_each_other(tmp_path):
    writers = [VideoWriter(tmp_path, "shades"), VideoWriter(tmp_path, "shades")]
    for writer in writers:
        writer.add(np.full((48, 64, 3), 100, dtype=np.uint8))
    assert {writer.close("success") for writer in writers} == {*tmp_path.iterdir()}
    assert len(read_frames(tmp_path / "shades_success.mp4")) == 1 + 20


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


def test_an_environment_goes_on_after_a_video_that_could_not_be_finished(filming_env, tmp_path):
    filming_env.reset(seed=5)
    filming_env.step(filming_env.scene.commanded)
    shutil.rmtree(tmp_path)
    with pytest.raises(BimanualError, match="cannot write videos"):
        filming_env.reset(seed=6)
    filming_env.reset(seed=6)
    filming_env.step(filming_env.scene.commanded)
    filming_env.close()
    assert [path.name for path in tmp_path.iterdir()] == ["lift_ball_v0_val_seed6_unfinished.mp4"]
    filming_env.reset(seed=7)
    filming_env.step(filming_env.scene.commanded)
    shutil.rmtree(tmp_path)
    with pytest.raises(BimanualError, match="cannot write videos"):
        filming_env.close()
    with pytest.raises(gym.error.ResetNeeded):  # it is closed all the same
        filming_env.step(filming_env.action_space.sample())
