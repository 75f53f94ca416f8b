"""The command `task render`: its files, and its failures."""

from collections.abc import Callable
from pathlib import Path

import av
import numpy as np
import pytest

from lerobot_bimanual.errors import BimanualError
from lerobot_env_bimanual.commands.task_render import TaskRenderConfig, task_render
from lerobot_env_bimanual.rendering.layout import CAPTION_HEIGHT, GAP
from lerobot_env_bimanual.tasks.registry import get_task
from lerobot_env_bimanual.workers import WorkerPool


@pytest.fixture
def small(tmp_path: Path) -> Callable[..., TaskRenderConfig]:
    def options(**others) -> TaskRenderConfig:
        defaults = {"task": "lift_ball", "image_size": "48x64", "quality": "observation", "workers": 1}
        return TaskRenderConfig(**defaults | others, output=tmp_path / "new")

    return options


@pytest.mark.sim
def test_two_tasks_become_sheets_and_videos(small) -> None:
    config = small(task="lift_ball,dual_push_buttons")
    task_render(config)
    names = [f"{task}{suffix}" for task in ("lift_ball", "dual_push_buttons") for suffix in (".png", ".mp4")]
    assert {path.name for path in config.output.iterdir()} == {*names}
    with av.open(str(config.output / "lift_ball.mp4")) as video:
        frames = [frame.to_ndarray(format="rgb24").astype(float) for frame in video.decode(video=0)]
        assert video.streams.video[0].average_rate == 20
    assert frames[0].shape == (48 + CAPTION_HEIGHT + 2 * GAP, 64 + 2 * GAP, 3)
    assert len(frames) > 60
    assert np.abs(frames[0] - frames[-1]).mean() > 2


@pytest.mark.sim
def test_a_failing_expert_is_an_error_that_says_where_and_its_sheets_are_written(
    small, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(WorkerPool, "map", lambda _, function, items, *__, **___: map(function, items))
    task_class = type(get_task("lift_ball"))
    whole = task_class.script

    def without_lift(*arguments):
        return (stage for stage in whole(*arguments) if stage.name != "lift")

    monkeypatch.setattr(task_class, "script", without_lift)
    config = small(first_seed=4, episodes=2, video=False)
    with pytest.raises(BimanualError, match="lift_ball failed at test seed 4, stage 'squeeze': no move left"):
        task_render(config)
    written = {path.name for path in config.output.iterdir()}
    assert written == {"lift_ball_seed4.png", "lift_ball_seed5.png"}


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ({"task": "lift_bal"}, "lift_ball"),
        ({"variation": "7"}, "integer from 0 to 0"),
        ({"first_seed": -1}, "at least 0"),
    ],
)
def test_wrong_options_are_refused_before_anything_is_written(small, option, message) -> None:
    config = small(**option)
    with pytest.raises(BimanualError, match=message):
        task_render(config)
    assert not config.output.exists()
